"""The paper's experiment and the faults of hm2_run_test.py through driver.kind=hm2, against the core of the node's firmware
(docs/node.md) in another process. The node latches a bite, which no 7I92T does: a host that goes on stays without outputs."""
import pathlib
import subprocess
import threading
import time
import unittest

import hm2_run_test
from can_emulator import skip_unless_possible
from emulator_process import EMULATOR, EmulatorProcess
from program import PROGRAM


class Node(EmulatorProcess):
    """A running abs_rig_emulator --node."""

    def __init__(self, folder, *args):
        self.address = f'127.0.0.1:{hm2_run_test.free_port()}'
        super().__init__(folder, '--node', self.address, *args)


class NodeRun(hm2_run_test.Hm2Run):
    BOARD = Node
    #: Its counters have no bit for a quadrature error.
    FAULTS = [fault for fault in hm2_run_test.Hm2Run.FAULTS if not fault[0].startswith('quadrature-error')]

    def test_the_emulator_refuses_what_cannot_be(self):
        address = f'127.0.0.1:{hm2_run_test.free_port()}'
        for words, status, why in (
                (('--node', ''), 2, '--node need a value'), (('--node', address, '--enable-line', 99), 2, 'output 0 alone'),
                (('--node', address, '--wrong-board', '0x100=0'), 2, 'give --hm2'),
                (('--node', address, '--command', 'turn upper nan'), 2, 'not a finite number'),
                (('--node', address, '--command', 'turn upper 1e300'), 2, '-100 to 100'),
                (('--hm2', address, '--truth', '/dev/full'), 1, 'incomplete')):
            with self.subTest(words):
                run = subprocess.run(['timeout', '--preserve-status', '-s', 'INT', '2', EMULATOR, *map(str, words)],
                                     capture_output=True, text=True)
                self.assertEqual(run.returncode, status)
                self.assertIn(why, run.stderr)
                if status == 1:
                    self.assertIn('pins pulled high', run.stdout)

    def test_a_bite_is_latched_until_the_next_activation(self):
        board = self.board()
        program = self.start_real_time(board)
        self.wait_for_drive(board, program)
        board.command('bite')
        board.command('talker drive')  # a program that has not noticed: values and reloads
        program.communicate(timeout=120)
        self.assertEqual(program.returncode, 1)
        for _ in range(20):
            status = board.command('status')
            self.assertRegex(status, r'drive 0\.0000, brake 0\.0000.*watchdog has bitten')
        board.command('talker off')
        again = self.start_real_time(board)
        self.wait_for_drive(board, again)
        again.kill()
        again.communicate()

    def test_commission_goes_through_all_steps_with_the_cable_pulled(self):
        board = self.board()
        # Before other programs: a computer under load pauses it for longer than the watchdog's time.
        first = ['chrt', '-f', '50']
        if subprocess.run([*first, 'true'], stderr=subprocess.DEVNULL).returncode != 0:
            first = []
        program = subprocess.Popen(
            [*first, pathlib.Path(PROGRAM).resolve(), 'commission', '--set', 'driver.kind=hm2', '--set', f'driver.hm2.address={board.address}', '--set',
             'guardian.timeout_ms=1000', '--set', f'driver.records={self.folder}/records'],
            cwd=self.folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1)
        self._programs.append(program)
        pulls = []

        def pull():
            time.sleep(0.2)
            board.command('link down')
            time.sleep(0.5)
            pulls.append(board.wire())
            board.command('link up')

        said = ''
        while line := program.stdout.readline():
            said += line
            if '[y/N]' in line:
                for thread in threading.enumerate():
                    if thread is not threading.current_thread():
                        thread.join()
                self.assertEqual(board.wire(), (0.0, 0.0), f'while it asks: {line}')
                program.stdin.write('y\n')
            elif line.startswith('Turn the '):
                wheel = 'upper' if 'UPPER' in line else 'lower'
                for _ in range(20):
                    board.command(f'turn {wheel} 0.05')
                    time.sleep(0.01)
                program.stdin.write('\n')
            elif line.startswith('Pull the '):
                threading.Thread(target=pull).start()
        program.wait(timeout=20)
        self.assertEqual(program.returncode, 0, said)
        self.assertIn('All steps passed', said)
        self.assertEqual(pulls, [(0.0, 0.0)])


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
