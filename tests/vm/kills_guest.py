"""Within the virtual machine, in virtual time: abs_hil on the emulated card, both in the guest. In each phase of an
experiment the controller is killed, stopped, or crashes (in more than 100 tries while something is driven), then its
guardian: both PWM widths are 0 at the card, by its own clock, within 50 ms. Last, what it must find too late and held
is planted.

usage: kills_guest.py ABS_HIL
"""
import csv
import ctypes
import json
import math
import os
import pathlib
import random
import re
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import typing

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / 'app'))
from program import PROGRAM  # noqa: E402
from rig_emulator import Emulator  # noqa: E402

BOUND_MS = 50
# A register access over FUSE takes 0.07 ms here: twelve of them and the plant leave 1 kHz no time to spare.
RATE_HZ = 500
PHASES = ('idle', 'accelerate', 'coast', 'brake', 'hold')
# A process' end is told once the kernel has taken its memory apart, which may take longer than the timeout: then it has
# given no sign of life.
CONTROLLER_ENDED, GUARDIAN_ENDED = {162, 163}, {160, 161}
# name: (signal, a core dump is written, reasons that the guardian may give)
WAYS = {'SIGKILL': (signal.SIGKILL, False, CONTROLLER_ENDED),
        'SIGSTOP': (signal.SIGSTOP, False, {163}),
        'SIGSEGV': (signal.SIGSEGV, False, CONTROLLER_ENDED),
        'SIGSEGV, core dump': (signal.SIGSEGV, True, CONTROLLER_ENDED)}
TRIES = {'idle': 2, 'accelerate': 9, 'coast': 2, 'brake': 9, 'hold': 9}  # in each way; idle and coast drive nothing
GUARDIAN_TRIES = dict.fromkeys(PHASES, 1)
GUARDIAN_WAYS = {'SIGKILL': (signal.SIGKILL, GUARDIAN_ENDED), 'SIGSEGV': (signal.SIGSEGV, GUARDIAN_ENDED),
                 'SIGSTOP': (signal.SIGSTOP, {161})}
GUARDIAN_WORDS = {160: 'the guardian process died', 161: 'the guardian process gave no sign of life'}
END_SPEED_RAD_S = 3.0
PLANT = ('plant.slip_regularisation_m_s=0.1',)  # not stiff at rest: ten times fewer steps for the emulator
# Each phase is long enough to be hit and no longer.
EXPERIMENT = ('experiment.idle_s=0.08', 'experiment.cut_speed_rad_s=5', 'experiment.coast_s=0.06',
              f'experiment.end_speed_m_s={0.0995 * END_SPEED_RAD_S}', 'experiment.hold_torque_Nm=0.3')
PR_SET_CHILD_SUBREAPER = 36
jitter = random.Random(7)


def settings(assignments):
    return [word for assignment in assignments for word in ('--set', assignment)]


