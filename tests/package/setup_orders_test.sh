#!/usr/bin/env bash
# setup_orders_test.sh SOURCE [newest|lowest [ORDER...]]: the set-up scripts in a bare Debian 12 in all useful orders. After
# each, every abs_* program shows its help, and a run is made, reported and converted. The programs are those of
# SOURCE/build/release. Packages of PyPI are today's newest, then the lowest that the lists allow. An order is a word of:
#   A  scripts/setup.sh                        B  scripts/setup.sh packages-analysis.txt    C  ... packages-tests.txt
#   D  scripts/setup_python.sh python-packages.txt   E  scripts/setup_python.sh
#   V  apt-get install python3-venv            u  E by a user who may not install Debian's packages
#   L  Debian's package lists are gone         O  the environment of an earlier version, with another NumPy
#   N  a NumPy that pip puts beside Debian's: E mends even that
set -euo pipefail
here=$(dirname "$(realpath "$0")")
# shellcheck source=tests/package/bare_root.sh
. "$here/bare_root.sh"
source=$(realpath "$1") kinds=${2:-newest lowest}
[ -x "$source/build/release/bin/abs_report" ] || { echo "SKIPPED: no $source/build/release/bin/abs_report"; exit 77; }

if [ "${ABS_HIL_OWN_MOUNTS:-}" != 1 ]; then
  if [ -z "${ABS_HIL_ORDERS:-}" ]; then  # a folder to be kept, for who looks for a cause
    ABS_HIL_ORDERS=$(mktemp -d /var/tmp/abs_hil_orders.XXXXXX)
    trap 'rm -rf --one-file-system "$ABS_HIL_ORDERS"' EXIT
  fi
  export ABS_HIL_ORDERS
  own_mounts "$@"
fi
declare -A every=([newest]="ABCDE ADB ADEBC AEDB ADCBE ACEB BAD VDAB VEAB BVEAC AuB ALuBE AOB AOE ANE" [lowest]="ADE AEB VEAB AuB")
work=$ABS_HIL_ORDERS root=$work/root cache=${XDG_CACHE_HOME:-$HOME/.cache}/abs_hil/bare-debian
mkdir -p "$root" "$work/layers" "$cache/archives" "$cache/pip"
make_bare_root "$work/base"

# enter LOWER UPPER: $root is LOWER with what is new going into UPPER.
enter() {
  mkdir -p "$2" "$work/overlay"
  mount -t overlay overlay -o "lowerdir=$1,upperdir=$2,workdir=$work/overlay" "$root"
  mount_system "$root"
  mkdir -p "$root/srv/.cache/pip" "$root$source/build/release"
  mount --bind "$cache/archives" "$root/var/cache/apt/archives"
  mount --bind "$cache/pip" "$root/srv/.cache/pip"
  mount --bind -o ro "$source/build/release" "$root$source/build/release"
}
leave() { umount -R "$root"; }

