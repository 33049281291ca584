"""Within the virtual machine, in virtual time, with systemd as the first process: the resident guardian as the packaged
unit runs it, abs_hil in scopes of its own, the emulated card beside both. What ends or stops a whole run, 50 times
each in random phases: both PWM widths are 0 at the card, by its own clock, within 50 ms.

usage: resident_guest.py ABS_HIL [TRIES]
"""
import csv
import os
import pathlib
import random
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / 'app'))
TRIES = int(sys.argv.pop(2)) if len(sys.argv) > 2 else 50
from program import PROGRAM  # noqa: E402
from rig_emulator import Emulator  # noqa: E402

BOUND_MS = 50
RATE_HZ = 500  # as in kills_guest.py
SERVICE = 'abs-guardian.service'
ROOT = pathlib.Path(__file__).resolve().parents[2]
CGROUPS = pathlib.Path('/sys/fs/cgroup')
PLANT = ('plant.slip_regularisation_m_s=0.1',)  # not stiff at rest: ten times fewer steps for the emulator
EXPERIMENT = ('experiment.idle_s=0.02', 'experiment.coast_s=0.02',
              'experiment.end_speed_m_s=0.3', 'experiment.hold_torque_Nm=0.3')
jitter = random.Random(19)


def settings(assignments):
    return [word for assignment in assignments for word in ('--set', assignment)]


def run(*command, check=True):
    return subprocess.run(command, check=check, capture_output=True, text=True)


def install(card):
    """What the package installs: the programs, the unit and its configuration."""
    for name in ('abs_hil', 'abs_hil_program', 'abs_guardian'):
        pathlib.Path('/usr/local/bin', name).symlink_to(pathlib.Path(PROGRAM).resolve().parent / name)
    shutil.copytree(ROOT / 'packaging/systemd', '/etc/systemd/system', symlinks=True, dirs_exist_ok=True)
    pathlib.Path('/etc/abs_hil').mkdir()
    pathlib.Path('/etc/abs_hil/guardian.toml').write_text(
        (ROOT / 'packaging/guardian.toml').read_text() + f'root = "{card}"\n')
    run('addgroup', '--system', 'abs_hil')
    run('systemctl', 'daemon-reload')
    run('systemctl', 'start', 'systemd-logind')
    run('systemctl', 'start', SERVICE)  # Type=notify: returns once it grants leases


def journal():
    return run('journalctl', '--no-pager', '--output=cat', '--unit', SERVICE).stdout


