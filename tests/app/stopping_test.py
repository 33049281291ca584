"""Signals, closed terminals and broken pipes, for a run in real time on the simulated rig."""
import os
import pty
import signal
import subprocess
import sys
import time
import unittest

from program import PATIENT, PROGRAM, ProgramTest

SIGNALS = ((signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129))


class Stopping(ProgramTest):
    def start(self, *args, patience=PATIENT, **streams):
        """A run that accelerates; returns once the CSV shows that the motor is on."""
        self.csv, self.summary_file = self.folder / 'run.csv', self.folder / 'summary.json'
        self.csv.unlink(missing_ok=True)
        streams = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE, **streams}
        program = subprocess.Popen([os.path.abspath(PROGRAM), *patience, '--no-lcm', '--csv', self.csv, '--summary',
                                    self.summary_file, *map(str, args)], **streams)
        self.addCleanup(self.end, program)
        deadline = time.monotonic() + 30
        while not self.csv.exists() or b',1,1,' not in self.csv.read_bytes()[-3000:]:
            self.assertLess(time.monotonic(), deadline, 'the motor was never switched on')
            self.assertIsNone(program.poll(), 'it ended by itself')
            time.sleep(0.02)
        return program

    def wait_for_speed(self, program, omega2_rad_s):
        deadline, seen = time.monotonic() + 20, 0.0
        while seen < omega2_rad_s:
            self.assertLess(time.monotonic(), deadline, f'no more than {seen} rad/s')
            self.assertIsNone(program.poll(), 'it ended by itself')
            time.sleep(0.02)
            head, *rows = self.csv.read_text().split('\n')[:-1]  # complete rows
            seen = float(rows[-1].split(',')[head.split(',').index('omega2_rad_s')])

    def end(self, program):
        if program.poll() is None:
            program.kill()
        program.communicate()

    def assert_stopped_in_order(self, program, status):
        program.communicate(timeout=30)
        self.assertEqual(program.returncode, status)
        last = self.rows(self.csv)[-1]
        self.assertEqual((last['phase'], float(last['motor_pwm']), float(last['brake_pwm'])), ('stopped', 0.0, 0.0))
        self.assertEqual(self.summary(self.summary_file)['result'], 'stopped')

    def test_second_signal_stops_at_once(self):
        for number, status in SIGNALS:
            with self.subTest(number.name):
                # The first one brakes for a minute: wheels without a brake turn for longer.
                program = self.start('--set', 'experiment.stop_brake_duty=0.01', '--set',
                                     'experiment.stop_brake_limit_s=60')
                self.wait_for_speed(program, 20.0)  # at standstill the brake would not act
                program.send_signal(signal.SIGINT)
                deadline = time.monotonic() + 20
                while b',hold,' not in self.csv.read_bytes()[-3000:]:
                    self.assertLess(time.monotonic(), deadline, 'the first signal did nothing')
                    time.sleep(0.02)
                self.assertIsNone(program.poll())
                before = time.monotonic()
                program.send_signal(number)
                self.assertEqual(program.wait(timeout=20), status)
                self.assertLess(time.monotonic() - before, 10)

    def test_a_stalled_program_is_a_fault(self):
        program = self.start('--set', 'experiment.start_speed_rad_s=0', patience=())
        self.wait_for_speed(program, 60.0)
        program.send_signal(signal.SIGSTOP)
        time.sleep(0.6)
        program.send_signal(signal.SIGCONT)
        program.communicate(timeout=30)
        self.assertEqual(program.returncode, 1)
        summary = self.summary(self.summary_file)
        self.assertEqual(summary['result'], 'fault')
        self.assertIn('no cycle ran for longer than realtime.cycle_gap_max_s', summary['reason'])
        rows = self.rows(self.csv)
        after = [row for before, row in zip(rows, rows[1:]) if float(row['time_s']) - float(before['time_s']) > 0.3]
        self.assertEqual(len(after), 1)
        rest = rows[rows.index(after[0]):]
        self.assertLessEqual(len(rest), 2)
        self.assertEqual([float(rest[-1][name]) for name in ('motor_pwm', 'brake_pwm')], [0.0, 0.0])

    def test_brake_for_a_stop(self):
        program = self.start('--set', 'experiment.stop_brake_duty=0.6')
        self.wait_for_speed(program, 20.0)
        program.send_signal(signal.SIGTERM)
        self.assert_stopped_in_order(program, 143)
        braking = [row for row in self.rows(self.csv) if row['phase'] == 'hold']
        self.assertGreater(len(braking), 50)
        self.assertEqual({(row['motor_pwm'], row['brake_pwm']) for row in braking}, {('0', '0.6')})

    def test_closed_streams_and_broken_pipes_harm_nothing(self):
        read, write = os.pipe()
        os.close(read)  # the reader has closed its end
        for name, streams in (('broken pipes', {'stdout': write, 'stderr': write}),
                              ('closed', {'preexec_fn': lambda: [os.close(fd) for fd in (0, 1, 2)]})):
            with self.subTest(name):
                program = self.start(**streams)
                program.send_signal(signal.SIGPIPE)
                time.sleep(0.2)
                self.assertIsNone(program.poll())
                program.send_signal(signal.SIGINT)
                self.assert_stopped_in_order(program, 130)
        os.close(write)

    def test_terminal_that_goes_away(self):
        ours, theirs = pty.openpty()
        program = self.start(stdin=theirs, stdout=theirs, stderr=theirs, preexec_fn=lambda: take_terminal(theirs))
        os.close(theirs)
        os.close(ours)  # the kernel hangs up: SIGHUP, and every write fails
        self.assert_stopped_in_order(program, 129)

    def test_terminal_that_goes_away_under_nohup(self):
        ours, theirs = pty.openpty()
        program = self.start('--set', 'experiment.cut_speed_rad_s=40', stdin=theirs, stdout=theirs, stderr=theirs,
                             preexec_fn=lambda: take_terminal(theirs, ignore=True))
        os.close(theirs)
        os.close(ours)
        program.communicate(timeout=60)
        self.assertEqual(program.returncode, 0)
        self.assertEqual(self.summary(self.summary_file)['result'], 'completed')


def take_terminal(terminal, ignore=False):
    """Runs in the child: gives it its own session with this terminal."""
    import fcntl
    import termios
    os.setsid()
    fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)
    if ignore:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)


if __name__ == '__main__':
    unittest.main()
