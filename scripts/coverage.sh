#!/usr/bin/env bash
# Builds with gcc's coverage counters, runs the tests that need no virtual machine, and prints lines and branches reached
# for each room as a Markdown table; build/coverage/html/index.html shows every line. docs/quality.md holds the last one.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

scripts/setup.sh packages-coverage.txt >&2
scripts/build.sh coverage >&2
find build/coverage -name '*.gcda' -delete
# A test that fails here fails in release as well, unless it judges optimised code: its lines are counted either way.
ctest --preset coverage -j "$(nproc)" -LE 'vm|docs|spy|report' >&2 || true
mkdir -p build/coverage/html
gcovr --root . --object-directory build/coverage --filter src/ --filter include/ --filter apps/ \
  --exclude-unreachable-branches --exclude-throw-branches --exclude-noncode-lines -j "$(nproc)" \
  --gcov-ignore-parse-errors --json build/coverage/coverage.json --html-details build/coverage/html/index.html >&2
python3 scripts/coverage_table.py build/coverage/coverage.json
