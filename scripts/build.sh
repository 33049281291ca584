#!/usr/bin/env bash
# build.sh [PRESET [ARGUMENT...]]: configures and builds one preset (default: release). A new build folder uses ccache if it is
# installed; another keeps its compiler as it is, since a change would compile all of it again.
# Further arguments go to the build (--target NAME). On a terminal the progress stays on one line. Elsewhere the script
# prints a line at each tenth of the steps. It always prints warnings and errors whole.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

preset=${1:-release}
[ $# -gt 0 ] && shift
launcher=()
export CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1  # clones in other folders share what ccache holds
if command -v ccache >/dev/null && [ ! -e "build/$preset/CMakeCache.txt" ]; then
  launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
fi
cmake --preset "$preset" "${launcher[@]}" >"/tmp/abs_hil_configure.$$" || { cat "/tmp/abs_hil_configure.$$"; exit 1; }
rm -f "/tmp/abs_hil_configure.$$"

# Reads ninja's output. Prints only those progress lines that complete a tenth of the steps, and all other lines whole.
print_tenths() {
  local line tenth=0
  while IFS= read -r line; do
    if [[ $line =~ ^build:\ ([0-9]+)\ of\ ([0-9]+)\ steps,\ [0-9.]+\ s ]]; then
      if [ $((BASH_REMATCH[1] * 10 / BASH_REMATCH[2])) -gt $tenth ]; then
        tenth=$((BASH_REMATCH[1] * 10 / BASH_REMATCH[2]))
        echo "${BASH_REMATCH[0]}"
      fi
    else
      printf '%s\n' "$line"
    fi
  done
}

# Ninja starts two jobs more than there are processors. A compiler never waits for a disk here, so that costs 5 % of the time.
export CMAKE_BUILD_PARALLEL_LEVEL=${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}
export NINJA_STATUS='build: %f of %t steps, %e s  '
if [ -t 1 ]; then
  cmake --build --preset "$preset" "$@"
else
  cmake --build --preset "$preset" "$@" 2>&1 | print_tenths
fi
