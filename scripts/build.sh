#!/usr/bin/env bash
# Configures and builds one preset (default: release), with ccache where it is installed.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

preset=${1:-release}
launcher=()
if command -v ccache >/dev/null; then launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache); fi
cmake --preset "$preset" "${launcher[@]}" >"/tmp/abs_hil_configure.$$" || { cat "/tmp/abs_hil_configure.$$"; exit 1; }
rm -f "/tmp/abs_hil_configure.$$"
cmake --build --preset "$preset"
