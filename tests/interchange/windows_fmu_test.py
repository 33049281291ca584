"""The FMU's library for Windows under Wine gives what the one for Linux gives. usage: see foreign.py"""
import os
import pathlib
import shutil
import subprocess
import sys
import unittest
import zipfile

from foreign import SOURCE  # first: it reads the arguments

from program import PROGRAM, ProgramTest

WINE = shutil.which('wine64') or '/usr/lib/wine/wine64'
COMPILER = shutil.which('x86_64-w64-mingw32-gcc-posix') or shutil.which('x86_64-w64-mingw32-gcc')
BUILT = pathlib.Path(PROGRAM).resolve().parent.parent / 'fmu/win64/abs_hil_fmu.dll'
try:
    from fmu_loop import Instance
    reason = None if COMPILER and pathlib.Path(WINE).exists() and BUILT.exists() else 'scripts/setup.sh packages-windows.txt'
except ImportError as error:
    reason = f'{error}: scripts/setup_python.sh'
if reason:
    print(f'SKIPPED: {reason}')
    sys.exit(77)


class WindowsFmu(ProgramTest):
    def test_the_library_gives_the_same(self):
        path = self.folder / 'plant.fmu'
        result = self.run_program('export-fmu', '--out', path, '--force', '--set', 'experiment.start_speed_rad_s=170')
        self.assertIn('win64', result.stdout)
        zipfile.ZipFile(path).extractall(self.folder / 'fmu')
        program = self.folder / 'windows_fmu.exe'
        subprocess.run([COMPILER, '-O1', '-I', SOURCE / 'third_party/fmi', SOURCE / 'tests/interchange/windows_fmu.c', '-o',
                        program], check=True)
        here = Instance(str(path))
        outputs = ['omega1_rad_s', 'omega2_rad_s', 'slip', 'brake_torque_Nm', 'distance_m']
        for n in range(500):
            here.set('brake_duty', 0.6)
            here.step(n * 1e-3, 1e-3)
        expected = [here.get(name) for name in outputs]
        folder = self.folder / 'fmu'
        there = subprocess.run(
            [WINE, program, f'Z:{folder}/binaries/win64/abs_hil_fmu.dll', f'file:///Z:{folder}/resources',
             here.description.guid, str(here.references['brake_duty']), *(str(here.references[name]) for name in outputs)],
            capture_output=True, text=True, timeout=120, check=False,
            env={**os.environ, 'WINEPREFIX': str(self.folder / 'wine'), 'WINEDEBUG': '-all'})
        self.assertEqual(there.returncode, 0, there.stderr)
        for name, value, own in zip(outputs, map(float, there.stdout.split()), expected):
            print(f'{name}: Windows {value!r}, Linux {own!r}')
            self.assertAlmostEqual(value, own, delta=1e-9 * abs(own))
        here.close()


if __name__ == '__main__':
    unittest.main()
