"""Runs abs_hil and abs_report for the tests of the report: unittest with a temporary folder and both binaries' paths."""
import csv
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ABS_HIL, ABS_REPORT = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
del sys.argv[1:3]


def need(program, package):
    """Skips the test if a program is missing."""
    if shutil.which(program):
        return
    print(f'SKIPPED: {program} is missing: scripts/setup.sh packages-report.txt installs {package}')
    sys.exit(77)


class ReportTest(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.folder = pathlib.Path(self._folder.name)

    def tearDown(self):
        self._folder.cleanup()

    def make_run(self, name, *args):
        """Makes the run folder of a run in virtual time, without its checksums: the tests change its files."""
        folder = self.folder / name
        result = subprocess.run([ABS_HIL, '--backend', 'sim', '--fast', '--no-lcm', '--out', folder, *args],
                                capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(result.returncode, 0, result.stderr)
        for sums in (folder / 'SHA256SUMS', *folder.glob('run-*/SHA256SUMS')):
            sums.unlink(missing_ok=True)
        return folder

    def report(self, *args, status=0, **kwargs):
        result = subprocess.run([ABS_REPORT, *map(str, args)], capture_output=True, timeout=120, cwd=self.folder,
                                check=False, **kwargs)
        self.assertEqual(result.returncode, status, result.stderr.decode())
        return result

    def page(self, *args):
        """The page from abs_report, and its stderr."""
        result = self.report(*args, '--output', self.folder / 'page.html', '--force')
        return (self.folder / 'page.html').read_text(), result.stderr.decode()

    def rows(self, folder):
        with open(folder / 'run.csv', newline='') as file:
            return list(csv.DictReader(file))

    def rewrite(self, folder, change):
        """Changes a run's rows: change(row) edits a dictionary of strings."""
        rows = self.rows(folder)
        for row in rows:
            change(row)
        with open(folder / 'run.csv', 'w', newline='') as file:
            writer = csv.DictWriter(file, rows[0].keys(), lineterminator='\n')
            writer.writeheader()
            writer.writerows(rows)

    def summary(self, folder):
        return json.loads((folder / 'summary.json').read_text())
