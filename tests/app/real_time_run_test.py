"""Runs in real time without LCM: asserts the outcome, never the computer's timing."""
import signal
import subprocess
import time
import unittest

from program import PATIENT, PROGRAM, ProgramTest


class RealTimeRun(ProgramTest):
    def test_braking_at_once(self):
        summary = self.folder / 'summary.json'
        result = self.patient('--no-lcm', '--set', 'experiment.start_speed_rad_s=60', '--summary', summary)
        self.assertEqual(result.returncode, 0, result.stderr)
        s = self.summary(summary)
        self.assertEqual(s['result'], 'completed')
        self.assertEqual(s['telemetry_drops'], 0)
        self.assertGreater(s['wakeup_latency_us']['p50'], 0)
        self.assertGreaterEqual(s['cycle_time_us']['max'], s['cycle_time_us']['p50'])

    def stopped_by(self, number):
        csv, summary = self.folder / 'run.csv', self.folder / 'summary.json'
        program = subprocess.Popen([PROGRAM, *PATIENT, '--no-lcm', '--csv', csv, '--summary', summary],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        time.sleep(1.0)  # well within the acceleration
        program.send_signal(number)
        _, errors = program.communicate(timeout=20)
        rows = self.rows(csv)
        self.assertGreater(max(float(row['motor_pwm']) for row in rows), 0.9, 'the motor was on')
        self.assertEqual((rows[-1]['phase'], float(rows[-1]['motor_pwm']), rows[-1]['motor_enable']),
                         ('stopped', 0.0, '0'))
        self.assertEqual(self.summary(summary)['result'], 'stopped')
        return program.returncode, errors

    def test_signals_stop_safely(self):
        for number, status, word in ((signal.SIGINT, 130, 'SIGINT'), (signal.SIGTERM, 143, 'SIGTERM')):
            with self.subTest(signal=number):
                returned, errors = self.stopped_by(number)
                self.assertEqual(returned, status)
                self.assertIn(word, errors)


if __name__ == '__main__':
    unittest.main()
