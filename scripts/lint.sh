#!/usr/bin/env bash
# lint.sh [CHECK...]: runs the static checks format, shell, python, cppcheck, tidy (default: all, quick ones first). Each
# warning is an error. tidy checks every source of src/ and apps/ that has changed since its last clean check. lint.sh
# tidy FILE... checks the units of these files only.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

check_format() {
  git ls-files '*.cpp' '*.hpp' | xargs clang-format-16 --dry-run --Werror
  # A source says what it is for: a header before its first declaration, a .cpp in its first line.
  # shellcheck disable=SC2016 # of awk
  git ls-files 'src/*pp' 'apps/*pp' 'include/*pp' | xargs awk 'FNR == 1 { looked = 0 }
    FNR == 1 && FILENAME ~ /cpp$/ && !/^\/\// { print FILENAME ": its first line does not say what it is for"; bad = 1 }
    looked || /^(#|$|namespace|using|extern|}|")/ { next }
    { looked = 1; if ($0 !~ /^ *\/[\/*]/) { print FILENAME ": no sentence says what it is for"; bad = 1 } }
    END { exit bad }'
}

check_shell() {
  git ls-files '*.sh' .ci/run | xargs shellcheck
}

check_python() {
  # Joined, because `||` at the call switches off -e within.
  scripts/setup_python.sh && build/python/bin/ruff check python research/claim research/{test_claim,unknown,certificate,layers,dense,test_dense,test_unknown,unknown_table,nmpc,nmpc_table,test_nmpc,reproduce,steps,test_reproduce,quoted,drawn_table}.py && build/python/bin/python -m mypy
}

check_cppcheck() {
  cppcheck --enable=warning,performance,portability --error-exitcode=1 --inline-suppr --quiet --std=c++20 --language=c++ \
    -j "$(nproc)" --suppressions-list=.cppcheck-suppressions -I include -I src -I third_party src apps
}

check_tidy() {
  scripts/setup.sh packages-clang.txt
  scripts/build.sh clang >/dev/null  # generated headers, and what includes what
  scripts/tidy.py "$@"
}

scripts/setup.sh packages-lint.txt
if [ "${1:-}" = tidy ]; then
  shift
  check_tidy "$@"
  exit
fi
checks=("$@")
[ $# -gt 0 ] || checks=(format shell python cppcheck tidy)
for check in "${checks[@]}"; do
  start=$SECONDS
  "check_$check" || { echo "lint: $check found the above" >&2; exit 1; }
  echo "lint: $check: nothing found, $((SECONDS - start)) s"
done
