"""Runs abs_hil for the tests of the program: unittest with a temporary folder and the path of the binary."""
import csv
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

from live import PATIENT

PROGRAM = sys.argv.pop(1) if len(sys.argv) > 1 else 'build/release/bin/abs_hil'

# Runs without a named destination write no run folder.
os.environ['ABS_HIL_RUNS_DIR'] = ''


class ProgramTest(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self._folder.name)
        os.environ['XDG_STATE_HOME'] = str(self.folder / 'state')  # the flight record of a fault

    def tearDown(self):
        self._folder.cleanup()

    def run_program(self, *args, **kwargs):
        return subprocess.run([PROGRAM, *map(str, args)], capture_output=True, text=True, timeout=60, **kwargs)

    def patient(self, *args, **kwargs):
        """A run in real time that must not judge this computer."""
        return self.run_program(*PATIENT, *args, **kwargs)

    def fast(self, *args):
        """A run in virtual time that must complete."""
        result = self.run_program('--backend', 'sim', '--fast', '--no-lcm', *args)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def rows(self, path):
        with open(path, newline='') as file:
            return list(csv.DictReader(file))

    def summary(self, path):
        return json.loads(pathlib.Path(path).read_text())
