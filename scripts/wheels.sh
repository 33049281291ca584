#!/usr/bin/env bash
# wheels.sh [PLATFORM...]: builds wheels of the Python package into build/wheels/dist, from this computer for others as well.
# PLATFORM is linux-x86_64 (default), linux-aarch64, windows-x86_64, macos-arm64 or macos-x86_64; `all` is each of them.
# ABS_HIL_WHEEL_PYTHONS ("3.11 3.12 3.13 3.14") names the Pythons, of the list below.
#
# The compiler is zig's, which PyPI has (scripts/python-packages-wheels.txt). The simulation core (cmake/CoreOnly.cmake) is
# compiled once for each platform, its Python module once for each Python, whose headers come from Maven's repository.
# pybind11 has no stable ABI, so each Python has a wheel of its own.
set -euo pipefail
shopt -s inherit_errexit  # a function in $( ) ends at its first failure, too
cd "$(dirname "$(realpath "$0")")/.."
root=$PWD
work=$root/build/wheels

# Version of Python -> version of org.bytedeco:cpython, which brings that Python for every platform.
declare -A pythons=([3.11]=3.11.3-1.5.9 [3.12]=3.12.1-1.5.10 [3.13]=3.13.5-1.5.12 [3.14]=3.14.3-1.5.13)
wanted=${ABS_HIL_WHEEL_PYTHONS:-3.11 3.12 3.13 3.14}
libz_sys=1.1.20
everything=(linux-x86_64 linux-aarch64 windows-x86_64 macos-arm64 macos-x86_64)
platforms=("$@")
[ $# -gt 0 ] || platforms=(linux-x86_64)
[ "${platforms[*]}" != all ] || platforms=("${everything[@]}")

# platform | target of zig | CMake's system and processor | platform in Maven | tag of the wheel | ending of the module
# Headers of x86-64 serve 64-bit ARM as well; Maven has none of ARM for every Python.
row_of() {
  case $1 in
    linux-x86_64) echo "x86_64-linux-gnu.2.28 Linux x86_64 linux-x86_64 manylinux_2_28_x86_64 .cpython-%s-x86_64-linux-gnu.so" ;;
    linux-aarch64) echo "aarch64-linux-gnu.2.28 Linux aarch64 linux-x86_64 manylinux_2_28_aarch64 .cpython-%s-aarch64-linux-gnu.so" ;;
    windows-x86_64) echo "x86_64-windows-gnu Windows x86_64 windows-x86_64 win_amd64 .cp%s-win_amd64.pyd" ;;
    macos-arm64) echo "aarch64-macos.11.0 Darwin arm64 macosx-x86_64 macosx_11_0_arm64 .cpython-%s-darwin.so" ;;
    macos-x86_64) echo "x86_64-macos.11.0 Darwin x86_64 macosx-x86_64 macosx_11_0_x86_64 .cpython-%s-darwin.so" ;;
    *) echo "wheels: no platform $1; they are: ${everything[*]}" >&2; exit 2 ;;
  esac
}

SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git log -1 --format=%ct)}
export SOURCE_DATE_EPOCH
mkdir -p "$work"

prepare() {
  scripts/setup.sh
  scripts/setup.sh packages-wheels.txt
  scripts/setup.sh packages-windows.txt
  [ -x "$work/tools/bin/pip" ] || python3 -m venv "$work/tools"
  local tools
  mapfile -t tools < <(sed 's/#.*//; s/[[:space:]]*$//; /^$/d' scripts/python-packages-wheels.txt)
  "$work/tools/bin/pip" install --quiet --disable-pip-version-check "${tools[@]}"
  site=$("$work/tools/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
  if [ ! -d "$work/zlib/vendor" ]; then
    mkdir -p "$work/zlib/src" && touch "$work/zlib/src/lib.rs"
    printf '[package]\nname = "sources"\nversion = "0.0.0"\n[dependencies]\nlibz-sys = "=%s"\n' $libz_sys >"$work/zlib/Cargo.toml"
    (cd "$work/zlib" && cargo vendor --quiet >/dev/null)
  fi
  # The message types, the tables, the FMUs' library for Windows: the same in every wheel.
  scripts/build.sh release --target abs_hil_python abs_hil_fmu
  scripts/lab.sh  # the WebAssembly of `abs_hil lab`, the same in every wheel as well
}

# python_of PLATFORM PYTHON: the folder of that platform's Python, unpacked
python_of() {
  local folder=$work/pythons/$1-$2 version=${pythons[$2]}
  if [ ! -d "$folder" ]; then
    mkdir -p "$work/pythons"
    mvn -q -B dependency:get -Dtransitive=false "-Dmaven.repo.local=$work/maven" \
      "-Dartifact=org.bytedeco:cpython:$version:jar:$1" >&2
    unzip -qo "$work/maven/org/bytedeco/cpython/$version/cpython-$version-$1.jar" -d "$folder.part"
    mv "$folder.part" "$folder"
  fi
  echo "$folder/org/bytedeco/cpython/$1"
}

# compiler FOLDER TARGET: zig's compiler as CMake wants it
compiler() {
  mkdir -p "$1"
  local tool
  for tool in c++ cc ar ranlib rc; do
    local target="-target $2"
    case $tool in ar | ranlib | rc) target='' ;; esac
    printf '#!/bin/sh\nexec "%s/ziglang/zig" %s %s "$@"\n' "$site" $tool "$target" >"$1/$tool"
    chmod +x "$1/$tool"
  done
}