here_inside() { inside bash -c "cd '$source' && $1"; }
user="setpriv --reuid=1000 --regid=1000 --clear-groups env HOME=/home/user PIP_CACHE_DIR=/tmp/pip"
do_step() {
  case $1 in
    A) here_inside scripts/setup.sh ;;
    B) here_inside "scripts/setup.sh packages-analysis.txt" ;;
    C) here_inside "scripts/setup.sh packages-tests.txt" ;;
    D) here_inside "scripts/setup_python.sh python-packages.txt" ;;
    E) here_inside scripts/setup_python.sh ;;
    V) inside apt-get install -y -qq --no-install-recommends python3-venv ;;
    u) here_inside "mkdir -p /home/user && chown 1000 . build /home/user && $user scripts/setup_python.sh" ;;
    L) inside sh -c 'rm -rf /var/lib/apt/lists/*' ;;
    O) here_inside "python3 -m venv --system-site-packages build/python && build/python/bin/pip install --quiet plotly mcap 'numpy>=2.3' &&
      echo 'plotly mcap' >build/python/python-packages.txt" ;;
    N) here_inside "python3 -m venv /tmp/venv && /tmp/venv/bin/pip install --quiet --target /usr/local/lib/python3.11/dist-packages 'numpy>=2.3'" ;;
  esac
}
# The checks of a complete order, in the root.
check() {
  cat >"$root/tmp/check.sh" <<'CHECK'
set -euo pipefail
bin=$PWD/build/release/bin
for program in "$bin"/abs_{report,compare_tables,tune,learn,identify,benchmark,convert,watch,export-fmu,serve,lab,rig,python_host}; do
  "$program" --help >/dev/null && "$program" --version >/dev/null
done
work=$(mktemp -d) && cd "$work"
"$bin/abs_hil" --fast --no-lcm --out run >/dev/null
"$bin/abs_report" run --table >table.txt && grep -q stop table.txt
modules() { for module; do "$python" -c "import $module" 2>/dev/null || return 1; done; }
python=$OLDPWD/build/python/bin/python
if [ -x "$python" ]; then
  "$bin/abs_report" run --out page.html >/dev/null && "$bin/abs_hil" convert run run.mcap >/dev/null
  "$python" -W ignore "$OLDPWD/scripts/python_environment.py" problems /usr/bin/python3 <("$python" "$OLDPWD/scripts/python_environment.py" constraints)
else
  python=/usr/bin/python3
fi
if modules matplotlib; then "$bin/abs_report" run --out figures.html --figures figures >/dev/null; fi
if modules scipy; then "$bin/abs_report" run --octave --out run.mat && "$bin/abs_hil" tune --controllers pi --generations 1 --cases 1 --folder tuned >/dev/null 2>&1; fi
if modules pyarrow; then "$bin/abs_report" run --parquet --out run.parquet; fi
"$python" -c 'import numpy, pandas; print("NumPy", numpy.__version__, "of", numpy.__file__, "pandas", pandas.__version__)'
CHECK
  here_inside "bash /tmp/check.sh"
}

failed=()
for kind in $kinds; do
  tree=$work/layers/$kind
  root=$work/root
  enter "$work/base" "$tree"
  rm -rf "${root:?}$source/scripts"  # an earlier clone
  git clone -q "file://$source" "$root/tmp/clone" && cp -a "$root/tmp/clone/." "$root$source/" && rm -rf "$root/tmp/clone"
  [ "$kind" = newest ] || sed -i 's/>=/==/' "$root$source"/scripts/python-packages*.txt
  inside apt-get update -qq
  leave
  read -ra orders <<<"${every[$kind]}"
  [ $# -lt 3 ] || orders=("${@:3}")
  for order in "${orders[@]}"; do
    lower=$tree:$work/base log=$work/$kind-$order.log status=0 begin=$SECONDS
    for ((i = 1; i <= ${#order}; ++i)); do
      layer=$tree-${order:0:i}
      if [ ! -e "$layer.done" ]; then  # orders that begin alike share their layers
        rm -rf "$layer"
        enter "$lower" "$layer"
        do_step "${order:i-1:1}" >>"$log" 2>&1 || status=$?
        leave
        [ $status = 0 ] || break
        touch "$layer.done"
      fi
      lower=$layer:$lower
    done
    if [ $status = 0 ]; then
      enter "$lower" "$work/scratch"
      check >>"$log" 2>&1 || status=$?
      leave
      rm -rf "$work/scratch"
    fi
    if [ $status = 0 ]; then
      step "$kind $order: right in $((SECONDS - begin)) s: $(tail -1 "$log")"
    else
      tail -20 "$log"
      step "$kind $order: FAILED with status $status"
      failed+=("$kind $order")
    fi
  done
done
[ ${#failed[@]} -eq 0 ] || { echo "failed: ${failed[*]}"; exit 1; }
