"""The paper's experiment and the faults of hm2_run_test.py through driver.kind=hm2, against the core of the node's firmware
(docs/node.md) in another process. The node latches a bite, which no 7I92T does: a host that goes on stays without outputs."""
import unittest

import hm2_run_test
from can_emulator import skip_unless_possible
from emulator_process import EmulatorProcess


class Node(EmulatorProcess):
    """A running abs_rig_emulator --node."""

    def __init__(self, folder, *args):
        self.address = f'127.0.0.1:{hm2_run_test.free_port()}'
        super().__init__(folder, '--node', self.address, *args)


class NodeRun(hm2_run_test.Hm2Run):
    BOARD = Node
    #: Its counters have no bit for a quadrature error.
    FAULTS = [fault for fault in hm2_run_test.Hm2Run.FAULTS if not fault[0].startswith('quadrature-error')]

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


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
