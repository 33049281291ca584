"""abs_hil replay, as its users run it."""
import json
import random
import resource
import subprocess
import unittest

from program import PATIENT, PROGRAM, ProgramTest


class Replay(ProgramTest):
    def record(self, *args):
        log = self.folder / 'run.lcmlog'
        self.fast('--log', log, *args)
        return log

    def test_check_of_an_untouched_run(self):
        result = self.run_program('replay', self.record(), '--check')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stdout.count('bit-equal'), 2)

    def test_check_of_runs_that_ended_by_an_implausible_wheel(self):
        log, summary = self.folder / 'run.lcmlog', self.folder / 'summary.json'
        reasons = {row['number']: row['text'] for row in json.loads(self.run_program('list', '--reasons', '--json').stdout)}
        for fault, number in (('brake@encoder_upper:stuck+0.2s', 130), ('coast@encoders:garbage', 132),
                              ('accelerate@motor_pwm:off+0.5s', 141), ('brake@brake_pwm:off', 142)):
            with self.subTest(fault):
                result = self.run_program('--fast', '--no-lcm', '--log', log, '--summary', summary, '--inject', fault)
                self.assertEqual(result.returncode, 1, result.stderr)
                result = self.run_program('replay', log, '--check')
                self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
                self.assertEqual(result.stdout.count('bit-equal'), 1)
                self.assertIn('faults were injected', result.stdout)
                # The replay finds the same fault in the same cycle.
                self.assertTrue(self.summary(summary)['reason'].startswith(reasons[number]), self.summary(summary)['reason'])

    def test_check_of_damaged_logs(self):
        whole = self.record('--set', 'experiment.start_speed_rad_s=60').read_bytes()
        damaged = self.folder / 'damaged.lcmlog'
        generator = random.Random(1)
        for start in (len(whole) // 3, len(whole) // 2, len(whole) * 4 // 5):
            # In a message that the check compares: 24 bytes into the next cycle's telemetry.
            place = whole.index(b'ABS_TELEMETRY', start) + len('ABS_TELEMETRY') + 24
            damaged.write_bytes(whole[:place] + generator.randbytes(64) + whole[place + 64:])
            result = self.run_program('replay', damaged, '--check')
            self.assertIn(result.returncode, (1, 2))
            self.assertTrue(result.stderr)

    def test_the_log_of_a_killed_run_is_read_up_to_its_last_message(self):
        log, replayed = self.folder / 'run.lcmlog', self.folder / 'replayed.csv'
        run = subprocess.Popen([PROGRAM, *PATIENT, '--no-lcm', '--rt', 'off', '--log', log], stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
        while not log.exists() or log.stat().st_size < 100_000:
            self.assertIsNone(run.poll())
        run.kill()
        run.wait()
        # Not all writes end in the middle of a message.
        log.write_bytes(log.read_bytes()[:-5])
        for command in (('replay', log, '--csv', replayed), ('replay', log, '--check')):
            result = self.run_program(*command)
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn('cut off', result.stderr)
        self.assertGreater(len(self.rows(replayed)), 100)

    def test_a_failure_leaves_the_older_file(self):
        log, csv = self.record('--set', 'experiment.start_speed_rad_s=60'), self.folder / 'kept.csv'
        whole = log.read_bytes()
        csv.write_text('older')
        log.write_bytes(whole[:len(whole) // 2] + b'xxxx' + whole[len(whole) // 2 + 4:len(whole) * 3 // 4] + whole[-9000:])
        self.assertEqual(self.run_program('replay', log, '--csv', csv).returncode, 2)
        log.write_bytes(whole)
        result = self.run_program('replay', log, '--csv', csv,
                                  preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000)))
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn('ulimit -f', result.stderr)
        self.assertEqual(csv.read_text(), 'older')
        self.assertEqual(sorted(path.name for path in self.folder.iterdir()), ['kept.csv', 'run.lcmlog'])

    def test_a_run_folder_whose_files_changed_is_refused(self):
        folder = self.folder / 'run'
        self.fast('--set', 'experiment.start_speed_rad_s=60', '--out', folder)
        self.assertEqual(self.run_program('replay', folder, '--check').returncode, 0)
        with open(folder / 'run.lcmlog', 'ab') as file:
            file.write(b'x')
        result = self.run_program('replay', folder, '--check')
        self.assertEqual(result.returncode, 2)
        self.assertIn('run.lcmlog" is not as it was recorded', result.stderr)

    def test_not_a_log(self):
        for path in ('/etc/passwd', '/dev/null', self.folder, self.folder / 'none.lcmlog'):
            result = self.run_program('replay', path, '--check')
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn(str(path), result.stderr)

    def test_decimated_log_is_refused(self):
        result = self.run_program('replay', self.record('--set', 'telemetry.decimation=10'), '--check')
        self.assertEqual(result.returncode, 2)
        self.assertIn('telemetry.decimation', result.stderr)

    def test_real_time_run(self):
        log = self.folder / 'real.lcmlog'
        self.patient('--no-lcm', '--log', log, '--rt', 'off', '--set', 'experiment.cut_speed_rad_s=10', '--set',
                         'experiment.accelerate_limit_s=0.5')  # ends with a fault, which the replay finds again
        result = self.run_program('replay', log, '--check')
        self.assertEqual(result.returncode, 0, result.stderr + result.stdout)
        self.assertEqual(result.stdout.count('bit-equal'), 2)

    def test_other_controller(self):
        log, csv = self.record(), self.folder / 'would.csv'
        result = self.run_program('replay', log, '--controller', 'nominal', '--set', 'control.nominal.theta0_N=30',
                                  '--csv', csv)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('nominal', result.stdout)
        braking = [row for row in self.rows(csv) if row['phase'] == 'brake']
        self.assertEqual({row['theta_est_N'] for row in braking}, {'30'})
        for wrong in (('--controller', 'nosuch'), ('--set', 'control.slip_ref=7'), ('--check', '--controller', 'pi')):
            self.assertEqual(self.run_program('replay', log, *wrong).returncode, 2)

    def test_the_same_controller_with_its_own_gains_differs_in_nothing(self):
        log, csv, own = self.folder / 'run.lcmlog', self.folder / 'would.csv', self.folder / 'own.csv'
        self.fast('--log', log, '--csv', own)
        self.assertEqual(self.run_program('replay', log, '--csv', csv).returncode, 0)
        self.assertEqual(csv.read_bytes(), own.read_bytes())

    def test_one_of_several_runs(self):
        first = self.record('--set', 'experiment.start_speed_rad_s=60').read_bytes()
        second = self.record('--set', 'experiment.start_speed_rad_s=40', '--controller', 'pi').read_bytes()
        both = self.folder / 'both.lcmlog'
        both.write_bytes(first + second)
        result = self.run_program('replay', both, '--check')
        self.assertEqual(result.returncode, 2)
        self.assertIn(f"'{both}' holds 2 runs: give '{both}#1' for the first", result.stderr)
        result = self.run_program('replay', f'{both}#2', '--check')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stdout.count('bit-equal'), 2)

    def test_a_log_of_another_version_is_refused_with_its_reason(self):
        log = self.record('--set', 'experiment.start_speed_rad_s=60')
        data = log.read_bytes()
        place = data.index(b'ABS_TELEMETRY') + len('ABS_TELEMETRY')
        fingerprint = data[place:place + 8]
        log.write_bytes(data.replace(b'ABS_TELEMETRY' + fingerprint, b'ABS_TELEMETRY' + bytes(range(8))))
        result = self.run_program('replay', log, '--check')
        self.assertEqual(result.returncode, 2)
        self.assertIn('is not a telemetry_t of this version of abs_hil; replay it with the version that recorded it',
                      result.stderr)


if __name__ == '__main__':
    unittest.main()
