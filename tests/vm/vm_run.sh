#!/usr/bin/env bash
# vm_run.sh [options] -- COMMAND: boots the PREEMPT_RT kernel under QEMU's software emulation, runs COMMAND there (bash,
# as root, in this folder, with this computer's files read-only) and ends with its exit status.
#   -M "MODULES"  kernel modules to have at hand (modprobe them in COMMAND)
#   -q "ARGS"     further arguments for QEMU, such as devices
#   -a "ARGS"     further arguments for the kernel
#   -o DIR        a folder that the command may write to, as /out
#   -s N, -m MEM  CPUs (2) and memory (1G)
#   -t SECONDS    time limit on this computer's clock (120)
#   -V            virtual time: one CPU whose clock counts instructions (8 ns each), so that timing repeats itself
#   -F            the same with 2 ns each: where two programs and a simulated rig share that CPU
#   -C FILE       with -V or -F: the machine's real-time clock shows the time that libfaketime reads from FILE
#   -S            systemd as the first process, COMMAND as a service of it
# Status 77: QEMU or the kernel cannot be had here, the reason on stderr.
# Status 125: the machine ended without a status; its console is on stderr.
set -euo pipefail
here=$(dirname "$(realpath "$0")")
PATH=$PATH:/usr/sbin:/sbin  # modprobe, depmod


modules='' out='' cpus=2 memory=1G limit_s=120 accelerator='tcg,thread=multi' boot_arguments='' qemu=(qemu-system-x86_64)
qemu_arguments=()
while getopts M:q:a:o:s:m:t:C:VSF option; do
  case $option in
    M) modules=$OPTARG ;;
    q) read -ra words <<<"$OPTARG"; qemu_arguments+=("${words[@]}") ;;
    a) boot_arguments+=" $OPTARG" ;;
    o) out=$(realpath "$OPTARG") ;;
    s) cpus=$OPTARG ;;
    m) memory=$OPTARG ;;
    t) limit_s=$OPTARG ;;
    V) cpus=1 accelerator='tcg,thread=single'; qemu_arguments+=(-icount 'shift=3,sleep=off' -rtc 'base=utc,clock=vm') ;;
    C) library=$(echo /usr/lib/*/faketime/libfaketimeMT.so.1)
       qemu=(env "LD_PRELOAD=$library" "FAKETIME_TIMESTAMP_FILE=$OPTARG" FAKETIME_NO_CACHE=1 FAKETIME_DONT_FAKE_MONOTONIC=1
         "${qemu[@]}")
       qemu_arguments+=(-rtc 'base=utc,clock=host') ;;
    S) boot_arguments+=' with_systemd systemd.show_status=false systemd.log_level=warning' ;;
    F) cpus=1 accelerator='tcg,thread=single'; qemu_arguments+=(-icount 'shift=1,sleep=off' -rtc 'base=utc,clock=vm') ;;
    *) exit 2 ;;
  esac
done
shift $((OPTIND - 1))

cannot() { echo "SKIPPED: $*" >&2; exit 77; }

[ -e /lib/systemd/systemd ] || [[ $boot_arguments != *with_systemd* ]] ||
  cannot "systemd is not installed (scripts/setup.sh packages-vm.txt)"
for program in qemu-system-x86_64 busybox cpio modprobe depmod python3; do
  command -v "$program" >/dev/null || cannot "$program is not installed (scripts/setup.sh packages-vm.txt)"
done
[ -z "${library:-}" ] || [ -e "$library" ] || cannot "libfaketime is not installed (scripts/setup.sh packages-vm.txt)"
kernel=$("$here/fetch_kernel.sh") || cannot "no PREEMPT_RT kernel"
version=$(ls "$kernel/lib/modules")

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
disk=$scratch/disk
mkdir -p "$disk"/{bin,proc,sys,dev} "$disk/lib/modules/$version"
cp "$(command -v busybox)" "$disk/bin/busybox"
for applet in sh mount mkdir cat modprobe ip stty setsid chroot dd printf poweroff sync cp grep uname echo rm switch_root; do
  ln -s busybox "$disk/bin/$applet"
done
boot_modules='virtio_pci 9pnet_virtio 9p overlay'
echo "$boot_modules" >"$disk/modules-to-load"
# shellcheck disable=SC2086  # several modules in one word
modprobe -d "$kernel" -S "$version" -a --show-depends $boot_modules $modules |
  awk '$1 == "insmod" { print $2 }' | sort -u | xargs -I{} cp {} "$disk/lib/modules/$version/"
cp "$kernel/lib/modules/$version"/modules.{builtin,builtin.modinfo,order} "$disk/lib/modules/$version/"
depmod -b "$disk" "$version"
printf 'export HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin\ncd %q\n%s\n' "$PWD" "$*" >"$disk/command"
install -m 755 "$here/init.sh" "$disk/init"
cp "$here/vm-command.service" "$disk/"
(cd "$disk" && find . | cpio -o -H newc -R 0:0 --quiet) >"$scratch/initrd"
if [ -n "$out" ]; then
  qemu_arguments+=(-virtfs "local,path=$out,mount_tag=out,security_model=none")
  boot_arguments+=' with_out_folder'
fi

# no_timer_check: on a busy host the kernel's look at its timer may see no tick, and it would give up.
# Not KVM: it does not work for these kernels on every host that has /dev/kvm.
status=0
timeout "$limit_s" "${qemu[@]}" -accel "$accelerator" -cpu max -smp "$cpus" -m "$memory" \
  -kernel "$kernel/vmlinux" -initrd "$scratch/initrd" \
  -append "console=ttyS0 quiet panic=-1 nokaslr mitigations=off no_timer_check $boot_arguments" \
  -display none -monitor none -no-reboot -nic none \
  -virtfs local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap \
  -device isa-debug-exit,iobase=0xf4,iosize=1 \
  -serial "file:$scratch/console" -serial "file:$scratch/output" "${qemu_arguments[@]}" </dev/null || status=$?

tr -d '\r' <"$scratch/output"
# A kernel that panics leaves QEMU's own status at 0: only the marker counts.
marker=$(grep -a -o 'vm-exit [0-9]*' "$scratch/console" | cut -d' ' -f2 || true)
[ -n "$marker" ] && exit "$marker"
echo "vm_run: the machine gave no exit status (QEMU's: $status; 124: over $limit_s s); its console:" >&2
tail -n 20 "$scratch/console" >&2
exit 125
