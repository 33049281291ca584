#!/usr/bin/env bash
# lint.sh [CHECK...]: runs the static checks format, shell, python, cppcheck, tidy (default: all, quick ones first). Each
# warning is an error. tidy checks every source of src/, extras/ and apps/ that has changed since its last clean check. lint.sh
# tidy FILE... checks the units of these files only.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

# The parts of a check are joined, because `||` at its call switches off -e within.
check_format() {
  # A source says what it is for: a .cpp in its first line, a header before its first declaration. A page
  # shows all of tests/example_controller, so that is left out.
  # shellcheck disable=SC2016 # of awk
  git ls-files '*.cpp' '*.hpp' | xargs clang-format-16 --dry-run --Werror &&
    git ls-files '*.cpp' ':!tests/example_controller' | xargs awk '
      FNR == 1 && !/^\/\// { print FILENAME ": its first line does not say what it is for"; bad = 1 } END { exit bad }' &&
    git ls-files 'src/*pp' 'extras/*pp' 'apps/*pp' 'include/*pp' | xargs awk 'FNR == 1 { looked = 0 }
      looked || /^(#|$|namespace|using|extern|}|")/ { next }
      { looked = 1; if ($0 !~ /^ *\/[\/*]/) { print FILENAME ": no sentence says what it is for"; bad = 1 } }
      END { exit bad }'
}

check_shell() {
  git ls-files '*.sh' .ci/run | xargs shellcheck
}

check_python() {
  scripts/setup_python.sh && build/python/bin/ruff check python research/claim research/{test_claim,unknown,certificate,layers,dense,test_dense,test_unknown,unknown_table,nmpc,nmpc_table,test_nmpc,test_identification_study,reproduce,steps,test_reproduce,quoted,drawn_table}.py && build/python/bin/python -m mypy
}

check_cppcheck() {
  cppcheck --enable=warning,performance,portability --error-exitcode=1 --inline-suppr --quiet --std=c++20 --language=c++ \
    -j "$(nproc)" --suppressions-list=.cppcheck-suppressions --library=.cppcheck-library.xml -I include -I src -I extras -I third_party src extras apps
}

check_tidy() {
  # The build makes generated headers, and says what includes what.
  scripts/setup.sh packages-clang.txt && scripts/build.sh clang >/dev/null && scripts/tidy.py "$@"
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
