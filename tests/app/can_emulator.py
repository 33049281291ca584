"""The emulated CAN node as a process of its own, behind a socket in place of a bus, for the tests of driver.kind=can."""
import subprocess
import sys

from emulator_process import EMULATOR, EmulatorProcess
from program import PROGRAM, ProgramTest


def skip_unless_possible():
    if not EMULATOR.exists():
        print(f'SKIPPED: {EMULATOR} was not built (libfuse3-dev)')
        sys.exit(77)


class Node(EmulatorProcess):
    """A running abs_rig_emulator --can."""

    def __init__(self, folder, *args):
        self.interface = f'unix:{folder / "bus"}'
        super().__init__(folder, '--can', self.interface, *args)


class CanTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self._nodes = []
        self._programs = []

    def tearDown(self):
        for program in self._programs:
            if program.poll() is None:
                program.kill()
                program.communicate()
        for node in self._nodes:
            node.kill()
        super().tearDown()

    def node(self, *args):
        folder = self.folder / str(len(self._nodes))
        folder.mkdir()
        self._nodes.append(Node(folder, *args))
        return self._nodes[-1]

    def arguments(self, node, *args):
        return ['--backend', 'rig', '--no-lcm', '--no-out', '--set', 'driver.kind=can', '--set',
                f'driver.can.interface={node.interface}', *map(str, args)]

    def lock_step(self, node, *args):
        return self.run_program(*self.arguments(node, '--fast', '--set', 'driver.emulated=true', *args))

    def real_time(self, node, *args):
        # A guardian that is patient with this computer's own pauses.
        patient = self.arguments(node, '--set', 'guardian.timeout_ms=1000', *args)
        self._programs.append(subprocess.Popen([PROGRAM, *patient], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                               text=True))
        return self._programs[-1]
