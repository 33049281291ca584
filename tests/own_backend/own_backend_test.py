"""examples/own_backend against a board on a pty: it is listed, it needs a commissioning, it runs an experiment, and its
guardian ends its outputs.

usage: own_backend_test.py MY_ABS_HIL BOARD_ON_PTY
"""
import json
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM, BOARD = sys.argv[1:3]


class Board:
    """The board; with a watchdog of its own if `watchdog_ms` is not 0."""

    def __init__(self, folder, watchdog_ms=0):
        self.port, self.log = folder / 'port', folder / 'widths'
        with self.log.open('w') as log:
            self.process = subprocess.Popen([BOARD, self.port, str(watchdog_ms)], stdin=subprocess.PIPE, text=True,
                                            stdout=log)
        self.wait_for('ready')

    def wait_for(self, pattern):
        """The last line that matches, once there is one."""
        end = time.monotonic() + 20
        while time.monotonic() < end:
            found = [line for line in self.log.read_text().splitlines() if re.match(pattern, line)]
            if found:
                return found[-1]
            time.sleep(0.01)
        raise AssertionError(f'no line {pattern}: {self.log.read_text()}')

    def widths(self):
        lines = [line for line in self.log.read_text().splitlines() if line.startswith('widths')]
        return tuple(map(int, lines[-1].split()[1:3])) if lines else (0, 0)

    def turn(self, wheel):
        self.process.stdin.write(f'turn {wheel}\n')
        self.process.stdin.flush()

    def end(self):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()


class OwnBackend(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def board(self, watchdog_ms=0):
        board = Board(self.folder, watchdog_ms)
        self.addCleanup(board.end)
        return board

    def options(self, board, *more):
        # The board and the program share this computer with whatever else runs: neither may mind its pauses.
        settings = ['driver.serial.answer_timeout_ms=200', 'guardian.timeout_ms=1000', 'guardian.insist_s=5',
                    'unsafe.outputs_on_after_death=true', 'unsafe.keys=guardian.insist_s,driver.records',
                    'gate.sample_age_max_s=0.5', 'unsafe.blind_control=true',
                    'driver.kind=serial', f'driver.serial.port={board.port}', f'driver.records={self.folder}/records',
                    *more]
        return [word for setting in settings for word in ('--set', setting)]

    def run_command(self, board, *args):
        return [PROGRAM, '--backend', 'rig', '--no-lcm', '--no-out', '--rate', '100', '--rt', 'prefer',
                '--recorder', self.folder, *self.options(board), *args]

    def commission(self, board):
        said = ''
        with subprocess.Popen([PROGRAM, 'commission', *self.options(board)], stdin=subprocess.PIPE, text=True, bufsize=1,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as program:
            for line in program.stdout:
                said += line
                for wheel in ('upper', 'lower'):
                    if f'Turn the {wheel.upper()} wheel' in line:
                        time.sleep(0.1)
                        board.turn(wheel)
                        time.sleep(0.2)
                        program.stdin.write('\n')
                if '[y/N]' in line:
                    program.stdin.write('y\n')
        return program.returncode, said

    def test_it_is_listed_with_its_keys(self):
        listed = subprocess.run([PROGRAM, 'list'], capture_output=True, text=True, check=True).stdout
        self.assertRegex(listed, r'(?m)^  serial +a board on a serial line')
        keys = subprocess.run([PROGRAM, 'list', '--keys'], capture_output=True, text=True, check=True).stdout
        self.assertRegex(keys, r'(?m)^driver\.serial\.brake_duty_max +0\.7')

    def test_without_a_record_nothing_drives_it(self):
        board = self.board()
        result = subprocess.run(self.run_command(board), capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 3, result.stderr)
        self.assertIn('has not been commissioned', result.stderr)
        self.assertIn(f'Type: abs_hil commission --set driver.kind=serial', result.stderr)
        self.assertEqual(board.log.read_text(), 'ready\n', 'no width was written')

    def test_commissioned_it_runs_and_its_guardian_ends_it(self):
        board = self.board()
        status, said = self.commission(board)
        self.assertEqual(status, 0, said)
        self.assertIn('the board HOLDS its outputs', said)
        record = json.loads(next((self.folder / 'records').glob('serial-*.json')).read_text())
        self.assertEqual((record['place'], record['logic'], record['outputs']['watchdog_ms']),
                         ('A-17', 'firmware 3', None))
        # Killed while it drives: the board holds, the guardian ends it.
        program = subprocess.Popen(self.run_command(board), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        board.wait_for('widths 255 0')
        time.sleep(0.3)
        program.send_signal(signal.SIGKILL)
        killed_ms = time.monotonic() * 1e3
        end = time.monotonic() + 20
        while board.widths() != (0, 0) and time.monotonic() < end:
            time.sleep(0.001)
        self.assertEqual(board.widths(), (0, 0), 'the guardian has ended the outputs')
        print('both 0 %.1f ms after SIGKILL' % (float(board.wait_for('widths 0 0').split()[-1]) - killed_ms))
        self.assertIn('written and read back', program.communicate(timeout=20)[1])
        # The whole experiment.
        result = subprocess.run(self.run_command(board, '--summary', self.folder / 'summary.json'), capture_output=True,
                                text=True, timeout=60)
        self.assertIn('not verified on hardware. This is an example', result.stderr)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(json.loads((self.folder / 'summary.json').read_text())['result'], 'completed')
        self.assertEqual(board.widths(), (0, 0))

    def test_a_watchdog_of_the_board_is_measured(self):
        board = self.board(watchdog_ms=50)
        status, said = self.commission(board)
        self.assertEqual(status, 0, said)
        self.assertRegex(said, r'the board ends its outputs by itself after \d')

    def test_safe_ends_the_run_and_its_outputs(self):
        board = self.board()
        self.assertEqual(self.commission(board)[0], 0)
        errors = self.folder / 'errors'
        with errors.open('w') as stderr:
            program = subprocess.Popen(self.run_command(board), stdout=subprocess.DEVNULL, stderr=stderr)
        board.wait_for('widths 255 0')
        result = subprocess.run([PROGRAM, 'safe', *self.options(board)], capture_output=True, text=True, timeout=60)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('drive 0 and brake 0, verified', result.stdout)
        self.assertIn('; ended process', result.stdout)
        # 1: before the signal came, the run found that something else writes to the board.
        self.assertIn(program.wait(timeout=20), (1, 143, -signal.SIGKILL), errors.read_text())
        self.assertEqual(board.widths(), (0, 0))


if __name__ == '__main__':
    unittest.main(argv=sys.argv[:1])
