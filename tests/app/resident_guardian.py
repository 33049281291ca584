"""abs_guardian serve beside an emulated card, and the ways in which a run can end or stop without a word."""
import contextlib
import os
import pathlib
import random
import re
import signal
import socket
import subprocess
import time

from program import PROGRAM
from rig_emulator import RigTest

GUARDIAN = pathlib.Path(PROGRAM).resolve().parent / 'abs_guardian'
SAFE = (0.0, 0.0)
CGROUPS = pathlib.Path('/sys/fs/cgroup/unified') if pathlib.Path('/sys/fs/cgroup/unified').is_dir() else \
    pathlib.Path('/sys/fs/cgroup')
# Short, with drive and brake on for most of the time.
EXPERIMENT = ('experiment.idle_s=0.02', 'experiment.cut_speed_rad_s=25', 'experiment.coast_s=0.02',
              'experiment.end_speed_m_s=1.5', 'experiment.hold_torque_Nm=0.3')
jitter = random.Random(19)


def settings(*assignments):
    return [word for assignment in assignments for word in ('--set', assignment)]


def wait_until(condition, what, seconds=20):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.002)


@contextlib.contextmanager
def not_held_up():
    """This process has the processor before others, where that is permitted; those that it starts have not."""
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    try:
        yield
    finally:
        with contextlib.suppress(PermissionError):
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


class Group:
    """A control group (version 2) of its own for a run."""

    def __init__(self, name):
        self.folder = CGROUPS / f'abs_hil_{name}_{os.getpid()}'
        self.folder.mkdir()

    def enter(self):
        """Called in the child, before it becomes the program."""
        (self.folder / 'cgroup.procs').write_text('0')

    def write(self, file, text):
        (self.folder / file).write_text(text)

    def remove(self):
        self.write('cgroup.kill', '1')

        def removed():
            """False while a process of the group is about to end."""
            with contextlib.suppress(OSError):
                self.folder.rmdir()
            return not self.folder.exists()
        wait_until(removed, 'the group is not empty')

    @staticmethod
    def why_not():
        try:
            group = Group('try')
        except OSError as error:
            return f'no control groups of version 2 here: {error}'
        there = (group.folder / 'cgroup.kill').exists() and (group.folder / 'cgroup.freeze').exists()
        group.folder.rmdir()
        return None if there else 'control groups without cgroup.kill and cgroup.freeze'


class Service:
    """A running abs_guardian serve."""

    def __init__(self, folder, *assignments):
        self.socket = folder / 'guardian.sock'
        self.log = folder / f'service-{len(list(folder.glob("service-*.log")))}.log'
        self.process = subprocess.Popen(
            [GUARDIAN, 'serve', '--socket', self.socket, *settings(*assignments)], stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=open(self.log, 'a'))  # noqa: SIM115
        wait_until(lambda: 'grants leases at' in self.said() or self.process.poll() is not None, 'no service')

    def companions(self):
        """Standby and talker."""
        return [int(pid) for pid in pathlib.Path(
            f'/proc/{self.process.pid}/task/{self.process.pid}/children').read_text().split()]

    def stop(self):
        """SIGSTOP to all of it: its standby would end a guard that stands still."""
        for process in (*self.companions(), self.process.pid):
            os.kill(process, signal.SIGSTOP)

    def said(self):
        return self.log.read_text()

    def end(self, number=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.process.wait(timeout=20)

    def children_left(self):
        """Processes that still write a flight record."""
        return [process for process in pathlib.Path('/proc').glob('[0-9]*')
                if os.fsencode(self.socket) in command_line(process)]


def command_line(process):
    try:
        return (process / 'cmdline').read_bytes().split(b'\0') if (process / 'exe').resolve() == GUARDIAN else []
    except OSError:
        return []


class ResidentTest(RigTest):
    timeout_ms = 500  # longer than a busy computer's pauses

    def setUp(self):
        super().setUp()
        self.services = []

    def tearDown(self):
        for service in self.services:
            service.end()
            wait_until(lambda service=service: not service.children_left(), 'a flight record is not finished')
        super().tearDown()

    def service(self, emulator, *assignments):
        # The stricter of the service's limits and the run's holds: on a busy computer both must be patient.
        self.services.append(Service(self.folder, f'driver.pci.root={emulator.root}',
                                     f'guardian.timeout_ms={self.timeout_ms}', *assignments))
        return self.services[-1]

    def command(self, emulator, *args, resident='require', experiment=EXPERIMENT):
        # Late cycles depend on this computer: they must not end a run here.
        return [str(word) for word in (
            pathlib.Path(PROGRAM).resolve(), '--backend', 'rig', '--no-lcm', '--no-out', '--recorder', self.folder,
            *settings(f'driver.pci.root={emulator.root}', f'guardian.resident={resident}',
                      f'guardian.socket={self.folder / "guardian.sock"}', f'guardian.timeout_ms={self.timeout_ms}',
                      'realtime.max_consecutive_overruns=0', 'realtime.late_max_s=1000', *experiment), *args)]

    def start(self, emulator, *args, before=(), enter=None, **kwargs):
        program = subprocess.Popen([*before, *self.command(emulator, *args, **kwargs)], cwd=self.folder,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=enter)
        self._programs.append(program)
        return program

    def wait_until_driven(self, emulator, program):
        """Until a random moment in which something is driven."""
        def driven():
            if program.poll() is not None:
                raise AssertionError(f'ended before it drove: {program.communicate()[1][-1500:]}')
            return emulator.wire() != SAFE
        wait_until(driven, 'nothing was driven')
        time.sleep(jitter.uniform(0, 0.3))

    def ms_until_zero(self, emulator, since_ns):
        """By the card's clock; 0 if nothing was driven at that moment."""
        wait_until(lambda: emulator.wire() == SAFE, 'the card holds its duties')
        return max(0, emulator.widths().zero_since_ns - since_ns) * 1e-6


def say_times(way, times):
    print(f'{way}: both PWMs 0 after (ms) ' + ' '.join(f'{t:.1f}' for t in sorted(times)) +
          f'; worst {max(times):.1f} of {len(times)}, driven {sum(t > 0 for t in times)}', flush=True)


def connect(path):
    client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    client.settimeout(10)
    client.connect(str(path))
    return client


def granted_and_ended(text):
    """What the service said about leases, in order."""
    return [(found[1], int(found[2])) for found in re.finditer(r'lease (granted to|ended:) process (\d+)', text)]
