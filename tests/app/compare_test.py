"""abs_hil compare as users run it: the same table with any number of threads, consistent files, bad input refused."""
import json
import os
import shutil
import subprocess
import unittest

from program import PROGRAM, ProgramTest

SMALL = ('compare', '--controllers', 'adaptive,sliding-mode', '--repeat', '4', '--seed', '3')


class Compare(ProgramTest):
    def test_same_bytes_with_any_number_of_threads(self):
        outputs = {self.run_program(*SMALL, '--threads', threads).stdout for threads in (1, 2, 7)}
        self.assertEqual(len(outputs), 1)
        self.assertIn('adaptive / sliding-mode: stop time', outputs.pop())
        self.assertEqual(self.run_program(*SMALL, '--threads', 2).stderr, '')

    def test_files_agree(self):
        names = {kind: self.folder / f'table.{kind}' for kind in ('json', 'csv', 'markdown', 'runs')}
        result = self.run_program(*SMALL, *(arg for kind, path in names.items() for arg in (f'--{kind}', path)))
        self.assertEqual(result.returncode, 0, result.stderr)
        table = json.loads(names['json'].read_text())
        self.assertEqual(table['config']['experiment']['start_speed_rad_s'], 170)
        runs = self.rows(names['runs'])
        self.assertEqual(len(runs), 8)
        for controller in table['controllers']:
            times = [float(run['stop_time_s']) for run in runs if run['controller'] == controller['name']]
            mean = controller['metrics']['stop_time_s']['mean']
            self.assertAlmostEqual(sum(times) / len(times), mean, places=12)
            self.assertIn(f'{mean:.3f}', names['markdown'].read_text())
            rows = [row for row in self.rows(names['csv'])
                    if row['controller'] == controller['name'] and row['metric'] == 'stop_time_s']
            self.assertEqual(float(rows[0]['mean']), mean)

    def test_start_speed_of_the_configuration_counts(self):
        config = self.folder / 'slow.toml'
        config.write_text('[experiment]\nstart_speed_rad_s = 100.0\n')
        args = ('compare', '--controllers', 'adaptive', '--repeat', '1')
        self.assertIn('from 100 rad/s', self.run_program(*args, '--config', config).stdout)
        self.assertIn('from 170 rad/s', self.run_program(*args).stdout)
        self.assertIn('from 90 rad/s', self.run_program(
            *args, '--config', config, '--set', 'experiment.start_speed_rad_s=90').stdout)

    def test_a_single_run_of_the_nominal_plant_is_the_program_s_own(self):
        summary = self.folder / 's.json'
        self.fast('--set', 'experiment.start_speed_rad_s=170', '--summary', summary)
        table = self.folder / 't.json'
        self.run_program('compare', '--controllers', 'adaptive', '--repeat', 1, '--vary', 'none', '--json', table)
        metrics = json.loads(table.read_text())['controllers'][0]['metrics']
        for key in ('stop_time_s', 'stop_distance_m', 'slip_rms', 'torque_total_variation_Nm', 'slip_overshoot'):
            self.assertEqual(metrics[key]['mean'], self.summary(summary)[key], key)

    def test_out_is_the_table_in_the_format_of_its_ending(self):
        for option, ending in (('--json', 'json'), ('--csv', 'csv'), ('--markdown', 'md')):
            old, new = self.folder / f'old-{ending}', self.folder / f'new.{ending}'
            self.run_program(*SMALL, option, old)
            self.assertEqual(self.run_program(*SMALL, '--out', new).returncode, 0)
            self.assertEqual(new.read_text(), old.read_text())
        for bad in (('--out', self.folder / 'x'), ('--out', self.folder / 'x.pdf'),
                    ('--out', self.folder / 'x.csv', '--csv', 'y.csv')):
            result = self.run_program(*SMALL, *bad)
            self.assertEqual((result.returncode, result.stdout), (2, ''), result.stderr)
        self.assertEqual([file.name for file in self.folder.glob('x*')], [])

    def test_bad_input(self):
        for args, words in ((('--controllers', 'adaptive,nope'), ['nope']),
                            (('--controllers', 'adaptive,adaptive'), ['twice']),
                            (('--repeat', '0'), ['--repeat']),
                            (('--repeat', '-3'), ['--repeat']),
                            (('--vary', 'thetta=0.1'), ['thetta', 'theta']),
                            (('--vary', 'theta=7'), ['theta=7', '[0, 0.5]']),
                            (('--plant', 'moon'), ['moon']),
                            (('--set', 'plant.thetaN=3'), ['plant.theta_N']),
                            (('--threads', '-1'), ['--threads']),
                            (('--seed', 'x'), ['--seed']),
                            (('--json', '/nonexistent/dir/t.json'), ['/nonexistent/dir/t.json'])):
            with self.subTest(args=args):
                result = self.run_program('compare', *args)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertEqual(result.stdout, '')
                lines = result.stderr.strip().splitlines()
                self.assertEqual(len(lines), 1, result.stderr)
                for word in words:
                    self.assertIn(word, lines[0])

    def test_options_of_a_run_are_not_silently_ignored(self):
        result = self.run_program('--plant', 'paper-timing', 'compare', '--repeat', 1)
        self.assertEqual(result.returncode, 2)
        self.assertIn('--plant', result.stderr)

    def with_tables_by(self, script, *args):
        """The program in a folder of its own, beside a program of ours that should make the tables."""
        folder = self.folder / 'bin'
        folder.mkdir(exist_ok=True)
        program = shutil.copy(PROGRAM, folder / 'abs_hil')
        if script:
            tables = folder / 'abs_compare_tables'
            tables.write_text(f'#!/bin/sh\n{script}\n')
            tables.chmod(0o755)
        return subprocess.run([program, 'compare', '--controllers', 'pi', *args], capture_output=True, text=True, timeout=60,
                              env={**os.environ, 'PATH': '/usr/bin:/bin'}, check=False)

    def test_without_the_program_of_the_tables_nothing_runs(self):
        out = self.folder / 'table.csv'
        out.write_text('older')
        result = self.with_tables_by('', '--repeat', '1000000', '--out', out)
        self.assertEqual((result.returncode, result.stdout), (3, ''))
        self.assertRegex(result.stderr, r'^abs_hil: abs_compare_tables: No such file.*; install the package python3-abs-hil.*\n$')
        self.assertEqual(out.read_text(), 'older')

    def test_tables_that_fail_end_the_runs(self):
        """A million runs would take minutes."""
        out = self.folder / 'table.csv'
        result = self.with_tables_by('echo "abs_compare_tables: the Python package numpy is missing" >&2; exit 3', '--repeat', '1000000',
                                     '--out', out)
        self.assertEqual((result.returncode, result.stdout), (3, ''))
        self.assertEqual(result.stderr, 'abs_compare_tables: the Python package numpy is missing\n')
        result = self.with_tables_by('cat >/dev/null; kill -9 $$', '--repeat', '2', '--out', out)
        self.assertEqual((result.returncode, result.stdout), (1, ''))
        self.assertIn('abs_compare_tables was ended by signal 9', result.stderr)
        self.assertEqual([path.name for path in self.folder.iterdir()], ['bin'])

    def test_the_seed_of_a_run_is_told_where_the_phase_does_not_vary(self):
        runs = self.folder / 'runs.csv'
        self.run_program('compare', '--controllers', 'pi', '--repeat', 2, '--vary', 'theta=0.1', '--set', 'run.seed=7', '--runs', runs)
        self.assertEqual([row['sensor_seed'] for row in self.rows(runs)], ['7', '7'])
        summary = self.folder / 's.json'
        self.fast('--controller', 'pi', '--set', 'experiment.start_speed_rad_s=170', '--seed', 7, '--set',
                  f'plant.theta_N={self.rows(runs)[1]["plant.theta_N"]}', '--set', 'model.theta_N=23', '--summary', summary)
        self.assertEqual(float(self.rows(runs)[1]['slip_rms']), self.summary(summary)['slip_rms'])


if __name__ == '__main__':
    unittest.main()
