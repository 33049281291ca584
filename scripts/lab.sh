#!/usr/bin/env bash
# lab.sh: compiles the simulation core to WebAssembly for `abs_hil lab`, into build/lab/abs_hil_lab.wasm.
#
# The compiler is zig's, as for the wheels (scripts/wheels.sh): clang with the sources of LLVM's C++ library and a C library
# for WebAssembly. python/lab/CMakeLists.txt compiles them with exceptions, docs/decisions/lab.md says why.
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "$(realpath "$0")")/.."
root=$PWD
work=$root/build/lab

scripts/setup.sh
scripts/setup.sh packages-lab.txt
mkdir -p "$work/bin"
zig_package=$(sed -n 's/^\(ziglang[^ ]*\).*/\1/p' scripts/python-packages-wheels.txt)
[ -x "$work/tools/bin/pip" ] || python3 -m venv "$work/tools"
"$work/tools/bin/pip" install --quiet --disable-pip-version-check "$zig_package"
zig=$("$work/tools/bin/python" -c 'import pathlib, ziglang; print(pathlib.Path(ziglang.__file__).parent)')

# The compiler alone, with folders and features of our choice: zig's own choice for this target has no exceptions.
features='-fwasm-exceptions -mllvm -wasm-use-legacy-eh=true -mbulk-memory -mnontrapping-fptoint -msign-ext'
folders=''
for folder in libc/include/wasm-wasi-musl libc/include/generic-musl; do folders+=" -isystem $zig/lib/$folder"; done
tool() {
  printf '#!/bin/sh\nexec "%s/zig" %s "$@"\n' "$zig" "$2" >"$work/bin/$1"
  chmod +x "$work/bin/$1"
}
tool cc "clang --target=wasm32-wasip1 $features -nostdinc -isystem $zig/lib/include $folders"
tool c++ "clang --driver-mode=g++ --target=wasm32-wasip1 $features -nostdinc -nostdinc++ \
-isystem $zig/lib/libcxx/include -isystem $zig/lib/libcxxabi/include -isystem $zig/lib/include $folders \
-D_LIBCPP_HAS_THREADS=1 -D_LIBCPP_HAS_THREAD_API_PTHREAD -D_LIBCPP_HAS_FILESYSTEM=1 -D_LIBCPP_HAS_MUSL_LIBC=1 \
-D_LIBCPP_ABI_VERSION=1 -D_LIBCPP_ABI_NAMESPACE=__1 -D_LIBCPP_HAS_MONOTONIC_CLOCK -D_LIBCPP_HAS_TERMINAL=0 \
-D_LIBCPP_HAS_RANDOM_DEVICE -D_LIBCPP_HAS_LOCALIZATION -D_LIBCPP_HAS_UNICODE -D_LIBCPP_HAS_WIDE_CHARACTERS \
-D_LIBCPP_HAS_NO_STD_MODULES -D_LIBCPP_HAS_VENDOR_AVAILABILITY_ANNOTATIONS=0 -D_LIBCPP_PSTL_BACKEND_SERIAL \
-D_LIBCPP_DISABLE_VISIBILITY_ANNOTATIONS -D_LIBCXXABI_DISABLE_VISIBILITY_ANNOTATIONS \
-D_LIBCPP_HARDENING_MODE=_LIBCPP_HARDENING_MODE_NONE \
-D_LIBCPP_ASSERTION_SEMANTIC_DEFAULT=_LIBCPP_ASSERTION_SEMANTIC_IGNORE"
tool link 'cc -target wasm32-wasi -mexec-model=reactor -nostdlib++'
tool ar ar
tool ranlib ranlib

cmake -S "$root" -B "$work/build" -G Ninja -DABS_HIL_CORE_ONLY=ON -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_SYSTEM_NAME=Generic -DCMAKE_SYSTEM_PROCESSOR=wasm32 -DCMAKE_TRY_COMPILE_TARGET_TYPE=STATIC_LIBRARY \
  -DCMAKE_CXX_COMPILER="$work/bin/c++" -DCMAKE_C_COMPILER="$work/bin/cc" -DCMAKE_AR="$work/bin/ar" \
  -DCMAKE_RANLIB="$work/bin/ranlib" -DABS_HIL_ZIG="$zig" -DABS_HIL_WASM_LINKER="$work/bin/link" \
  -DCMAKE_CXX_FLAGS="-ffile-prefix-map=$root=. -ffile-prefix-map=$zig=zig" >"$work/configure.log" 2>&1 ||
  { cat "$work/configure.log"; exit 1; }
cmake --build "$work/build" --target abs_hil_lab
cp "$work/build/abs_hil_lab.wasm" "$work/abs_hil_lab.wasm"
(cd "$work" && wc -c abs_hil_lab.wasm && sha256sum abs_hil_lab.wasm)
