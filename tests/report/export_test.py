"""The exports hold the rows unchanged, and the examples that load them in Octave and Python get the summary's metrics."""
import csv
import io
import json
import math
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import unittest

import scipy.io

from program import ABS_REPORT, ReportTest

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / 'examples' / 'load_run'


class Export(ReportTest):
    def setUp(self):
        super().setUp()
        self.runs = [self.make_run(name, '--controller', name) for name in ('adaptive', 'locked')]

    def parquet(self, *runs):
        result = subprocess.run([ABS_REPORT, '--parquet', *runs, '--output', 'runs.parquet'], capture_output=True,
                                cwd=self.folder, check=False, timeout=60)
        if result.returncode == 3 and b'pyarrow' in result.stderr:
            self.skipTest('pyarrow is missing: scripts/setup_python.sh installs it')
        self.assertEqual(result.returncode, 0, result.stderr)

    def expected_line(self, run):
        s = self.summary(run)
        return (f'{run.name} ({s["controller"]}): stop time {s["stop_time_s"]:.3f} s, distance '
                f'{s["stop_distance_m"]:.3f} m, slip RMS error {s["slip_rms"]:.5f}')

    def test_csv_is_all_rows_bit_by_bit(self):
        rows = list(csv.DictReader(io.StringIO(self.report('--csv', *self.runs).stdout.decode())))
        original = [{'run': run.name, **row} for run in self.runs for row in self.rows(run)]
        self.assertEqual(len(rows), len(original))
        for row, wanted in zip(rows, original):
            self.assertEqual((row['run'], row['phase']), (wanted['run'], wanted['phase']))
            for column in ('time_s', 'slip', 'theta_est_N', 'distance_m', 'motor_enable'):
                self.assertEqual(struct.pack('d', float(row[column])), struct.pack('d', float(wanted[column])))

    def test_a_mat_file_goes_into_a_pipe(self):
        runs = scipy.io.loadmat(io.BytesIO(self.report('--octave', self.runs[0]).stdout))['runs']
        self.assertEqual(len(runs[0, 0]['time_s']), len(self.rows(self.runs[0])))

    def test_columns_are_chosen(self):
        lines = self.report('--csv', '--columns', 'time_s,slip', *self.runs).stdout.decode().splitlines()
        self.assertEqual(lines[0], 'run,time_s,slip')
        self.assertEqual({line.split(',')[0] for line in lines[1:]}, {'adaptive', 'locked'})
        said = self.report('--csv', '--columns', 'time_s,slope', self.runs[0], status=2).stderr.decode()
        self.assertIn('no column "slope"', said)

    def test_json(self):
        data = json.loads(self.report('--json', *self.runs).stdout)
        self.assertEqual([run['name'] for run in data['runs']], ['adaptive', 'locked'])
        for run, folder in zip(data['runs'], self.runs):
            rows = self.rows(folder)
            self.assertEqual(run['columns']['phase'], [row['phase'] for row in rows])
            self.assertEqual(run['columns']['slip'], [float(row['slip']) for row in rows])
            theta = [float(row['theta_est_N']) for row in rows]
            self.assertEqual(run['columns']['theta_est_N'], [None if math.isnan(v) else v for v in theta])
            self.assertEqual(run['summary'], self.summary(folder))

    def test_each_run_keeps_its_own_columns(self):
        runs = [*self.runs, self.make_run('steps', '--controller', 'locked', '--experiment', 'pulses')]
        own = [list(self.rows(run)[0]) for run in runs]
        every = list(dict.fromkeys(name for names in own for name in names))
        self.assertTrue('zeta_N' in every and 'phase_name' in every and every not in own)
        found = json.loads(self.report('--json', *runs).stdout)['runs']
        self.assertEqual([list(run['columns']) for run in found], own)
        for row in csv.DictReader(io.StringIO(self.report('--csv', *runs).stdout.decode())):
            names = own[[run.name for run in runs].index(row['run'])]
            self.assertEqual(list(row), ['run', *every])
            for name in {*every} - {*names}:
                self.assertEqual(row[name], '' if name == 'phase_name' else 'NaN')
        self.report('--octave', *runs, '--output', 'runs.mat')
        for run, names in zip(scipy.io.loadmat(self.folder / 'runs.mat', struct_as_record=False)['runs'][0], own):
            self.assertEqual([name for name in every if getattr(run, name).size], names)
        self.parquet(*runs)
        code = ('import sys, pandas; frame = pandas.read_parquet("runs.parquet"); assert list(frame) == ["run", *sys.argv[1:]]\n'
                'for _, part in frame.groupby("run", sort=False): print(*part.dropna(axis=1, how="all"), sep=",")')
        python = shutil.which('python', path=ROOT / 'build' / 'python' / 'bin') or sys.executable
        printed = subprocess.run([python, '-c', code, *every], cwd=self.folder, check=True, capture_output=True, text=True).stdout
        known = [[name for name in names if any(row[name] != 'NaN' for row in self.rows(run))] for run, names in zip(runs, own)]
        self.assertEqual([line.split(',')[1:] for line in printed.splitlines()], known)

    def test_mat_file_in_scipy(self):
        self.report('--octave', *self.runs, '--output', 'runs.mat')
        runs = scipy.io.loadmat(self.folder / 'runs.mat', struct_as_record=False, squeeze_me=True)['runs']
        for run, folder in zip(runs, self.runs):
            rows = self.rows(folder)
            self.assertEqual((run.name, run.controller, run.result), (folder.name, folder.name, 'completed'))
            self.assertEqual(run.slip.tolist(), [float(row['slip']) for row in rows])
            self.assertEqual([run.phase_names[int(number) - 1] for number in run.phase], [row['phase'] for row in rows])

    def test_parquet(self):
        self.parquet(*self.runs)
        again = self.report('--csv', *self.runs).stdout
        size = (self.folder / 'runs.parquet').stat().st_size
        self.assertEqual((self.folder / 'runs.parquet').read_bytes()[:4], b'PAR1')
        self.assertLess(size, len(again))

    def test_python_example(self):
        (self.folder / 'runs.json').write_bytes(self.report('--json', *self.runs).stdout)
        said = subprocess.run([sys.executable, EXAMPLES / 'load_run.py', self.folder / 'runs.json'], check=True,
                              capture_output=True, text=True).stdout
        self.assertEqual(said.splitlines(), [self.expected_line(run) for run in self.runs])

    def test_octave_example(self):
        if not shutil.which('octave'):
            self.skipTest('octave is missing: scripts/setup.sh packages-report.txt installs it')
        self.report('--octave', *self.runs, '--output', 'runs.mat')
        octave = ['octave', '--quiet', '--no-gui', '--no-history']
        environment = {**os.environ, 'HOME': str(self.folder)}
        said = subprocess.run([*octave, EXAMPLES / 'load_run.m', self.folder / 'runs.mat'], check=True,
                              capture_output=True, text=True, env=environment).stdout
        self.assertEqual(said.splitlines(), [self.expected_line(run) for run in self.runs])
        check = ("d = load('runs.mat'); for k = 1:2; r = d.runs(k); "
                 "printf('%d %.17g %.17g %d %s\\n', numel(r.time_s), sum(r.slip), r.distance_m(end), "
                 "sum(isnan(r.theta_est_N)), strjoin(r.phase_names, ' ')); end")
        lines = subprocess.run([*octave, '--eval', check], check=True, capture_output=True, text=True, cwd=self.folder,
                               env=environment).stdout.splitlines()
        for line, folder in zip(lines, self.runs):
            rows = self.rows(folder)
            count, slips, distance, unknown, *phases = line.split()
            self.assertEqual(int(count), len(rows))
            self.assertAlmostEqual(float(slips), math.fsum(float(row['slip']) for row in rows), delta=1e-9)
            self.assertEqual(float(distance), float(rows[-1]['distance_m']))
            self.assertEqual(int(unknown), sum(math.isnan(float(row['theta_est_N'])) for row in rows))
            self.assertEqual(phases, list(dict.fromkeys(row['phase'] for row in rows)))

    def test_nothing_is_overwritten(self):
        (self.folder / 'x.csv').write_text('precious')
        self.assertIn('exists', self.report('--csv', self.runs[0], '--output', 'x.csv', status=2).stderr.decode())
        self.assertEqual((self.folder / 'x.csv').read_text(), 'precious')
        self.assertIn('--csv', self.report('--csv', '--json', self.runs[0], status=2).stderr.decode())


if __name__ == '__main__':
    unittest.main(verbosity=2)
