#!/usr/bin/env bash
# numpy2_test.sh PYTHON SOURCE: the build tree's modules under NumPy 2, in a new virtual environment. Debian's pybind11 2.10 was
# made before NumPy 2, so its arrays need care (python/src/array.hpp). Needs PyPI; PYTHONPATH and ABS_HIL_BUILD name the build
# tree.
set -euo pipefail
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$1" -m venv "$scratch/env"
"$scratch/env/bin/pip" --disable-pip-version-check --quiet install --only-binary :all: \
  'numpy>=2' pytest pandas scipy matplotlib gymnasium ||
  { echo "SKIPPED: no NumPy 2 from PyPI"; exit 77; }
"$scratch/env/bin/python" -c 'import numpy; print("numpy", numpy.__version__)'
tests() { OPENBLAS_NUM_THREADS=1 "$scratch/env/bin/python" -m pytest -q -p no:cacheprovider "$@"; }
tests "$2"/python/tests/test_{bits,simulate,controllers,load,learning}.py
tests "$2"/python/tests/test_identification.py -k 'every_parameter or sensitivities or least_squares or slopes'
