"""Controllers from files, for the tests: compiled with nothing but the one header. Wants to be imported first.

usage of a test: X_test.py ABS_HIL CC SOURCE_FOLDER
"""
import pathlib
import subprocess
import sys

CC, SOURCE = sys.argv[2], pathlib.Path(sys.argv[3])
del sys.argv[2:4]
sys.path.insert(0, str(SOURCE / 'tests' / 'app'))

# What BROKEN names in broken_controllers.c
BROKEN = ['SOUND', 'VERSION', 'SIZE', 'NO_INTERFACE', 'NO_STEP', 'REFUSES', 'DIES_IN_CREATE', 'DIES_IN_STEP',
          'NOT_FINITE', 'HANGS', 'ALLOCATES', 'CALLS_SYSTEM', 'BAD_SIGNAL', 'MANY_SIGNALS', 'EXITS', 'MAGIC',
          'DIES_LATE']


def compiled(folder, source, name, *options):
    """The library."""
    include = folder / 'include' / 'abs_hil' / 'interchange'
    include.mkdir(parents=True, exist_ok=True)
    header = include / 'controller.h'
    if not header.exists():
        header.symlink_to(SOURCE / 'include/abs_hil/interchange/controller.h')
    library = folder / f'{name}.so'
    subprocess.run([CC, '-std=gnu99', '-shared', '-fPIC', '-O2', '-Wall', '-Wextra', '-Werror', '-Wno-unused-variable',
                    f'-I{folder / "include"}', *options, '-o', library, source, '-lm'], check=True)
    return library


def broken(folder, kind):
    return compiled(folder, SOURCE / 'tests/interchange/broken_controllers.c', kind.lower(),
                    f'-DBROKEN={BROKEN.index(kind)}')


def example(folder):
    return compiled(folder, SOURCE / 'examples/c_controller/pi_controller.c', 'pi_controller')


def hostile(folder, deed, place):
    return compiled(folder, SOURCE / 'tests/interchange/hostile_controllers.c', f'{deed}-{place}'.lower(), f'-D{deed}',
                    f'-D{place}', '-pthread', '-Wno-unused-function', '-Wno-unused-result')
