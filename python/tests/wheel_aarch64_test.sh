#!/usr/bin/env bash
# wheel_aarch64_test.sh WHEEL: installs a wheel for Linux on 64-bit ARM (of Python 3.11) beside Debian's Python for that
# processor, under qemu-user, with the newest dependencies, and runs the tests of the package that need no network. It also
# runs the table of bits as a program. scripts/wheels.sh linux-aarch64 has built both.
#
# Needs qemu-user-static and dpkg's architecture arm64 (dpkg --add-architecture arm64 && apt-get update). Status 77 without.
# Wheels are unpacked, not installed: pip under qemu takes minutes. Left out: the test of time to Ctrl-C, for which emulation is
# too slow, and test_files.py, which starts this Python again, as the kernel cannot without binfmt.
set -euo pipefail
source=$(realpath "$(dirname "$(realpath "$0")")/../..")
wheel=$(realpath "$1")
command -v qemu-aarch64-static >/dev/null || { echo "SKIPPED: apt-get install qemu-user-static"; exit 77; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
unset PYTHONPATH
cd "$scratch"
packages=(libc6 libstdc++6 libgcc-s1 zlib1g libexpat1 libssl3 libffi8 libbz2-1.0 liblzma5 libsqlite3-0 libuuid1 libcrypt1
  python3.11-minimal libpython3.11-minimal libpython3.11-stdlib)
apt-get download -q "${packages[@]/%/:arm64}" >download.log 2>&1 || { cat download.log; echo "SKIPPED: no packages of arm64"; exit 77; }
for package in *.deb; do dpkg -x "$package" debian; done
arm=(qemu-aarch64-static -L "$scratch/debian")
"${arm[@]}" "$source/build/wheels/linux-aarch64/tests/run_bits" "$source/tests/core/run_bits.tsv" "$source/config"
python3 -m pip download --quiet --disable-pip-version-check --platform manylinux_2_28_aarch64 --platform manylinux2014_aarch64 \
  --python-version 3.11 --only-binary :all: -d wheels numpy pandas matplotlib scipy jinja2 plotly rich tqdm pytest
for package in wheels/*.whl "$wheel"; do unzip -qo "$package" -d site; done
mkdir -p debian/usr/share && mv site/abs_hil-*.data/data/share/abs_hil debian/usr/share/
export PYTHONPATH=$scratch/site PYTHONDONTWRITEBYTECODE=1 OPENBLAS_NUM_THREADS=1 MPLBACKEND=agg ABS_HIL_BUILD=$source/build/release
python=("${arm[@]}" "$scratch/debian/usr/bin/python3.11")
"${python[@]}" -c 'import platform, abs_hil; print(platform.machine(), abs_hil.simulate(set={"experiment.start_speed_rad_s": 170}))'
"${python[@]}" -m pytest -q -p no:cacheprovider --tb=short -k 'not a_signal_ends' \
  "$source"/python/tests/test_{bits,simulate,controllers,load,nesting,rows,eccentricity,report_parts,studies,tune}.py
