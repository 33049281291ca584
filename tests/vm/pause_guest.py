"""Within the virtual machine, in virtual time: abs_hil and the resident guardian on the emulated card, while pause_test.py
outside stops and continues the whole machine. Only the real-time clock goes on meanwhile. Each run ends with status 1,
and both PWMs are 0 within BOUND_MS after the pause.

usage: pause_guest.py ABS_HIL OUT
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / 'app'))
OUT = pathlib.Path(sys.argv.pop(2)) if len(sys.argv) > 2 else pathlib.Path('/out')
from program import PROGRAM  # noqa: E402
from resident_guardian import Service, settings  # noqa: E402
from rig_emulator import Emulator  # noqa: E402

BOUND_MS = 5
TRIES = 3
RATE_HZ = 500  # as in kills_guest.py
PHASES = {'accelerate': lambda w: w.drive > 0, 'brake': lambda w: w.brake > 0}


def watch_clock(file):
    """In a process of its own, before all others: writes the monotonic time before each leap of the real-time clock."""
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(99))
    clock = os.open('/sys/class/rtc/rtc0/since_epoch', os.O_RDONLY)
    before_ns, seconds = time.monotonic_ns(), int(os.pread(clock, 32, 0))
    with open(file, 'a', buffering=1) as out:
        while True:
            now = int(os.pread(clock, 32, 0))
            if now - seconds > 1:
                out.write(f'{before_ns}\n')
            before_ns, seconds = time.monotonic_ns(), now
            time.sleep(0.0005)


def wait_for(condition, what, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.005)


def one_pause(number, phase, emulator, folder, leaps):
    """(ms from the pause to zero; problems)."""
    program = subprocess.Popen(
        [PROGRAM, '--backend', 'rig', '--no-lcm', '--no-out', '--rate', str(RATE_HZ), '--recorder', folder,
         *settings(f'driver.pci.root={emulator.root}', 'guardian.resident=require',
                   f'guardian.socket={folder}/guardian.sock', 'experiment.idle_s=0.05',
                   f'experiment.cut_speed_rad_s={60 if phase == "accelerate" else 25}')],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def there():
        assert program.poll() is None, f'ended before {phase}: {program.communicate()[1][-600:]}'
        return PHASES[phase](emulator.widths())
    wait_for(there, f'never in {phase}')
    known = len(leaps.read_text().split())
    (OUT / f'pause-{number}').touch()  # pause_test.py stops the machine now
    wait_for(lambda: len(leaps.read_text().split()) > known, 'no pause was seen')
    pause_ns = int(leaps.read_text().split()[known])
    said = program.communicate(timeout=60)[1]
    widths = emulator.widths()
    if widths.zero_since_ns is None:
        return None, [f'{phase}: the card holds']
    ms = (widths.zero_since_ns - pause_ns) * 1e-6
    problems = []
    if program.returncode != 1 or 'the virtual machine was paused' not in said:
        problems.append(f'{phase}: status {program.returncode}: {said[-600:]}')
    if not 0 < ms <= BOUND_MS:
        problems.append(f'{phase}: zero {ms:.2f} ms after the pause; 0 to {BOUND_MS} are expected')
    return ms, problems


def main():
    folder = pathlib.Path(tempfile.mkdtemp())
    leaps = folder / 'leaps'
    leaps.touch()
    watcher = os.fork()
    if watcher == 0:
        watch_clock(leaps)
    emulator = Emulator(folder, *settings('plant.slip_regularisation_m_s=0.1'))
    service = Service(folder, f'driver.pci.root={emulator.root}')
    problems, number = [], 0
    for phase in PHASES:
        times = []
        for _ in range(TRIES):
            ms, found = one_pause(number, phase, emulator, folder, leaps)
            number += 1
            problems += found
            times += [] if ms is None else [ms]
        print(f'paused in {phase}: both widths 0 after (ms of the guest): ' +
              ' '.join(f'{ms:.2f}' for ms in sorted(times)), flush=True)
    os.kill(watcher, 9)
    service.end()
    emulator.end()
    print('\n'.join(problems) or 'each pause ended the run in time')
    if problems:
        print(service.said()[-3000:])
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
