#!/usr/bin/env bash
# Writes docs/fault-matrix.md and docs/fault-matrix-conditions.md from new runs of the tests fault_matrix and
# fault_matrix_conditions. Needs a release build.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
ABS_HIL_WRITE_FAULT_MATRIX=docs/fault-matrix.md build/release/tests/test_fault_matrix "docs/*"
ABS_HIL_WRITE_FAULT_MATRIX_CONDITIONS=docs/fault-matrix-conditions.md \
  build/release/tests/test_fault_matrix_conditions "docs/*"
