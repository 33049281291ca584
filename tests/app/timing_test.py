"""abs_hil latency, doctor and --histogram: reports and exit statuses, never this computer's timing."""
import json
import unittest

from program import ProgramTest


class Timing(ProgramTest):
    def latency(self, *args):
        result = self.run_program('latency', '--rt', 'prefer', '--json', *args)
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def test_rates(self):
        for rate in (100, 10_000):
            with self.subTest(rate_Hz=rate):
                run = self.latency('--rate', rate, '--duration', 0.5, '--set', 'realtime.startup_cycles=0',
                                   '--set', 'realtime.max_consecutive_overruns=0',
                                   '--set', 'realtime.late_max_s=1000')
                # Every tick of the half second was met or is counted as missed.
                self.assertLessEqual(run['cycles'], 0.5 * rate + 2)
                self.assertGreaterEqual(run['cycles'] + run['ticks_missed'], 0.5 * rate)
                for part in ('wakeup_latency_us', 'read_us', 'control_us', 'write_us', 'cycle_time_us'):
                    self.assertLessEqual(run[part]['p50'], run[part]['max'])
                for fact in ('kernel', 'preemption', 'governor', 'isolated_cpus', 'load_1min'):
                    self.assertIn(fact, run['machine'])
                self.assertIn(run['verdict']['overall'], ('very good', 'good', 'usable', 'unfit'))

    def test_histogram(self):
        file = self.folder / 'histogram.txt'
        run = self.latency('--duration', 0.2, '--histogram', file)
        lines = file.read_text().splitlines()
        bins = [line.split() for line in lines if not line.startswith('#')]
        overflows = [int(word) for word in lines[-1].split()[3:]]
        measured = run['cycles'] - 10  # without the start-up cycles
        for column in range(5):
            self.assertEqual(sum(int(row[column + 1]) for row in bins) + overflows[column], measured)

    def test_no_histogram_in_virtual_time(self):
        result = self.run_program('--fast', '--no-lcm', '--histogram', self.folder / 'h.txt')
        self.assertEqual(result.returncode, 2)
        self.assertIn('--histogram', result.stderr)

    def test_durations_out_of_range(self):
        for duration in ('0', '-1', 'nan', '1e9'):
            self.assertEqual(self.run_program('latency', '--duration', duration).returncode, 2)

    def test_doctor(self):
        result = self.run_program('doctor', '--json')
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads(result.stdout)
        self.assertTrue(report['well'])
        checks = {finding['check'] for finding in report['findings']}
        self.assertEqual(checks, {'kernel', 'realtime', 'clock', 'cpu', 'lcm', 'can', 'boards', 'backend', 'hm2'})

    def test_doctor_of_a_rig_without_board(self):
        result = self.run_program('doctor', '--backend', 'rig', '--only', 'backend')
        self.assertEqual(result.returncode, 3)
        self.assertIn('FAIL', result.stdout)

    def test_doctor_checks_its_arguments(self):
        self.assertEqual(self.run_program('doctor', '--only', 'weather').returncode, 2)
        self.assertEqual(self.run_program('doctor', '--set', 'realtime.priority=99').returncode, 2)


if __name__ == '__main__':
    unittest.main()
