#!/usr/bin/env bash
# pip_install_test.sh SOURCE [PIP ARGUMENT...]: installs the package with `pip install` into a virtual environment of its
# own, which sees none of Debian's packages, and uses it far from the source tree. Needs PyPI. Status 77 without it.
set -euo pipefail
source=$1
shift
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
unset PYTHONPATH
python3=/usr/bin/python3
[ -x "$python3" ] || python3=python3
"$python3" -m venv "$scratch/env"
cd "$scratch"
pip=(env/bin/pip --disable-pip-version-check --quiet)
"${pip[@]}" download --no-deps -d probe tqdm 2>/dev/null || { echo "SKIPPED: PyPI cannot be reached"; exit 77; }
if command -v ccache >/dev/null; then export ABS_HIL_COMPILER_LAUNCHER=ccache CCACHE_BASEDIR=$source CCACHE_NOHASHDIR=1; fi
"${pip[@]}" install "$@" "$source"
env/bin/python - <<'PYTHON'
import abs_hil
run = abs_hil.simulate(set={'experiment.start_speed_rad_s': 170})
assert run.summary['result'] == 'completed', run.summary
assert str(abs_hil.__file__).startswith(__import__('sys').prefix), abs_hil.__file__
print(run, list(run.data.columns)[:3])
PYTHON
env/bin/abs_hil --fast --no-lcm --out run >/dev/null
env/bin/abs_report run
test -s report.html
env/bin/abs_hil report run --output again.html
test -s again.html
# An editable install imports the sources themselves, with what CMake has made beside them.
"${pip[@]}" install "$@" --no-deps --editable "$source"
env/bin/python - "$source" <<'PYTHON'
import sys
import abs_hil
import abs_hil.report.page
assert abs_hil.__file__.startswith(sys.argv[1]), abs_hil.__file__
assert abs_hil.report.page.__file__.startswith(sys.argv[1]), abs_hil.report.page.__file__
assert abs_hil.simulate(set={'experiment.start_speed_rad_s': 170}).summary['result'] == 'completed'
PYTHON
env/bin/abs_report run --output editable.html
test -s editable.html