# configure PLATFORM: leaves what row_of says in variables, the folder of the build in $folder, the modules' names in $files
configure() {
  local row python home include file modules=()
  row=$(row_of "$1")
  read -r target system processor maven tag ending <<<"$row"
  folder=$work/$1 files=()
  compiler "$folder/bin" "$target"
  for python in $wanted; do
    home=$(python_of "$maven" "$python")
    include=$home/include
    [ -f "$include/Python.h" ] || include=$include/python$python
    file=_core${ending/\%s/${python/./}}
    files+=("$file")
    modules+=("$file|$include$([ "$system" != Windows ] || echo "|$home/libs/python${python/./}.lib")")
  done
  cmake -S "$root" -B "$folder" -G Ninja -DABS_HIL_CORE_ONLY=ON -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_SYSTEM_NAME="$system" -DCMAKE_SYSTEM_PROCESSOR="$processor" \
    -DCMAKE_CXX_COMPILER="$folder/bin/c++" -DCMAKE_C_COMPILER="$folder/bin/cc" -DCMAKE_AR="$folder/bin/ar" \
    -DCMAKE_RANLIB="$folder/bin/ranlib" -DCMAKE_RC_COMPILER="$folder/bin/rc" \
    -DCMAKE_CXX_FLAGS="-ffile-prefix-map=$root=. -ffile-prefix-map=$folder=." \
    -DABS_HIL_ZLIB_SOURCES="$work/zlib/vendor/libz-sys/src/zlib" -DABS_HIL_PYBIND11_INCLUDE="$site/pybind11/include" \
    -DABS_HIL_PYTHON_MODULES="$(IFS=';' && echo "${modules[*]}")" >"$folder/configure.log" || { cat "$folder/configure.log"; exit 1; }
}

build() {
  local place=0 python
  configure "$1"
  cmake --build "$folder"
  for python in $wanted; do
    "$work/tools/bin/python" scripts/wheel.py --module "$folder/modules/${files[$place]}" --python "${python/./}" \
      --platform "$tag" --fmu "$work/fmu" --built build/release/share/abs_hil/python/abs_hil --out "$work/dist"
    place=$((place + 1))
  done
}

prepare
rm -rf "$work/dist"
# Exported FMUs work on Linux and Windows, wherever they were exported: every wheel brings both libraries. The one for Windows
# is that of the ordinary build, which is tested under Wine.
configure linux-x86_64
cmake --build "$folder" --target abs_hil_fmu
rm -rf "$work/fmu"
mkdir -p "$work/fmu/linux64" "$work/fmu/win64"
cp "$folder/fmu/linux64/abs_hil_fmu.so" "$work/fmu/linux64"
cp build/release/fmu/win64/abs_hil_fmu.dll "$work/fmu/win64"
for platform in "${platforms[@]}"; do build "$platform"; done

cd "$work/dist"
for wheel in *.whl; do
  case $wheel in
    *linux*) "$work/tools/bin/auditwheel" show "$wheel" | tr '\n' ' ' | grep -o 'following platform tag: *"[^"]*"' ;;
  esac
done
"$work/tools/bin/check-wheel-contents" ./*.whl
"$work/tools/bin/twine" check --strict ./*.whl
sha256sum ./*.whl
