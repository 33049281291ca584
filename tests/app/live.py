"""Shared by the tests of a run on a network: a network namespace, runs of a set length, subscribers, and the
datagrams that the kernel dropped."""
import json
import math
import os
import pathlib
import signal
import statistics
import subprocess
import sys
import time

# A run does not end where the computer kept it from the processor for more than 0.1 s, the simulation's bound: the tests of real
# time judge that.
PATIENT = ['--set', 'realtime.cycle_gap_max_s=10']
URL = 'udpm://239.255.76.67:7667?ttl=0'
LCM_PORT = 7667


def enter_private_network(script, arguments):
    """Continues in a network namespace of its own; status 77 if none is available."""
    if os.environ.get('ABS_HIL_TEST_INSIDE') != '1':
        os.environ['ABS_HIL_TEST_INSIDE'] = '1'
        os.environ['ABS_HIL_RUNS_DIR'] = ''
        os.execv(script, [script, sys.executable, *arguments])


def check(holds, what, *shown):
    if not holds:
        sys.exit(f'FAILED: {what}: {shown}')
    print(f'ok: {what}', flush=True)


def urgent():
    """Gives a process that must not miss anything priority over other processes, where permitted."""
    wish = ['chrt', '-f', '10']
    return wish if subprocess.run([*wish, 'true'], stderr=subprocess.DEVNULL).returncode == 0 else []


def drive_for(folder, seconds):
    """An experiment that only drives for the given time."""
    path = pathlib.Path(folder, f'drive-{seconds}.toml')
    # A phase lasts less than 600 s.
    phases = [min(300, seconds - begin) for begin in range(0, math.ceil(seconds), 300)]
    path.write_text('description = "drive"\n' + ''.join(
        f'[[phase]]\nname = "accelerate-{number}"\nmotor = 0.3\nuntil = {{ lasts_s = {lasts_s} }}\n'
        for number, lasts_s in enumerate(phases)))
    return ['--experiment', path]


class Run:
    """A running abs_hil that writes a summary."""

    def __init__(self, program, folder, *options):
        self.summary_file = pathlib.Path(folder, f'{time.monotonic_ns()}.json')
        self.process = subprocess.Popen([program, *PATIENT, '--summary', self.summary_file, *map(str, options)],
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def end(self, timeout=120):
        self.output, self.errors = self.process.communicate(timeout=timeout)
        check(self.process.returncode == 0, 'the run completes', self.process.returncode, self.errors[-2000:])
        self.summary = json.loads(self.summary_file.read_text())
        return self.summary


def port_drops(pid=None):
    """Datagrams that the kernel dropped at the sockets on LCM's port, of one process or of all, because their
    buffers were full."""
    inodes = None
    if pid is not None:
        links = []
        for descriptor in pathlib.Path(f'/proc/{pid}/fd').iterdir():
            try:
                links.append(os.readlink(descriptor))
            except FileNotFoundError:
                pass
        inodes = {link[8:-1] for link in links if link.startswith('socket:[')}
    drops = 0
    for line in pathlib.Path('/proc/net/udp').read_text().splitlines()[1:]:
        fields = line.split()
        if fields[1].endswith(f':{LCM_PORT:04X}') and (inodes is None or fields[9] in inodes):
            drops += int(fields[12])
    return drops


class Subscriber:
    """The project's own receiver (`telemetry::Receiver`, as in `abs_hil watch`) in its own process."""

    def __init__(self, helper, url, precedence=(), silence_s=2):
        self.process = subprocess.Popen([*precedence, helper, 'receive', url, str(silence_s)], stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline() == 'listening\n'
        self.kernel_drops = 0

    def stand_still(self):
        self.process.send_signal(signal.SIGSTOP)

    def note_drops(self):
        self.kernel_drops = port_drops(self.process.pid)

    def go_on(self):
        self.process.send_signal(signal.SIGCONT)

    def result(self):
        """Its result, which comes `silence_s` after the last message."""
        text, _ = self.process.communicate(timeout=60)
        return json.loads(text)

    def end(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()


def distribution(summaries, name):
    return [tuple(summary[name][key] for key in ('p50', 'p99', 'p99_9', 'max')) for summary in summaries]


def compare_timing(title, without, with_):
    """Compares both distributions, and checks that the cycle's own statistics stayed the same: the medians of cycle and
    wake-up, which other processes do not change (they change the tails, which are only shown)."""
    for name in ('cycle_time_us', 'wakeup_latency_us', 'write_us'):
        for kind, summaries in (('without', without), (title, with_)):
            shown = '  '.join('/'.join(f'{value:g}' for value in row) for row in distribution(summaries, name))
            print(f'{name:<18} {kind:<24} p50/p99/p99.9/max: {shown}')
    for kind, summaries in (('without', without), (title, with_)):
        print(f'{"cycles, late":<18} {kind:<24} {[(s["cycles"], s["overruns"]) for s in summaries]}', flush=True)

    def median(summaries, name):
        return statistics.median(summary[name]['p50'] for summary in summaries)

    # Publishing within the cycle would cost 8 to 43 us per cycle with one to four subscribers, more than these bounds.
    for name, slack_us in (('cycle_time_us', 6), ('wakeup_latency_us', 60)):
        before, after = median(without, name), median(with_, name)
        check(after <= 1.5 * before + slack_us, f'{title}: median of {name}: {before:g} without, {after:g} with')
