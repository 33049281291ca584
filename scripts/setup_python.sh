#!/usr/bin/env bash
# setup_python.sh [LIST | --again]: installs the Python packages of scripts/LIST from PyPI into the virtual environment
# build/python, which sees Debian's packages too. LIST is python-packages-tests.txt by default; those of python-packages.txt,
# which the programs need, always come with it. --again only looks after the lists that an environment has already.
#
# Before and after scripts/setup.sh, in any order: what Debian has, or would install, is never there in a second version
# (python_environment.py). An environment that does not work, by an earlier version of this script or by an upgrade of
# Debian, is made again. The script may be repeated without harm.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

environment=build/python
declare -A lists=()
for stamp in "$environment"/python-packages*.txt; do [ ! -e "scripts/${stamp##*/}" ] || lists[${stamp##*/}]=1; done
if [ "${1:-}" = --again ]; then
  [ ${#lists[@]} -gt 0 ] || exit 0
else
  lists[python-packages.txt]=1 lists[${1:-python-packages-tests.txt}]=1
fi
requirements=("${!lists[@]}")
for list in "${requirements[@]}"; do [ -e "scripts/$list" ] || { echo "setup: there is no scripts/$list" >&2; exit 2; }; done
python=/usr/bin/python3
[ -x "$python" ] || python=$(command -v python3) || { echo "setup: there is no python3: scripts/setup.sh installs it" >&2; exit 3; }

mkdir -p build
exec 9>build/python.lock
! command -v flock >/dev/null || flock 9
# What the environment was made from; a stamp for each list holds it.
state() {
  { pwd; cat scripts/python_environment.py "${requirements[@]/#/scripts/}"; "$python" -VV
    dpkg-query -W -f='${Package} ${Version}\n' 'python3*' || true
    ls -d "$environment"/lib/python*/site-packages/*-info || true; } 2>/dev/null | sha256sum
}
current=$(state)
for list in "${requirements[@]}"; do
  [ "$(cat "$environment/$list" 2>/dev/null)" = "$current" ] || { current=''; break; }
done
if [ -n "$current" ]; then
  echo "setup: $environment has ${requirements[*]}"
  exit 0
fi

# Debian's own come first where that may be: copies from PyPI would take twice the space.
if [[ " ${requirements[*]} " == *-tests.txt* ]] && command -v apt-get >/dev/null; then
  ABS_HIL_SETUP=python scripts/setup.sh packages-analysis.txt ||
    echo "setup: what packages-analysis.txt lacks comes from PyPI, in the versions of Debian"
fi

problems() { "$environment/bin/python" -W ignore scripts/python_environment.py problems "$python" "$environment/constraints.txt"; }
# make_it keep|anew|whole: status 1 if the environment does not work. With `whole` it has copies of Debian's packages in
# Debian's versions: others stand before them, as of `pip install --user`.
make_it() {
  if [ "$1" != keep ]; then
    [ -e "$environment.old" ] || [ ! -e "$environment" ] || mv "$environment" "$environment.old"
    "$python" -m venv --clear --system-site-packages "$environment" || give_up "python3-venv is missing: scripts/setup.sh installs it" 3
  fi
  "$python" scripts/python_environment.py constraints >"$environment/constraints.txt"
  # For every pip in this environment, also one that a user starts.
  printf '[install]\nconstraint = file://%s\n' "$(realpath "$environment" | sed 's/%/%25/g; s/ /%20/g')/constraints.txt" >"$environment/pip.conf"
  [ "$1" != keep ] || problems || return 1
  local more=()
  [ "$1" != whole ] || more=(-r "$environment/constraints.txt")
  PIP_USER=0 "$environment/bin/python" -m pip install --quiet --disable-pip-version-check -c "$environment/constraints.txt" \
    "${requirements[@]/#/-rscripts/}" "${more[@]}" || give_up "pip failed, see above" 1
  problems
}
give_up() {
  [ $way = keep ] || rm -rf "$environment"
  [ ! -e "$environment.old" ] || mv "$environment.old" "$environment"
  echo "setup: $environment is not made: $1" >&2
  exit "$2"
}

[ ! -e "$environment.old" ] || { rm -rf "$environment"; mv "$environment.old" "$environment"; }  # interrupted before
version=$("$python" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
way=anew
if [ -x "$environment/bin/python" ] && [ -d "$environment/lib/python$version/site-packages/pip" ] &&
  grep -q '^include-system-site-packages = true' "$environment/pyvenv.cfg" && grep -qF "$PWD/$environment/" "$environment/bin/pip"; then
  way=keep
fi
until make_it $way; do
  case $way in
    keep) way=anew; echo "setup: $environment does not work, see above: it is made again" ;;
    anew) way=whole; echo "setup: other packages stand before Debian's, see above: $environment gets Debian's versions" ;;
    whole) give_up "its packages do not fit each other, see above" 3 ;;
  esac
done
rm -rf "$environment.old"
current=$(state)
for list in "${requirements[@]}"; do echo "$current" >"$environment/$list"; done
echo "setup: installed ${requirements[*]} into $environment"
