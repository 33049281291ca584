#!/usr/bin/env bash
# installed_test.sh BUILD_FOLDER SOURCE_FOLDER: installs the build into a scratch prefix, runs the installed program away
# from the source tree, and builds and runs examples/own_controller and examples/own_backend against the installation.
set -euo pipefail
build=$(realpath "$1") source=$(realpath "$2")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cmake --install "$build" --prefix "$scratch/usr" >"$scratch/install.log" || { cat "$scratch/install.log"; exit 1; }
cd "$scratch"
usr/bin/abs_hil --backend sim --fast --no-lcm --csv run.csv >run.txt
grep -q "completed" run.txt || { echo "the installed program's run did not complete:"; cat run.txt; exit 1; }
# The programs in Python find their modules from wherever the prefix is.
if [ -e usr/bin/abs_report ]; then
  (unset PYTHONPATH; usr/bin/abs_hil report run.csv --table && usr/bin/abs_hil rig steady 2) >python.txt 2>&1 ||
    { echo "the installed programs in Python do not run:"; cat python.txt; exit 1; }
  grep -q "stop time" python.txt || { cat python.txt; exit 1; }
fi
for plant in paper-table1 paper-timing inteco-manual; do
  [ -f "usr/share/abs_hil/config/plants/$plant.toml" ] || { echo "$plant.toml is not installed"; exit 1; }
done
for file in share/abs_hil/guardian.toml lib/systemd/system/abs-guardian.service lib/systemd/system/abs_guardian.slice \
  lib/systemd/system/sleep.target.wants/abs-guardian-sleep.service \
  lib/udev/rules.d/70-abs-hil.rules; do
  [ -f "usr/$file" ] || { echo "$file is not installed"; exit 1; }
done
# A driver that opens a socket of another family would find no board under the packaged guardian.
families=$(grep -rhoE '::socket\([AP]F_[A-Z0-9]+' "$source"/src/driver "$source"/src/guardian | sed 's/.*F_/AF_/' | sort -u)
for family in $families; do
  grep -qE "^RestrictAddressFamilies=.*\b$family\b" usr/lib/systemd/system/abs-guardian.service ||
    { echo "abs-guardian.service forbids the sockets of $family, which a driver opens"; exit 1; }
done
# The unit as systemd reads it; what it starts is the program that was just installed.
if command -v systemd-analyze >/dev/null; then
  sed "s|^ExecStart=abs_guardian|ExecStart=$scratch/usr/bin/abs_guardian|; /^Documentation=/d" \
    usr/lib/systemd/system/abs-guardian.service >abs-guardian.service
  cp usr/lib/systemd/system/abs_guardian.slice .
  systemd-analyze verify ./abs-guardian.service || { echo "systemd finds fault with abs-guardian.service"; exit 1; }
fi

# Outside the source tree, and without a way back to it.
cp -r "$source/examples/own_controller" example
if grep -r "$source" usr/lib*/*/cmake/abs_hil usr/lib*/cmake/abs_hil 2>/dev/null; then
  echo "the installed CMake files refer to the source tree"
  exit 1
fi
cmake -G Ninja -S example -B example/build -DCMAKE_PREFIX_PATH="$scratch/usr" \
  ${CMAKE_CXX_COMPILER_LAUNCHER:+-DCMAKE_CXX_COMPILER_LAUNCHER="$CMAKE_CXX_COMPILER_LAUNCHER"} >cmake.log ||
  { cat cmake.log; exit 1; }
cmake --build example/build >build.log || { cat build.log; exit 1; }
example/build/my_abs_hil list | grep -q "^  proportional" || { echo "my_abs_hil does not list its controller"; exit 1; }
# A board of its own needs both programs.
cp -r "$source/examples/own_backend" board
cmake -G Ninja -S board -B board/build -DCMAKE_PREFIX_PATH="$scratch/usr" \
  ${CMAKE_CXX_COMPILER_LAUNCHER:+-DCMAKE_CXX_COMPILER_LAUNCHER="$CMAKE_CXX_COMPILER_LAUNCHER"} >cmake.log ||
  { cat cmake.log; exit 1; }
cmake --build board/build >build.log || { cat build.log; exit 1; }
board/build/my_abs_hil list | grep -q "^  serial" || { echo "my_abs_hil does not list its board"; exit 1; }
[ -x board/build/abs_guardian ] || { echo "its guardian was not built"; exit 1; }

export ABS_HIL_CONFIG_DIR=$scratch/usr/share/abs_hil/config
example/build/my_abs_hil --fast --no-lcm --controller proportional --set experiment.start_speed_rad_s=170 \
  --summary own.json >/dev/null
python3 - <<'PYTHON'
import json
run = json.load(open('own.json'))
assert run['controller'] == 'proportional' and run['result'] == 'completed', run
assert 0 < run['stop_time_s'] < 3.19, run['stop_time_s']  # a locked wheel takes 3.19 s
print('own controller: stopped in %.3f s, %.2f m' % (run['stop_time_s'], run['stop_distance_m']))
PYTHON
