#!/bin/busybox sh
# shellcheck shell=dash
# First process of the virtual machine: shows the host's files, read-only under a scratch layer, runs /command in them
# and ends the machine. Output goes to the second serial line, the exit status to the first.
export PATH=/bin:/sbin:/usr/bin:/usr/sbin
mount -t devtmpfs dev /dev
mount -t proc proc /proc
mount -t sysfs sys /sys
# shellcheck disable=SC2013  # a list of words
for module in $(cat /modules-to-load); do modprobe "$module" || echo "modprobe $module failed"; done

mkdir -p /host /scratch /guest
mount -t tmpfs scratch /scratch
mkdir /scratch/upper /scratch/work
mount -t 9p -o trans=virtio,version=9p2000.L,ro,msize=262144,cache=loose host /host || echo "9p: no host files"
mount -t overlay -o lowerdir=/host,upperdir=/scratch/upper,workdir=/scratch/work root /guest
for folder in proc sys dev; do mkdir -p /guest/$folder; mount -o bind /$folder /guest/$folder; done
mkdir -p /guest/dev/shm /guest/dev/pts /guest/run
mount -t tmpfs shm /guest/dev/shm
mount -t devpts pts /guest/dev/pts
mount -t tmpfs run /guest/run
version=$(uname -r)
mkdir -p "/guest/lib/modules/$version"
cp -r "/lib/modules/$version/." "/guest/lib/modules/$version" # switch_root empties this file system
if grep -q with_out_folder /proc/cmdline; then
  mkdir -p /guest/out
  mount -t 9p -o trans=virtio,version=9p2000.L,msize=262144 out /guest/out
fi
ip link set lo up

cp /command /guest/run/command
stty -F /dev/ttyS1 raw -echo
if grep -q with_systemd /proc/cmdline; then
  # systemd as the first process of this computer's files, with none of the services that are enabled here.
  mkdir -p /guest/run/systemd/system
  cp /vm-command.service /guest/run/systemd/system/
  cat >/guest/run/command-and-end <<'END'
/bin/bash /run/command >/dev/ttyS1 2>&1 </dev/null
echo "vm-exit $?" >/dev/ttyS0
printf '\001' | dd of=/dev/port bs=1 seek=244 2>/dev/null
END
  : >/guest/etc/fstab
  echo 0123456789abcdef0123456789abcdef >/guest/etc/machine-id
  rm -f /guest/.dockerenv
  exec switch_root /guest /lib/systemd/systemd --unit=vm-command.service
fi
setsid chroot /guest /bin/bash /run/command >/dev/ttyS1 2>&1 </dev/null
status=$?
sync
echo "vm-exit $status" >/dev/ttyS0
printf '\001' | dd of=/dev/port bs=1 seek=244 2>/dev/null # QEMU's isa-debug-exit ends the machine at once
poweroff -f
