"""The programs of the build tree, for the tests of the package."""
from __future__ import annotations

import os
import pathlib
import subprocess
import sys

import pytest

BUILD = pathlib.Path(os.environ.get('ABS_HIL_BUILD', pathlib.Path(__file__).parents[2] / 'build' / 'release'))
ABS_HIL = BUILD / 'bin' / 'abs_hil'
#: brakes at once, from the paper's speed: short
QUICK = {'experiment.start_speed_rad_s': 170}


@pytest.fixture(scope='session')
def abs_hil_program():
    if not sys.platform.startswith('linux'):
        pytest.skip('the program abs_hil, to compare with, is Linux\'s alone')

    def run(*arguments, status=0):
        result = subprocess.run([ABS_HIL, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)
        assert result.returncode == status, result.stderr
        return result
    return run
