#!/usr/bin/env bash
# Writes docs/reference/fault-matrix.csv from new runs of the test fault_matrix, and
# build/release/fault-matrix-conditions.csv from those of fault_matrix_conditions. Needs a release build.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
ABS_HIL_WRITE_FAULT_MATRIX=docs/reference/fault-matrix.csv build/release/tests/test_fault_matrix "docs/*"
ABS_HIL_WRITE_FAULT_MATRIX_CONDITIONS=build/release/fault-matrix-conditions.csv build/release/tests/test_fault_matrix_conditions
