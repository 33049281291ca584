"""The emulated rig in its own process, for the tests of --backend rig."""
import os
import re
import shutil
import subprocess
import sys
import time
import typing

from emulator_process import EMULATOR, REAL_TIME, EmulatorProcess, EmulatorTest


def why_not():
    """Why this computer cannot serve FUSE trees; None if it can."""
    if not EMULATOR.exists():
        return f'{EMULATOR} was not built (libfuse3-dev)'
    if not os.access('/dev/fuse', os.W_OK):
        return '/dev/fuse is not there or not writable (modprobe fuse)'
    if os.getuid() != 0 and not shutil.which('fusermount3'):
        return 'no fusermount3 (package fuse3)'
    return None


def skip_unless_possible():
    reason = why_not()
    if reason:
        print(f'SKIPPED: {reason}')
        sys.exit(77)


class Widths(typing.NamedTuple):
    """State of both PWMs; times in ns of CLOCK_MONOTONIC."""
    drive: int
    brake: int
    zero_since_ns: int | None  # None: at least one is not 0
    last_written_ns: int


class Emulator(EmulatorProcess):
    """A running abs_rig_emulator --pci-root."""

    def __init__(self, folder, *args):
        self.root, self.truth = folder / 'pci', folder / 'truth.csv'
        super().__init__(folder, '--pci-root', self.root, '--truth', self.truth, *args)

    def widths(self):
        """Both PWM width registers as the card reports them."""
        found = re.search(r'drive (\d+), brake (\d+), (?:not both 0|both 0 since (\d+) ns), last written at (\d+) ns',
                          self.command('widths'))
        return Widths(*(number and int(number) for number in found.groups()))

    def write_registers(self, *pairs):
        """What another process writes: offsets and values, through a descriptor of its own."""
        with open(next(self.root.glob('0000*')) / 'resource2', 'r+b', buffering=0) as registers:
            for offset, value in pairs:
                os.pwrite(registers.fileno(), value.to_bytes(4, 'little'), offset)

    def lower_speed(self):
        return float(self.command('status').split('lower ')[1].split()[0])

    def turn(self, wheel, revolutions):
        """Turns a wheel as by hand: over some time, because the driver accepts no faster change."""
        start = self.time_s()
        while self.time_s() < start + 0.02:
            pass
        self.command(f'turn {wheel} {revolutions}')

    def kill_and_leave_mount(self):
        """As SIGKILL leaves it: every access below `root` fails with ENOTCONN."""
        super().kill()

    def kill(self):
        self.kill_and_leave_mount()
        subprocess.run(['umount', '-l', self.root], stderr=subprocess.DEVNULL)


class RigTest(EmulatorTest):
    def go_through_commissioning(self, program, emulator, answer=lambda question: 'y'):
        """Plays the person of `abs_hil commission`: answers the questions and turns the wheels. Returns what the program
        said. While it asks, both outputs must be 0."""
        said = ''
        while line := program.stdout.readline():
            said += line
            if '[y/N]' in line:
                self.assertEqual(emulator.wire(), (0.0, 0.0), f'while it asks: {line}')
                program.stdin.write(answer(line) + '\n')
            elif line.startswith('Turn the '):
                emulator.turn('upper' if 'UPPER' in line else 'lower', 1)
                program.stdin.write('\n')
        return said

    def emulator(self, *args):
        return self.start_emulator(Emulator, *args)

    def lock_step(self, emulator, *args):
        return self.run_program('--backend', 'rig', '--fast', '--no-lcm', '--set', 'driver.emulated=true', '--set',
                                f'driver.pci.root={emulator.root}', *args)

    def real_time(self, emulator, *args, guardian_timeout_ms=1000):
        """A guardian that tolerates this computer's pauses: it must not end a run that only waits for the processor."""
        return self.start_program('--backend', 'rig', '--no-lcm', *REAL_TIME, '--set', f'driver.pci.root={emulator.root}', '--set',
                                  f'guardian.timeout_ms={guardian_timeout_ms}', *args)

    def wait_until_driving(self, emulator):
        deadline = time.monotonic() + 20
        # A turning wheel is needed too: an overspeed latched at standstill would be released at once.
        while emulator.wire()[0] < 0.9 or emulator.lower_speed() < 5:
            self.assertLess(time.monotonic(), deadline, 'the drive was never switched on')
