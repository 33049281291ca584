"""Experiment files and series of runs, as users run them."""
import json
import os
import re
import resource
import signal
import subprocess
import time
import unittest

from program import PATIENT, PROGRAM, ProgramTest

SHORT = '''
[settings]
experiment.start_speed_rad_s = 60
[[phase]]
name = "brake"
brake = "controller"
until = { car_speed_below_m_s = 1 }
at_most_s = 20
[[phase]]
name = "stopped"
until = { lasts_s = 0.01 }
'''


class Series(ProgramTest):
    def script(self, text, name='mine.toml'):
        path = self.folder / name
        path.write_text(text)
        return path

    def index(self, out):
        return json.loads((out / 'series.json').read_text())['runs']

    def test_a_grid_with_repetitions(self):
        script = self.script(SHORT + '[series]\nrepeat = 2\nseed = 5\n[factors]\ncontrol.controller = ["adaptive", "pi"]\n'
                             'control.slip_ref = [0.1, 0.2]\n')
        out = self.folder / 'out'
        self.fast('--experiment', script, '--out', out)
        runs = self.index(out)
        self.assertEqual([r['seed'] for r in runs], [5, 6] * 4)
        self.assertEqual([tuple(r['varied'].values()) for r in runs[::2]],
                         [('adaptive', 0.1), ('adaptive', 0.2), ('pi', 0.1), ('pi', 0.2)])
        self.assertEqual({r['status'] for r in runs}, {'completed'})
        for run in runs:
            folder = out / run['folder']
            self.assertTrue((folder / 'SHA256SUMS').exists())
            self.assertEqual((folder / 'experiment.toml').read_text(), script.read_text())
            config = self.summary(folder / 'summary.json')['config']
            self.assertEqual(config['run']['seed'], run['seed'])
            self.assertEqual(config['control']['slip_ref'], run['varied']['control.slip_ref'])
            self.assertEqual(config['experiment_script'], script.read_text())

    def test_a_run_of_a_series_is_the_run_by_itself(self):
        out = self.folder / 'out'
        self.fast('--experiment', self.script(SHORT + '[series]\nseeds = [3, 9]\n'), '--out', out)
        single = self.folder / 'single.csv'
        self.fast('--experiment', self.script(SHORT, 'single.toml'), '--seed', 9, '--csv', single)
        self.assertEqual((out / 'run-0002' / 'run.csv').read_bytes(), single.read_bytes())

    def test_it_goes_on_where_it_was_interrupted(self):
        script = self.script(SHORT + '[series]\nrepeat = 4\npause_s = 0.2\n')
        out = self.folder / 'out'
        command = [PROGRAM, *PATIENT, '--no-lcm', '--rt', 'off', '--experiment', str(script), '--out', str(out)]
        program = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 50
        while not (out / 'run-0001').exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        program.send_signal(signal.SIGINT)
        words, errors = program.communicate(timeout=30)
        self.assertEqual(program.returncode, 130, errors)
        done = [run['folder'] for run in self.index(out) if run['status'] == 'completed']
        self.assertIn(f'interrupted with {len(done)} of 4 runs done, 0 ended early, in {out}', words)
        self.assertIn(f'to continue, repeat the command with --out {out}', words)
        self.assertTrue(0 < len(done) < 4)
        before = {name: (out / name / 'SHA256SUMS').read_bytes() for name in done}
        result = subprocess.run(command, capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual({run['status'] for run in self.index(out)}, {'completed'})
        for name, sums in before.items():
            self.assertEqual((out / name / 'SHA256SUMS').read_bytes(), sums)
        # Another series of runs does not go into the same folder.
        result = self.run_program(*command[1:], '--set', 'control.slip_ref=0.2')
        self.assertEqual(result.returncode, 2)
        self.assertIn('another series', result.stderr)

    def test_a_run_that_lost_its_record_is_repeated(self):
        out = self.folder / 'out'
        script = self.script(SHORT.replace('0.01', '5') + '[series]\nrepeat = 3\n')
        command = ('--fast', '--no-lcm', '--experiment', script, '--out', out)

        def loses(words, **more):
            result = self.run_program(*command, **more)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertIn(words, result.stderr)
            self.assertRegex(result.stdout, 'ended because run-000. has no complete record with . of 3 runs done, '
                             f'0 ended early, in {out}; to continue, repeat')
            self.assertNotIn('fault', str(self.index(out)))

        loses('recorded data was lost', preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000)))
        (out / 'run-0003.part').symlink_to('nowhere')  # no run can write there
        loses('run-0003.part')
        (out / 'run-0003.part').unlink()
        self.assertEqual(self.run_program(*command).returncode, 0)
        self.assertEqual({run['status'] for run in self.index(out)}, {'completed'})
        self.assertTrue((out / 'run-0001.interrupted-1' / 'summary.json').exists())
        self.assertTrue((out / 'run-0001' / 'SHA256SUMS').exists())

    def test_progress_and_what_it_came_to(self):
        script = self.script(SHORT + '[series]\nrepeat = 20\n')
        result = self.fast('--experiment', script, '--out', self.folder / 'out')
        self.assertIn('20 of 20 runs', result.stderr)
        self.assertIn('20 runs, 0 ended early', result.stdout)

    def test_the_time_left_counts_the_pauses(self):
        script = self.script(SHORT + '[series]\nrepeat = 2\npause_s = 3\n')
        result = self.run_program('--no-lcm', '--rt', 'off', '--experiment', script, '--out', self.folder / 'out')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertGreaterEqual(int(re.search(r'1 of 2 runs, (\d+) s left', result.stderr).group(1)), 3)

    def test_a_fault_does_not_stop_the_others(self):
        script = self.script(SHORT + '[factors]\ngate.overspeed_rad_s = [50, 250]\n')
        out = self.folder / 'out'
        result = self.run_program('--fast', '--no-lcm', '--experiment', script, '--out', out)
        self.assertEqual(result.returncode, 1)
        self.assertEqual([run['status'] for run in self.index(out)], ['fault', 'completed'])

    def test_one_file_is_no_place_for_a_series(self):
        result = self.run_program('--fast', '--no-lcm', '--experiment', 'series-of-ten', '--csv', self.folder / 'x.csv')
        self.assertEqual(result.returncode, 2)
        self.assertIn('--out', result.stderr)

    def test_every_shipped_experiment_runs(self):
        for name in ('paper', 'coast-down', 'brake-step', 'friction-jump', 'slip-sweep', 'series-of-ten'):
            with self.subTest(name):
                self.fast('--experiment', name)
                self.assertEqual(self.run_program('validate', name).returncode, 0)

    def test_slip_sweep_in_summary_and_folder(self):
        out = self.folder / 'out'
        self.fast('--experiment', 'slip-sweep', '--out', out)
        found = self.summary(out / 'summary.json')['friction_curve']
        self.assertAlmostEqual(found['peak_force_N'] / 23.0, 1, delta=0.02)
        self.assertAlmostEqual(found['peak_slip'] / 0.0484, 1, delta=0.1)
        self.assertEqual((out / 'friction_curve.csv').read_text().splitlines()[0], 'time_s,slip,force_N')

    def test_validate(self):
        bad = self.script('[[phase]]\nname="a"\nmotr=1\n')
        result = self.run_program('validate', bad)
        self.assertEqual(result.returncode, 2)
        self.assertIn('mine.toml:3:1: unknown key "motr"', result.stderr)
        strong = self.script('[[phase]]\nname = "a"\nbrake = { torque_Nm = 6 }\nuntil = { lasts_s = 1 }\n')
        self.assertEqual(self.run_program('validate', strong).returncode, 0)
        result = self.run_program('validate', strong, '--backend', 'rig', '--set', 'driver.kind=pci')
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertIn('more than the 4.458 N m that gate.brake_duty_max allows; give at most that', result.stderr)
        long = self.script('[[phase]]\nname = "a"\nuntil = { lasts_s = 1 }\n[limits]\nrun_time_s = 0.5\n')
        result = self.run_program('validate', long)
        self.assertEqual(result.returncode, 2, result.stdout)
        self.assertIn('mine.toml: the run lasts at least 1 s, but limits.run_time_s is 0.5 s', result.stderr)

    def test_simulation_only_events_are_refused_on_the_rig_by_name(self):
        jump = self.run_program('--backend', 'rig', '--no-lcm', '--experiment', 'friction-jump')
        self.assertEqual(jump.returncode, 2)
        self.assertIn('friction-jump.toml:4:1: [[event]] friction', jump.stderr)
        fault = self.script(SHORT.replace('[settings]\nexperiment.start_speed_rad_s = 60\n', '') +
                            '[[event]]\ninject = "brake@encoder_upper:stuck+0.2s"\n')
        result = self.run_program('--backend', 'rig', '--no-lcm', '--experiment', fault)
        self.assertEqual(result.returncode, 2)
        self.assertIn('[[event]] inject', result.stderr)
        self.assertIn('mine.toml', result.stderr)


if __name__ == '__main__':
    unittest.main()
