#!/usr/bin/env bash
# wheel_windows_test.sh WHEEL: installs a wheel for Windows (of Python 3.11) with pip into Maven's Python for Windows under
# Wine, with the lowest dependencies that pyproject.toml allows, and runs the tests of the package that need no network. It
# also runs the table of bits as a program. scripts/wheels.sh windows-x86_64 has brought that Python and built both.
#
# The lowest: newer numpy calls functions for complex numbers that Wine 8.0 lacks. Python under Wine wants pipes, no files, as
# its standard streams. The program abs_hil to compare with is Linux's; those tests are skipped.
set -euo pipefail
source=$(realpath "$(dirname "$(realpath "$0")")/../..")
wheel=$(realpath "$1")
work=$source/build/wheels
wine=$(command -v wine64 || echo /usr/lib/wine/wine64)
scratch=$(mktemp -d)
export WINEPREFIX=$scratch/wine WINEDEBUG=-all PYTHONDONTWRITEBYTECODE=1 OPENBLAS_NUM_THREADS=1 MPLBACKEND=agg
trap 'WINEPREFIX=$WINEPREFIX /usr/lib/wine/wineserver -k 2>/dev/null || true; rm -rf "$scratch"' EXIT
unset PYTHONPATH

windows() { echo "z:${1//\//\\}"; }
cp -r "$work/pythons/windows-x86_64-3.11/org/bytedeco/cpython/windows-x86_64" "$scratch/python"
python() { "$wine" "$scratch/python/python.exe" "$@" </dev/null 2>&1 | cat; }

cd "$scratch"
"$wine" "$work/windows-x86_64/tests/run_bits.exe" "$(windows "$source/tests/core/run_bits.tsv")" "$(windows "$source/config")" </dev/null | cat
python3 -m pip download --quiet --disable-pip-version-check --platform win_amd64 --python-version 3.11 --only-binary :all: -d wheels \
  numpy==1.23.2 pandas==1.5.1 matplotlib==3.6.0 scipy==1.9.2 jinja2==3.0.0 plotly==5.10.0 rich==13.0.0 'setuptools<80' pytest tqdm \
  colorama tzdata
python -m ensurepip >ensurepip.log
python -m pip --disable-pip-version-check --quiet install --no-warn-script-location --no-index --find-links wheels \
  "$(windows "$wheel")" numpy==1.23.2 pandas==1.5.1 matplotlib==3.6.0 scipy==1.9.2 pytest
python -c 'import sys, abs_hil; print(sys.platform, abs_hil.__version__, abs_hil.simulate(set={"experiment.start_speed_rad_s": 170}))'
tests=()
for name in bits simulate controllers files load nesting rows eccentricity report_parts studies tune; do
  tests+=("$(windows "$source/python/tests/test_$name.py")")
done
# Without tracebacks, whose making crashes Python 3.11.3.
python -m pytest -q -p no:cacheprovider --tb=line "${tests[@]}"
