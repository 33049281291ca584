"""The emulated CAN node in its own process, behind a socket instead of a bus, for the tests of driver.kind=can."""
import sys

from emulator_process import EMULATOR, REAL_TIME, EmulatorProcess, EmulatorTest


def skip_unless_possible():
    if not EMULATOR.exists():
        print(f'SKIPPED: {EMULATOR} was not built (libfuse3-dev)')
        sys.exit(77)


class Node(EmulatorProcess):
    """A running abs_rig_emulator --can."""

    def __init__(self, folder, *args):
        self.interface = f'unix:{folder / "bus"}'
        super().__init__(folder, '--can', self.interface, *args)


class CanTest(EmulatorTest):
    def node(self, *args):
        return self.start_emulator(Node, *args)

    def arguments(self, node, *args):
        return ['--backend', 'rig', '--no-lcm', '--no-out', '--set', 'driver.kind=can', '--set',
                f'driver.can.interface={node.interface}', *map(str, args)]

    def lock_step(self, node, *args):
        return self.run_program(*self.arguments(node, '--fast', '--set', 'driver.emulated=true', *args))

    def real_time(self, node, *args):
        # This guardian tolerates this computer's pauses.
        return self.start_program(*self.arguments(node, *REAL_TIME, '--set', 'guardian.timeout_ms=1000', *args))
