#!/usr/bin/env bash
# wheel_test.sh WHEEL PYTHON newest|lowest: installs a wheel into a new virtual environment of that Python, with the newest or
# the lowest dependencies that pyproject.toml allows, and uses it. It prints the time to the first figure of a braking and runs
# the tests of the package that need no network. Needs PyPI, and the build tree of the preset release for the programs that
# the tests compare with.
set -euo pipefail
source=$(realpath "$(dirname "$(realpath "$0")")/../..")
wheel=$(realpath "$1") python=$2 kind=$3
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
unset PYTHONPATH
cd "$scratch"
# The lowest that have a wheel for Python 3.11, which is the lowest that the package allows.
printf '%s\n' numpy==1.23.2 pandas==1.5.1 matplotlib==3.6.0 scipy==1.9.2 jinja2==3.0.0 plotly==5.10.0 rich==13.0.0 \
  'setuptools<80' >lowest.txt
[ "$kind" = lowest ] || : >lowest.txt
begin=$(date +%s%N)
"$python" -m venv env
env/bin/pip --disable-pip-version-check --quiet install --only-binary :all: -c lowest.txt "$wheel"
cat >figure.py <<'PYTHON'
import abs_hil
run = abs_hil.simulate(controller='adaptive', set={'experiment.start_speed_rad_s': 170})
assert run.summary['result'] == 'completed', run.summary
run.data.plot(x='time_s', y=['slip', 'slip_ref']).figure.savefig('braking.png')
print(run)
PYTHON
MPLBACKEND=agg env/bin/python figure.py
test -s braking.png
echo "wheel_test: $kind dependencies: $((($(date +%s%N) - begin) / 1000000)) ms from nothing to the first figure; processor time of this shell and its children:"
times
env/bin/pip --disable-pip-version-check list 2>/dev/null | grep -iE '^(numpy|pandas|matplotlib|scipy|jinja2|plotly|rich) ' | tr -s ' \n' ' ,'
echo
env/bin/abs_report --help >/dev/null
env/bin/abs_export-fmu --controller pi --out pi.fmu
env/bin/python -m zipfile -l pi.fmu | grep -o 'binaries/[^ ]*'
env/bin/pip --disable-pip-version-check --quiet install -c lowest.txt pytest fmpy
env/bin/python -c 'import fmpy; fmpy.simulate_fmu("pi.fmu", stop_time=0.1)' # its end shows whether the FMU was unloaded whole
export ABS_HIL_BUILD=$source/build/release PYTHONDONTWRITEBYTECODE=1 OPENBLAS_NUM_THREADS=1 MPLBACKEND=agg
# Not those of a network, of controllers from files, of optional packages, nor the two that take minutes.
env/bin/python -m pytest -q -p no:cacheprovider "$source"/python/tests/test_{bits,simulate,controllers,files,load,nesting,rows,eccentricity,report_parts,studies,tune}.py
