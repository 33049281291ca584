#!/usr/bin/env bash
# build.sh [PRESET [ARGUMENT...]]: configures and builds one preset (default: release), with ccache where it is installed;
# further arguments go to the build (--target NAME).
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

preset=${1:-release}
[ $# -gt 0 ] && shift
launcher=()
if command -v ccache >/dev/null; then
  launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
  export CCACHE_BASEDIR=$PWD CCACHE_NOHASHDIR=1  # clones in other folders share what it holds
fi
cmake --preset "$preset" "${launcher[@]}" >"/tmp/abs_hil_configure.$$" || { cat "/tmp/abs_hil_configure.$$"; exit 1; }
rm -f "/tmp/abs_hil_configure.$$"
cmake --build --preset "$preset" "$@"
