"""abs_hil study as users run it: the same bytes in shards, threads and after kills; single runs again; bad studies.

usage: study_test.py ABS_HIL [KILLS]: the number of random kills, 4 by default.
"""
import gzip
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import time
import unittest

import program
from program import PROGRAM, ProgramTest

KILLS = int(sys.argv.pop(1)) if sys.argv[1:] and sys.argv[1].isdigit() else 4

STUDY = '''
controllers = ["adaptive", "pi"]
chunk = 20
[design]
kind = "latin-hypercube"
points = 60
[repeat]
runs = 2
[factors]
plant.theta_N = { from = 15, to = 30 }
control.slip_ref = [0.12, 0.15]
'''
RUNS = 2 * 60 * 2 * 2


class Study(ProgramTest):
    def setUp(self):
        super().setUp()
        self.study = self.folder / 'study.toml'
        self.study.write_text(STUDY)

    def complete(self, *args, out='whole', status=0):
        result = self.run_program('study', self.study, '--out', self.folder / out, *args)
        self.assertEqual(result.returncode, status, result.stderr)
        return result

    def results(self, out='whole'):
        return (self.folder / out / 'results.csv.gz').read_bytes()

    def table(self, out='whole'):
        with gzip.open(self.folder / out / 'results.csv.gz', 'rt', newline='') as file:
            return list(program.csv.DictReader(file))

    def test_same_bytes_with_any_threads_and_shards(self):
        self.complete()
        table = self.table()
        self.assertEqual([int(row['run']) for row in table], list(range(RUNS)))
        self.assertEqual({row['result'] for row in table}, {'completed'})
        for threads in (1, 3):
            self.complete('--threads', threads, out=f'threads{threads}')
            self.assertEqual(self.results(f'threads{threads}'), self.results())
        for parts in (2, 7):
            order = list(range(1, parts + 1)) + [1]  # one of them twice
            random.Random(parts).shuffle(order)
            for part in order:
                self.complete('--shard', f'{part}/{parts}', out=f'parts{parts}')
            merged = self.run_program('study', 'merge', self.folder / f'parts{parts}')
            self.assertEqual(merged.returncode, 0, merged.stderr)
            self.assertEqual(self.results(f'parts{parts}'), self.results())

    def test_a_lost_part_is_named_and_computed_alone(self):
        self.complete('--shard', '1/2')
        merged = self.run_program('study', 'merge', self.folder / 'whole')
        self.assertEqual(merged.returncode, 1)
        self.assertIn('12 of 24 chunks are missing: 1, 3, 5, 7, 9, 11 and 6 more', merged.stderr)
        self.assertIn('240 of 480 runs (50.0 %)', self.run_program('study', 'status', self.folder / 'whole').stdout)
        (self.folder / 'whole' / 'parts' / '00000002.csv.gz').write_bytes(b'half')
        status = self.run_program('study', 'status', self.folder / 'whole').stdout
        self.assertIn('220 of 480 runs', status)
        self.assertIn('of these damaged: 2; the study computes them anew', status)
        whole = self.complete()
        self.assertIn(f': {RUNS} runs, {RUNS // 2 + 20} of them now in', whole.stdout)
        self.assertIn('damaged chunks were computed anew: 2', whole.stderr)
        self.assertIn('complete', self.run_program('study', 'status', self.folder / 'whole').stdout)
        self.assertIn('complete already; results: ', self.complete().stdout)
        self.complete(out='other')
        self.assertEqual(self.results(), self.results('other'))

    def test_killed_at_random_moments_and_resumed_it_ends_in_the_same_bytes(self):
        start = time.monotonic()
        self.complete()
        whole_s = time.monotonic() - start
        chance = random.Random(20)
        kills = 0
        for attempt in range(10 * KILLS):
            if kills == KILLS:
                break
            out = self.folder / 'killed'
            process = subprocess.Popen([PROGRAM, 'study', self.study, '--out', out], stdout=subprocess.DEVNULL,
                                       stderr=subprocess.DEVNULL)
            time.sleep(chance.uniform(0.0, 0.7 * whole_s))
            process.send_signal(signal.SIGKILL)
            kills += process.wait() == -signal.SIGKILL
            if (out / 'results.csv.gz').exists():  # it was quicker: this one ended, the next begins anew
                self.assertEqual(self.results('killed'), self.results())
                os.rename(out, self.folder / f'ended{attempt}')
        self.assertEqual(kills, KILLS)
        self.complete(out='killed')
        self.assertEqual(self.results('killed'), self.results())
        self.assertEqual(sorted(entry.name for entry in (self.folder / 'killed').iterdir()),
                         ['SHA256SUMS', 'results.csv.gz', 'study.json', 'study.toml'])

    def interrupted(self, *args):
        """What the program says after one Ctrl-C, as soon as it listens to it."""
        with subprocess.Popen([PROGRAM, *map(str, args)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
            listens = 1 << (signal.SIGINT - 1)
            while not int(re.search(r'SigCgt:\s*(\w+)', pathlib.Path(f'/proc/{process.pid}/status').read_text())[1], 16) & listens:
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
            errors = process.stderr.read()
        self.assertEqual(process.returncode, 130, errors)
        return errors

    def test_interrupted_it_says_what_is_kept(self):
        many = self.folder / 'many.toml'
        many.write_text(STUDY.replace('points = 60', 'points = 100000'))
        errors = self.interrupted('study', many, '--out', self.folder / 'many')
        self.assertRegex(errors, r'interrupted after \d+ of 800000 runs.*many keeps each chunk that is complete \(20 runs each\)')
        self.assertIn('the same command goes on from there', errors)
        errors = self.interrupted('compare', '--repeat', 100_000)
        self.assertRegex(errors, r'interrupted after \d+ of 200000 runs. A comparison keeps nothing')

    @unittest.skipIf(KILLS < 30, 'takes a minute')
    def test_memory_does_not_grow_with_the_runs(self):
        largest_kB = []
        for points in (10_000, 100_000):
            self.study.write_text(f'''controllers = ["locked"]
[settings]
experiment.start_speed_rad_s = 155
experiment.end_speed_m_s = 15.0
[design]
kind = "sobol"
points = {points}
[factors]
plant.theta_N = {{ from = 15, to = 30 }}
''')
            process = subprocess.Popen([PROGRAM, 'study', self.study, '--out', self.folder / str(points)],
                                       stdout=subprocess.DEVNULL)
            _, status, used = os.wait4(process.pid, 0)
            self.assertEqual(status, 0)
            largest_kB.append(used.ru_maxrss)
        self.assertLess(largest_kB[1] - largest_kB[0], 4096, largest_kB)  # 100,000 results alone are 12 MB

    def test_a_run_repeated_with_everything_recorded_has_the_row_s_figures(self):
        self.study.write_text(STUDY + 'plant.J1_kg_m2 = { mean = 0.0075, sd = 0.0005 }\nmodel.c31_per_s = [18.5]\n')
        self.complete()
        table = self.table()
        for number in (0, 333):
            row, folder = table[number], self.folder / f'run{number}'
            self.assertEqual(self.run_program('study', self.study, '--run', number, '--out', folder).returncode, 0)
            self.assert_summary_has(folder, row)
            # Its configuration repeats it.
            again = self.folder / f'again{number}'
            self.fast('--config', folder / 'config.toml', '--out', again)
            self.assertEqual((folder / 'run.csv').read_bytes(), (again / 'run.csv').read_bytes())
        result = self.run_program('study', self.study, '--run', RUNS)
        self.assertEqual(result.returncode, 2)
        self.assertIn(f'give a number in [0, {RUNS - 1}]', result.stderr)

    def assert_summary_has(self, folder, row):
        summary = self.summary(folder / 'summary.json')
        for name in ('stop_time_s', 'stop_distance_m', 'slip_rms', 'torque_total_variation_Nm', 'slip_settling_s'):
            self.assertEqual(summary[name], None if row[name] == 'nan' else float(row[name]), name)

    def test_a_run_of_a_comparison_is_repeated(self):
        args = ('compare', '--plant', 'paper-timing', '--repeat', 5, '--controllers', 'adaptive,pi{kp_per_s=50}')
        runs = self.folder / 'runs.csv'
        self.assertEqual(self.run_program(*args, '--runs', runs).returncode, 0)
        result = self.run_program(*args, '--run', 3, '--out', self.folder / 'three')
        self.assertEqual(result.returncode, 0, result.stderr)
        for name, folder in (('adaptive', 'adaptive'), ('pi{kp_per_s=50}', 'pi_kp_per_s=50_')):
            row = next(row for row in self.rows(runs) if row['run'] == '3' and row['controller'] == name)
            self.assert_summary_has(self.folder / 'three' / folder, row)
        one = self.run_program('compare', '--controllers', 'adaptive', '--run', 3, '--out', self.folder / 'one')
        self.assertEqual(one.returncode, 0, one.stderr)
        self.assertTrue((self.folder / 'one' / 'run.csv').exists())
        for bad in (('--run', 5), ('--out', 'x'), ('--run', 1, '--json', 'x')):
            self.assertEqual(self.run_program(*args, *bad).returncode, 2)

    def test_without_repetitions_run_seed_counts_and_the_model_stays_nominal(self):
        self.study.write_text('[settings]\nrun.seed = 7\n[factors]\nplant.theta_N = [30]\n')
        self.complete()
        summary = self.folder / 's.json'
        self.fast('--seed', 7, '--set', 'experiment.start_speed_rad_s=170', '--set', 'plant.theta_N=30', '--set',
                  'model.theta_N=23', '--summary', summary)
        self.assertEqual(float(self.table()[0]['slip_rms']), self.summary(summary)['slip_rms'])

    def test_a_combination_that_cannot_run_is_a_row_with_its_reason(self):
        self.study.write_text('[factors]\nplant.load = ["constant", "lever"]\nplant.lever_phi_deg = [65.0, 90.0]\n'
                              'plant.lever_L_m = [0.37, 0.01]\n')
        result = self.complete()
        self.assertEqual(len(self.table()), 8)
        refused = [row for row in self.table() if row['result'] == 'refused']
        self.assertIn(f'{len(refused)} refused', result.stdout)
        for row in refused:
            self.assertTrue(row['reason'])
            self.assertEqual(row['stop_time_s'], 'nan')

    def test_metrics_of_one_s_own_are_those_of_the_recorded_run(self):
        self.study.write_text('controllers = ["adaptive", "pi"]\n[factors]\nplant.theta_N = [20, 30]\n' + ''.join(
            f'[[metric]]\nname = "{name}"\nof = "{of}"\ntake = "{take}"\n{rest}\n' for name, of, take, rest in (
                ('a', 'brake_torque_Nm', 'max', ''), ('b', 'slip', 'rms', 'after_s = 0.3\nabove_m_s = 3'),
                ('c', 'zeta_N', 'mean', ''), ('d', 'omega2_rad_s', 'last', 'phase = "hold"'),
                ('e', 'slip', 'min', 'above_m_s = 5'))))
        self.complete()
        for number, row in enumerate(self.table()):
            folder = self.folder / f'run{number}'
            self.assertEqual(self.run_program('study', self.study, '--run', number, '--out', folder).returncode, 0)
            rows = self.rows(folder / 'run.csv')
            radius = 0.099
            brake = [r for r in rows if r['phase'] == 'brake']
            fast = [float(r['slip']) for r in brake if radius * float(r['omega2_rad_s']) > 3
                    and float(r['time_s']) - float(brake[0]['time_s']) >= 0.3]
            self.assertEqual(float(row['a']), max(float(r['brake_torque_Nm']) for r in brake))
            self.assertAlmostEqual(float(row['b']), (sum(x * x for x in fast) / len(fast)) ** 0.5, places=12)
            hold = [float(r['omega2_rad_s']) for r in rows if r['phase'] == 'hold']
            self.assertEqual(row['d'] == 'nan', not hold)
            if hold:
                self.assertEqual(float(row['d']), hold[-1])
            self.assertEqual(float(row['e']), min(float(r['slip']) for r in brake
                                                  if radius * float(r['omega2_rad_s']) > 5))
            if row['controller'] == 'adaptive':
                zeta = [float(r['zeta_N']) for r in brake]
                self.assertAlmostEqual(float(row['c']), sum(zeta) / len(zeta), places=10)
            else:
                self.assertEqual(row['c'], 'nan')

    def test_quiet_without_a_terminal(self):
        self.assertEqual(self.complete().stderr, '')

    def test_bad_input(self):
        for text, words in (('plants = ["moon"]', ['moon', 'paper-table1']),
                            ('experiments = ["papr"]', ['papr']),
                            ('experiments = ["series-of-ten"]', ['series']),
                            ('[settings]\nrun.sensor_seed = "-1"', ['run.sensor_seed', '2^64']),
                            ('controllers = ["pi{zz=1}"]', ['zz']),
                            ('[factors]\nplant.thetaN = [1]', ['study.toml:2:7', 'plant.theta_N']),
                            ('[settings]\nrun.inject = "brake@encoder_upper:stuck"', ['injects no faults']),
                            ('model = "moon"', ['moon']),
                            ('[[metric]]\nname = "x"\nof = "slipp"\ntake = "max"', ['study.toml:3:6', '"slip"']),
                            ('[[metric]]\nname = "slip_rms"\nof = "slip"\ntake = "max"', ['another name'])):
            self.study.write_text(text)
            result = self.run_program('study', self.study, '--out', self.folder / 'bad')
            self.assert_refused(result, words)
            self.assertFalse((self.folder / 'bad').exists())
        self.study.write_text(STUDY)
        for args, words in ((('study', self.folder / 'none.toml'), ['none.toml', 'no such file']),
                            (('study',), ['merge, status or submit']),
                            (('study', self.study), ['--out']),
                            (('study', self.study, '--out', 'x', '--shard', '3/2'), ['--shard 3/2']),
                            (('study', self.study, '--out', 'x', '--shard', '0/2'), ['--shard 0/2']),
                            (('study', self.study, '--out', '/proc/x'), ['/proc/x']),
                            (('study', 'merge', self.folder), ['holds no study']),
                            (('study', 'status', self.folder), ['holds no study']),
                            (('--seed', 3, 'study', self.study), ['--seed']),
                            (('study', '--threads', 2, 'status', self.folder), ['--threads']),
                            (('study', 'submit', self.study), ['--array']),
                            (('study', 'submit', self.study, '--array', 2, '--out', 'x', '--', 'short'), ['short']),
                            (('study', 'submit', self.study, '--array', 2, '--out', 'x', '--', '--array=3'), ['--array=3'])):
            with self.subTest(args=args):
                self.assert_refused(self.run_program(*args), words)
        self.complete()
        self.study.write_text(STUDY + '# changed\n')
        self.assert_refused(self.run_program('study', self.study, '--out', self.folder / 'whole'), ['another study'])

    def assert_refused(self, result, words):
        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        self.assertEqual(len(result.stderr.strip().splitlines()), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_scripts_for_slurm(self):
        result = self.run_program('study', 'submit', self.study, '--array', 3, '--out', self.folder / "it's", '--write-only',
                                  '--', '--partition=short')
        self.assertEqual(result.returncode, 0, result.stderr)
        array, merge = (self.folder / "it's" / 'slurm' / name for name in ('array.sh', 'merge.sh'))
        self.assertEqual(result.stdout, f'{array}\n{merge}\n')
        for script in (array, merge):
            self.assertIn('#SBATCH --partition=short\n', script.read_text())
        self.assertIn('#SBATCH --array=1-3\n', array.read_text())
        # The scripts without Slurm, as it would start them.
        for task in ('2', '1', '3'):
            subprocess.run(['sh', array], check=True, stdout=subprocess.DEVNULL,
                           env=dict(os.environ, SLURM_ARRAY_TASK_ID=task, SLURM_CPUS_PER_TASK='2'))
        subprocess.run(['sh', merge], check=True, stdout=subprocess.DEVNULL)
        self.complete()
        self.assertEqual(self.results("it's"), self.results())
        again = self.run_program('study', 'submit', self.study, '--array', 3, '--out', self.folder / "it's")
        self.assertIn('nothing to submit', again.stdout)

    def test_the_results_say_which_study_they_are_of(self):
        self.complete()
        # The file name of gzip's first header: between the fixed ten bytes and the next NUL. DuckDB refuses a comment.
        header = self.results()
        self.assertEqual(header[3], 8)
        facts = program.json.loads(header[10:header.index(0, 10)])
        self.assertEqual(facts['text'], STUDY)
        self.assertEqual(facts, self.summary(self.folder / 'whole' / 'study.json'))
        self.assertRegex(facts['identity'], r'^[0-9a-f]{64}$')
        self.assertTrue(re.match(r'abs_hil \d', facts['program']))


if __name__ == '__main__':
    unittest.main(verbosity=2)
