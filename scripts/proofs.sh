#!/usr/bin/env bash
# proofs.sh [ARGUMENT...]: proves what tests/proofs/*.toml claim about the C code of the safety layers, with states that must
# be reached and changes of the code that must be refuted. ARGUMENTs go to tests/proofs/prove.py (--only NAME,...). The
# first call gets CBMC of Debian 13 into build/proofs (scripts/packages-proofs.txt; 22 MB), where it runs with Debian 13's
# own C library.
set -euo pipefail
cd "$(dirname "$(realpath "$0")")/.."

tools=$PWD/build/proofs/tools
usr=$tools/debian/usr
programs=(cbmc goto-cc goto-instrument cadical)

get_tools() {
  local packages mirror apt program
  mapfile -t packages < <(sed 's/#.*//; s/[[:space:]]*$//; /^$/d' scripts/packages-proofs.txt)
  mkdir -p "$tools"/apt/{lists,archives}/partial "$tools/bin"
  # Debian 12's own mirror has Debian 13, too. These lists are no part of the system's.
  # shellcheck disable=SC2016 # of apt
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Codename: bookworm' | head -n 1)
  echo "deb [signed-by=/usr/share/keyrings/debian-archive-keyring.gpg] ${mirror:-http://deb.debian.org/debian/} trixie main" \
    >"$tools/apt/sources"
  : >"$tools/apt/status"
  apt=(apt-get -qq -o "Dir::Etc::sourcelist=$tools/apt/sources" -o Dir::Etc::sourceparts=- -o "Dir::State::lists=$tools/apt/lists"
    -o "Dir::State::status=$tools/apt/status" -o "Dir::Cache=$tools/apt" -o APT::Sandbox::User=)
  "${apt[@]}" update
  (cd "$tools" && rm -rf ./*.deb debian && "${apt[@]}" download "${packages[@]}" && printf '%s\0' ./*.deb | xargs -0 -I{} dpkg-deb -x {} debian)
  for program in "${programs[@]}"; do
    printf '#!/bin/sh\nexec %s --library-path %s %s "$@"\n' "'$usr/lib/x86_64-linux-gnu/ld-linux-x86-64.so.2'" \
      "'$usr/lib/x86_64-linux-gnu:$usr/lib'" "'$usr/bin/$program'" >"$tools/bin/$program"
    chmod +x "$tools/bin/$program"
    "$tools/bin/$program" --version >/dev/null
  done
  cp scripts/packages-proofs.txt "$tools/packages"
}

cmp -s scripts/packages-proofs.txt "$tools/packages" || get_tools
exec python3 tests/proofs/prove.py "$tools/bin" build/proofs/work "$@"
