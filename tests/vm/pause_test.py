#!/usr/bin/env python3
"""usage: pause_test.py ABS_HIL

Stops and continues a whole virtual machine in which abs_hil drives the emulated card (pause_guest.py), six times. Judges
the outcome. The times are those of the guest, whose clock has this computer's own pauses; they are printed. Status 77:
skipped, see vm_run.sh.
"""
import json
import pathlib
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
PAUSE_S = 2.5  # the real-time clock counts whole seconds: two of them at least


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

    def pause(self):
        self.say('stop')
        time.sleep(PAUSE_S)
        self.say('cont')


def main():
    program = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory(dir=program.parent) as out, tempfile.TemporaryDirectory() as scratch:
        monitor = pathlib.Path(scratch) / 'qmp'
        vm = subprocess.Popen([HERE / 'vm_run.sh', '-t', '900', '-M', 'fuse', '-o', out, '-q',
                               f'-qmp unix:{monitor},server=on,wait=off -rtc base=utc,clock=host', '--',
                               f'modprobe fuse && python3 -u {HERE}/pause_guest.py {program} /out'])
        machine, paused = None, 0
        while vm.poll() is None:
            if (pathlib.Path(out) / f'pause-{paused}').exists():
                machine = machine or Machine(monitor)
                machine.pause()
                paused += 1
            time.sleep(0.02)
        print(f'the machine was paused {paused} times')
        return vm.returncode


if __name__ == '__main__':
    sys.exit(main())
