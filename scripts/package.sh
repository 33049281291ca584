#!/usr/bin/env bash
# Makes the Debian packages abs-hil, libabs-hil-dev and python3-abs-hil in build/release/packages. lintian checks them.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

scripts/setup.sh packages-package.txt
scripts/setup_python.sh python-packages.txt  # plotly.js, which Debian 12 lacks: python3-abs-hil brings it
scripts/build.sh release --target abs_hil_installed
rm -rf build/release/packages
(cd build/release && cpack -B packages >cpack.log 2>&1) || { cat build/release/cpack.log; exit 1; }
rm -rf build/release/packages/_CPack_Packages
ls -l build/release/packages/*.deb
lintian --fail-on error --allow-root build/release/packages/*.deb
