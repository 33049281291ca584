"""The emulated CAN node as a process of its own, behind a socket in place of a bus, for the tests of driver.kind=can."""
import os
import re
import subprocess
import sys

from program import PROGRAM, ProgramTest

EMULATOR = os.path.join(os.path.dirname(PROGRAM), 'abs_rig_emulator')


def skip_unless_possible():
    if not os.path.exists(EMULATOR):
        print(f'SKIPPED: {EMULATOR} was not built (libfuse3-dev)')
        sys.exit(77)


class Node:
    """A running abs_rig_emulator --can; `command` returns its answer once it has been obeyed."""

    def __init__(self, folder, *args):
        self.interface, self.control = f'unix:{folder / "bus"}', folder / 'control'
        self.events = []
        self.process = subprocess.Popen([EMULATOR, '--can', self.interface, '--control', self.control, *map(str, args)],
                                        stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        while line and not line.startswith('ready'):  # "not in real time" may come before
            line = self.process.stdout.readline()
        assert line.startswith('ready'), 'the emulator did not start'

    def command(self, text):
        with open(self.control, 'w') as fifo:
            fifo.write(text + '\n')
        return self._line_that_starts_with(f'{text}: ')

    def _line_that_starts_with(self, start):
        for line in self.process.stdout:
            if line.startswith('event '):
                self.events.append(line.strip())
            elif line.startswith(start):
                return line
        raise AssertionError(f'the emulator ended without a line "{start}"')

    def wire(self):
        """Duties (drive, brake) that act on the rig now."""
        found = re.search(r'drive ([\d.]+), brake ([\d.]+)', self.command('status'))
        return float(found[1]), float(found[2])

    def end(self):
        if self.process.poll() is None:
            self.process.terminate()
            self._line_that_starts_with('ended')
        self.process.stdout.close()
        return self.process.wait(timeout=20)


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
            node.process.kill()
            node.process.wait()
            node.process.stdout.close()
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