class Try:
    """A fresh emulator and a controller on it."""

    def __init__(self, *assignments):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.emulator = Emulator(self.folder, *settings(PLANT))
        self.program = subprocess.Popen(
            [PROGRAM, '--backend', 'rig', '--no-lcm', '--no-out', '--rt', 'require', '--rate', str(RATE_HZ),
             '--recorder', self.folder / 'record', '--summary', self.folder / 'run.json',
             *settings((f'driver.pci.root={self.emulator.root}', *EXPERIMENT, *assignments))],
            cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.program.poll() is None:
            self.program.kill()
            self.program.communicate()
        self.emulator.end()
        shutil.rmtree(self.folder)

    def wait_until(self, condition, what):
        while not condition():
            if self.program.poll() is not None:
                raise AssertionError(f'ended before {what}: {self.program.communicate()[1][-1500:]}')
            time.sleep(0.003)

    def wait_for(self, phase):
        """Until a random moment early in that phase, which is known by what acts at the card."""
        writes = set()
        self.wait_until(lambda: writes.add(self.emulator.widths().last_written_ns) or len(writes) > 4, 'a cycle')
        if phase != 'idle':
            self.wait_until(lambda: self.emulator.widths().drive > 0, 'it accelerated')
        if phase not in ('idle', 'accelerate'):
            self.wait_until(lambda: self.emulator.widths().drive == 0, 'it coasted')
        if phase in ('brake', 'hold'):
            self.wait_until(lambda: self.emulator.widths().brake > 0, 'it braked')
        if phase == 'hold':
            self.wait_until(lambda: self.emulator.lower_speed() < END_SPEED_RAD_S - 0.2, 'it held')
        time.sleep(jitter.uniform(0, 0.02))

    def guardian(self):
        children = pathlib.Path(f'/proc/{self.program.pid}/task/{self.program.pid}/children').read_text().split()
        assert len(children) == 1, children
        return int(children[0])

    def recorded_phase(self):
        with open(next((self.folder / 'record').glob('*.csv')), newline='') as file:
            return list(csv.DictReader(file))[-1]['phase']


class Times(typing.NamedTuple):
    """After the signal, by the card's clock."""
    zero_ms: float  # 0: nothing was driven
    last_write_ms: float

    @staticmethod
    def at(emulator, signal_ns):
        """Times and what is wrong with them."""
        widths = emulator.widths()
        if widths.zero_since_ns is None:
            return None, [f'the card holds drive {widths.drive}, brake {widths.brake}']
        times = Times(max(0, widths.zero_since_ns - signal_ns) * 1e-6, (widths.last_written_ns - signal_ns) * 1e-6)
        problems = [] if times.zero_ms <= BOUND_MS else [f'both 0 after {times.zero_ms:.3f} ms']
        return times, problems if times.last_write_ms > 0 else [*problems, 'nobody wrote the safe state']


def end_controller(way, phase, *assignments, guardian_too=False):
    """Returns (times, problems)."""
    number, dumps_core, reasons = WAYS[way]
    with Try(*assignments) as run:
        core_bytes = resource.RLIM_INFINITY if dumps_core else 0
        resource.prlimit(run.program.pid, resource.RLIMIT_CORE, (core_bytes, resource.RLIM_INFINITY))
        run.wait_for(phase)
        if guardian_too:
            os.kill(run.guardian(), signal.SIGKILL)
        before_ns = time.monotonic_ns()
        run.program.send_signal(number)
        _, said = run.program.communicate()  # to the end of the guardian, which holds the other end of stderr
        times, problems = Times.at(run.emulator, before_ns)
        if guardian_too:
            return times, problems
        found = re.search(r'\(reason (\d+), process', said)
        if not found or int(found[1]) not in reasons or 'drive 0 and brake 0 written and read back' not in said:
            problems.append(f'the guardian said {said[-600:]!r}')
        if (ended := run.program.returncode) not in ((-9, -11) if dumps_core else (-9,) if number != signal.SIGSEGV
                                                     else (-11,)):
            problems.append(f'the controller ended with {ended}')
        if run.recorded_phase() != phase:
            problems.append(f'it was in {run.recorded_phase()}')
        return times, problems


def end_guardian(way, phase):
    number, reasons = GUARDIAN_WAYS[way]
    with Try() as run:
        run.wait_for(phase)
        guardian = run.guardian()
        before_ns = time.monotonic_ns()
        os.kill(guardian, number)
        _, said = run.program.communicate()
        times, problems = Times.at(run.emulator, before_ns)
        summary = json.loads((run.folder / 'run.json').read_text())
        told = any(GUARDIAN_WORDS[reason] in summary['reason'] for reason in reasons)
        if run.program.returncode != 1 or summary['result'] != 'fault' or not told:
            problems.append(f'status {run.program.returncode}, {summary["result"]}, {summary["reason"]}: {said[-600:]}')
        if pathlib.Path(f'/proc/{guardian}').exists():
            problems.append('the guardian is still there')
        return times, problems


def series(title, ways, tries, end):
    """Prints the distributions; returns (number of tries in which something was driven, problems)."""
    print(f'{title}: ms from the signal until both widths are 0 at the card, 0 where nothing was driven, and until '
          'they were last written\n' + ' ' * 33 + 'tries     min  median     max   last write', flush=True)
    driven, problems = 0, []
    for way in ways:
        for phase in PHASES:
            all_times = []
            for _ in range(tries[phase]):
                times, found = end(way, phase)
                all_times += [times] if times else []
                problems += [f'{title}, {way}, {phase}: {problem}' for problem in found]
            driven += sum(times.zero_ms > 0 for times in all_times)
            zero_ms = [times.zero_ms for times in all_times] or [math.nan]
            last_ms = max((times.last_write_ms for times in all_times), default=math.nan)
            print(f'{way:<20}{phase:<12} {len(all_times):>5} {min(zero_ms):>7.2f} {statistics.median(zero_ms):>7.2f} '
                  f'{max(zero_ms):>7.2f} {last_ms:>12.2f}', flush=True)
    return driven, problems


def main():
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    pathlib.Path('/proc/sys/kernel/sched_rt_runtime_us').write_text('-1')  # emulator, guardian and cycle on one CPU
    controllers, problems = series('controller', WAYS, TRIES, end_controller)
    guardians, more = series('guardian first', GUARDIAN_WAYS, GUARDIAN_TRIES, end_guardian)
    problems += more
    _, late = end_controller('SIGSTOP', 'accelerate', 'guardian.timeout_ms=100')
    _, held = end_controller('SIGKILL', 'brake', guardian_too=True)
    print(f'planted: a timeout of 100 ms: {"; ".join(late)}; killed with its guardian: {"; ".join(held)}')
    if 'both 0 after' not in ' '.join(late) or 'the card holds' not in ' '.join(held):
        problems.append(f'what was planted was not found: {late}, {held}')
    if controllers < 100 or guardians < 9:
        problems.append(f'something was driven in {controllers} and {guardians} tries only')
    print('\n'.join(problems) or f'each within {BOUND_MS} ms; in {controllers} + {guardians} something was driven')
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
