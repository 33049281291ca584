#!/usr/bin/env bash
# lint.sh [CHECK...]: the static checks format, shell, cppcheck, tidy (default: all, quick ones first). Each finding is an
# error. tidy looks at every source of src/ and apps/; lint.sh tidy FILE... at those only.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

check_format() {
  git ls-files '*.cpp' '*.hpp' | xargs clang-format-16 --dry-run --Werror
}

check_shell() {
  git ls-files '*.sh' .ci/run | xargs shellcheck
}

check_cppcheck() {
  cppcheck --enable=warning,performance,portability --error-exitcode=1 --inline-suppr --quiet --std=c++20 --language=c++ \
    -j "$(nproc)" --suppressions-list=.cppcheck-suppressions -I include src apps
}

check_tidy() {
  scripts/build.sh release >/dev/null  # generated headers and compile_commands.json
  local files=("$@")
  [ $# -gt 0 ] || mapfile -t files < <(git ls-files 'src/*.cpp' 'apps/*.cpp')
  printf '%s\n' "${files[@]}" | xargs -P "$(nproc)" -n 4 clang-tidy-16 -p build/release --quiet 2>/dev/null
}

scripts/setup.sh packages-lint.txt
if [ "${1:-}" = tidy ]; then
  shift
  check_tidy "$@"
  exit
fi
checks=("$@")
[ $# -gt 0 ] || checks=(format shell cppcheck tidy)
for check in "${checks[@]}"; do
  start=$SECONDS
  "check_$check" || { echo "lint: $check found the above" >&2; exit 1; }
  echo "lint: $check: nothing found, $((SECONDS - start)) s"
done