class Run:
    """abs_hil in a scope of its own."""
    number = 0

    def __init__(self, emulator, *before, cut_speed_rad_s=10):
        Run.number += 1
        self.emulator = emulator
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.scope = f'run-{Run.number}.scope'
        self.process = subprocess.Popen(
            ['systemd-run', '--scope', '--quiet', '--collect', f'--unit={self.scope}', *before, PROGRAM, '--backend',
             'rig', '--no-lcm', '--no-out', '--rt', 'require', '--rate', str(RATE_HZ), '--recorder', self.folder,
             *settings((f'driver.pci.root={emulator.root}', 'guardian.resident=require', *EXPERIMENT,
                         f'experiment.cut_speed_rad_s={cut_speed_rad_s}'))],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def group(self):
        return CGROUPS / 'system.slice' / self.scope

    def processes(self):
        try:
            return [int(pid) for pid in (self.group() / 'cgroup.procs').read_text().split()]
        except FileNotFoundError:
            return []  # the run has ended, and its scope with it

    def wait_until_driven(self):
        while True:
            widths = self.emulator.widths()
            if widths.drive > 0 or widths.brake > 0:
                break
            if self.process.poll() is not None:
                raise AssertionError(f'ended before it drove: {self.process.communicate()[1][-1500:]}')
            time.sleep(0.003)
        time.sleep(jitter.uniform(0, 0.08))

    def last_cycle_ns(self):
        """When the run's last recorded cycle began, by its flight record."""
        deadline = time.monotonic() + 20
        while not (files := list(self.folder.glob('*.txt'))):  # written after the CSV
            assert time.monotonic() < deadline, 'no flight record'
            time.sleep(0.02)
        with open(next(self.folder.glob('*.csv')), newline='') as file:
            last = list(csv.DictReader(file))[-1]
        del files
        return int(last['stamp_ns'])

    def end(self):
        subprocess.run(['systemctl', 'kill', '--signal=SIGKILL', self.scope], capture_output=True)
        said = self.process.communicate()[1]
        shutil.rmtree(self.folder, ignore_errors=True)
        return said


def kill_scope(run_):
    (run_.group() / 'cgroup.kill').write_text('1')


def systemctl_kill(run_):
    run('systemctl', 'kill', '--signal=SIGKILL', run_.scope)


def freeze(run_):
    (run_.group() / 'cgroup.freeze').write_text('1')


def kill_each(run_):
    for pid in run_.processes():
        os.kill(pid, signal.SIGKILL)


def end_namespace(run_):
    first = pathlib.Path(f'/proc/{run_.process.pid}/task/{run_.process.pid}/children').read_text().split()
    os.kill(int(first[0]), signal.SIGKILL)


def out_of_memory(run_):
    (run_.group() / 'memory.max').write_text('0')


NAMESPACE = ('unshare', '--pid', '--fork', '--mount-proc')
# name: (what ends the run, what it is started with, since when: the moment before, or the last cycle where the way
# itself takes time before it reaches the run)
WAYS = {'cgroup.kill of the scope': (kill_scope, (), 'moment'),
        'systemctl kill': (systemctl_kill, (), 'cycle'),
        'cgroup.freeze': (freeze, (), 'moment'),
        'kill -9 of every process': (kill_each, (), 'moment'),
        'end of a PID namespace': (end_namespace, (*NAMESPACE, 'sh', '-c', '"$@"; exit 5', 'sh'), 'moment'),
        'end of a namespace, process 1': (end_namespace, NAMESPACE, 'moment'),
        'out of memory': (out_of_memory, (), 'cycle')}


def wait_for_zero(emulator, seconds=10):
    deadline = time.monotonic() + seconds
    while (widths := emulator.widths()).zero_since_ns is None:
        if time.monotonic() > deadline:
            return None
        time.sleep(0.002)
    return widths.zero_since_ns


def try_once(emulator, way):
    """(ms until both widths are 0; problems)."""
    act, before, since = WAYS[way]
    problems = []
    one = Run(emulator, *before)
    one.wait_until_driven()
    before_ns = time.monotonic_ns()
    act(one)
    zero_ns = wait_for_zero(emulator)
    if zero_ns is None:
        one.end()
        return None, [f'{way}: the card holds']
    since_ns = one.last_cycle_ns() if since == 'cycle' else before_ns
    one.end()
    ms = max(0, zero_ns - since_ns) * 1e-6
    if ms > BOUND_MS:
        problems.append(f'{way}: both 0 after {ms:.2f} ms')
    if wait_for_zero(emulator) is None:
        problems.append(f'{way}: the outputs came back')
    return ms, problems


def series(emulator):
    problems = []
    print('ms until both widths are 0 at the card (0: nothing was driven at that moment)\n' + ' ' * 32 +
          'tries driven     min  median     max', flush=True)
    for way in WAYS:
        times = []
        for _ in range(TRIES):
            ms, found = try_once(emulator, way)
            problems += found
            times += [] if ms is None else [ms]
        driven = [ms for ms in times if ms > 0]
        shown = driven or [0.0]
        print(f'{way:<32}{len(times):>5} {len(driven):>6} {min(shown):>7.2f} {statistics.median(shown):>7.2f} '
              f'{max(shown):>7.2f}', flush=True)
        if len(driven) < TRIES / 2:
            problems.append(f'{way}: something was driven in {len(driven)} tries only')
    return problems


def service_dies_too(emulator):
    """The run and the service at once: systemd starts the service again. Printed, without a bound."""
    times = []
    for _ in range(max(1, TRIES // 10)):
        one = Run(emulator)
        one.wait_until_driven()
        service = int(run('systemctl', 'show', '--property=MainPID', '--value', SERVICE).stdout)
        before_ns = time.monotonic_ns()
        os.kill(service, signal.SIGKILL)
        kill_each(one)
        zero_ns = wait_for_zero(emulator)
        one.end()
        if zero_ns is None:
            return ['run and service killed: the card holds']
        times.append(max(0, zero_ns - before_ns) * 1e-6)
        while run('systemctl', 'is-active', SERVICE, check=False).stdout.strip() != 'active':
            time.sleep(0.05)
    print(f'run and service killed at once, systemd starts the service again: 0 after '
          f'{min(times):.0f} to {max(times):.0f} ms ({len(times)} tries)', flush=True)
    return []


def ended_by_service(emulator, way, act, words, **run):
    """The service takes the outputs back; the run ends with status 1."""
    one = Run(emulator, **run)
    one.wait_until_driven()
    before_ns = time.monotonic_ns()
    act()
    said = one.process.communicate()[1]
    zero_ns = wait_for_zero(emulator)
    if zero_ns is None:
        return [f'{way}: the card holds']
    ms = max(0, zero_ns - before_ns) * 1e-6
    print(f'{way}: both widths 0 after {ms:.2f} ms', flush=True)
    if one.process.returncode != 1 or words not in said:
        return [f'{way}: status {one.process.returncode}: {said[-500:]}']
    return []


def suspend():
    """Through logind, with the kernel's test mode: all processes are frozen, and thawed after a second."""
    run('busctl', 'call', 'org.freedesktop.login1', '/org/freedesktop/login1', 'org.freedesktop.login1.Manager',
        'Suspend', 'b', 'false')


def suspension(emulator):
    problems = []
    test = pathlib.Path('/sys/power/pm_test')
    if not test.exists():
        print('this kernel cannot try a suspension (CONFIG_PM_DEBUG)')
        return problems
    test.write_text('freezer')
    pathlib.Path('/sys/module/suspend/parameters/pm_test_delay').write_text('1')
    problems += ended_by_service(emulator, 'asked for a suspension', suspend, 'the resident guardian was told to end',
                                 cut_speed_rad_s=150)  # systemd takes its time; the run must last longer
    said, deadline_s = '', time.monotonic() + 20
    while 'suspend exit' not in said and time.monotonic() < deadline_s:  # systemd suspends after it has stopped the service
        time.sleep(0.1)
        said = run('journalctl', '--no-pager', '--output=short-monotonic', '--identifier=kernel', '--grep=PM: suspend',
                   check=False).stdout
    entries = re.findall(r'\[ *([\d.]+)\].*suspend entry', said)
    zero_s = (emulator.widths().zero_since_ns or 0) * 1e-9
    if not entries:
        problems.append(f'the computer did not sleep: {said}')
    elif not 0 < zero_s < float(entries[-1]):
        problems.append(f'a suspension: it began at {entries[-1]} s, the outputs were zero since {zero_s} s only')
    else:
        print(f'a suspension: the outputs were zero {1000 * (float(entries[-1]) - zero_s):.1f} ms before it', flush=True)
    deadline_s = time.monotonic() + 20  # the unit of sleep starts it again
    while run('systemctl', 'is-active', SERVICE, check=False).stdout.strip() != 'active':
        if time.monotonic() > deadline_s:
            return [*problems, 'after the suspension: nobody has started the service again']
    one = Run(emulator)
    one.wait_until_driven()
    one.end()
    return problems if wait_for_zero(emulator) else [*problems, 'after the suspension: the card holds']


def service_stopped(emulator):
    """systemctl restart takes the outputs back from a run, which ends with status 1."""
    return ended_by_service(emulator, 'restart of the service', lambda: run('systemctl', 'restart', SERVICE),
                            'the resident guardian was told to end')


def main():
    pathlib.Path('/proc/sys/kernel/sched_rt_runtime_us').write_text('-1')  # emulator, guardian and cycle on one CPU
    folder = pathlib.Path(tempfile.mkdtemp())
    emulator = Emulator(folder, *settings(PLANT))
    install(emulator.root)
    shown = run('systemctl', 'show', SERVICE, '--property=Slice,OOMScoreAdjust,StatusText,ControlGroup').stdout
    print(' '.join(shown.split('\n')))
    problems = [] if 'Slice=abs_guardian.slice' in shown else ['the service is not in its own slice']
    problems += series(emulator)
    problems += suspension(emulator)
    problems += service_stopped(emulator)
    problems += service_dies_too(emulator)
    print('\n'.join(problems) or f'each within {BOUND_MS} ms')
    if problems:
        print(journal()[-3000:])
    emulator.end()
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
