#!/usr/bin/env python3
"""usage: pause_test.py ABS_HIL

Stops and continues a whole virtual machine in which abs_hil drives the emulated card (pause_guest.py), six times. The
machine runs in virtual time, so the load of this computer does not count. Its real-time clock goes on by LEAP_S while it
stands, as after a pause that long, and hardly moves otherwise: by itself it would run away from the virtual time, which
looks like a pause. So the clock lags by the machine's own time from one pause to the next, which LEAP_S must exceed.
Status 77: skipped, see vm_run.sh.
"""
import json
import pathlib
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
PAUSE_S = 0.5
LEAP_S = 30.0
CLOCK_RATE = 0.001  # of the real-time clock while the machine runs


class Machine:
    """QEMU's monitor."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.connect(str(path))
        self.lines = self.socket.makefile()
        self.lines.readline()  # its greeting
        self.say('qmp_capabilities')

    def say(self, command):
        self.socket.sendall(json.dumps({'execute': command}).encode())
        while 'return' not in json.loads(self.lines.readline()):
            pass


class Clock:
    """The machine's real-time clock, for libfaketime."""

    def __init__(self, file):
        self.file = file
        self.ahead_s = 0.0
        self.write()

    def write(self):
        new = self.file.with_suffix('.new')
        new.write_text(f'+{self.ahead_s} x{CLOCK_RATE}\n')
        new.rename(self.file)

    def go_on(self, seconds):
        self.ahead_s += seconds
        self.write()


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(dir=program.parent) as out, tempfile.TemporaryDirectory() as scratch:
        monitor = pathlib.Path(scratch) / 'qmp'
        clock = Clock(pathlib.Path(scratch) / 'clock')
        vm = subprocess.Popen([HERE / 'vm_run.sh', '-t', '1100', '-F', '-C', clock.file, '-M', 'fuse', '-o', out, '-q',
                               f'-qmp unix:{monitor},server=on,wait=off', '--',
                               f'modprobe fuse && python3 -u {HERE}/pause_guest.py {program} /out'])
        machine, paused = None, 0
        while vm.poll() is None:
            if (pathlib.Path(out) / f'pause-{paused}').exists():
                machine = machine or Machine(monitor)
                machine.say('stop')
                time.sleep(PAUSE_S)
                clock.go_on(LEAP_S)
                machine.say('cont')
                paused += 1
            time.sleep(0.02)
        print(f'the machine was paused {paused} times')
        return vm.returncode


if __name__ == '__main__':
    sys.exit(main())
