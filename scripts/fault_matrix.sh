#!/usr/bin/env bash
# Writes docs/fault-matrix.md from new runs of the test fault_matrix. Needs a release build.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."
ABS_HIL_WRITE_FAULT_MATRIX=docs/fault-matrix.md build/release/tests/test_fault_matrix "docs/*"
