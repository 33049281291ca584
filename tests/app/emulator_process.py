"""A running abs_rig_emulator for any board, controlled by lines written into its FIFO."""
import os
import pathlib
import re
import subprocess

from program import PROGRAM, ProgramTest

EMULATOR = pathlib.Path(PROGRAM).parent / 'abs_rig_emulator'
#: In real time emulator and program share a CPU: what pauses one pauses both, and neither finds the other silent.
CPU = max(os.sched_getaffinity(0))
REAL_TIME = ('--set', f'realtime.cpu={CPU}')


class EmulatorProcess:
    def __init__(self, folder, *args, program=EMULATOR):
        self.control = folder / 'control'
        self.lines = []  # all of its output lines, stripped
        cpu = () if '--lock-step' in args else ('--cpu', str(CPU))
        self.process = subprocess.Popen([program, '--control', self.control, *cpu, *map(str, args)], stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True)
        self.line('ready')  # "not in real time" may come before

    def line(self, start):
        """Its next line that begins with `start`."""
        for line in self.process.stdout:
            self.lines.append(line.strip())
            if line.startswith(start):
                return line
        raise AssertionError(f'the emulator ended without "{start}": {self.lines}')

    def command(self, text):
        """Its answer, after it has carried out the command."""
        with open(self.control, 'w') as fifo:
            fifo.write(text + '\n')
        return self.line(f'{text}: ')

    def wire(self):
        """Duties (drive, brake) that act on the rig now."""
        found = re.search(r'drive ([\d.]+), brake ([\d.]+)', self.command('status'))
        return float(found[1]), float(found[2])

    def time_s(self):
        """The board's own time; in lock-step only the program's cycles advance it."""
        return float(self.command('status').split('time ')[1].split()[0])

    def end(self):
        """Ends it if it still runs; returns its exit status."""
        if self.process.poll() is None:
            self.process.terminate()
        return self._wait()

    def kill(self):
        self.process.kill()
        return self._wait()

    def _wait(self):
        if not self.process.stdout.closed:
            self.lines += self.process.stdout.read().splitlines()
            self.process.stdout.close()
        return self.process.wait(timeout=20)


class EmulatorTest(ProgramTest):
    """Ends the programs and then the emulators that a test started, however the test ends."""

    def setUp(self):
        super().setUp()
        self._emulators = []
        self._programs = []

    def tearDown(self):
        for running in self._programs:
            if running.poll() is None:
                running.kill()
                running.communicate()
        for emulator in self._emulators:
            emulator.end()
        super().tearDown()  # removes the folder, in which nothing may be mounted any more

    def start_emulator(self, kind, *args, folder=None):
        """An EmulatorProcess of this kind, in a folder of its own unless one is given."""
        if folder is None:
            folder = self.folder / str(len(self._emulators))
            folder.mkdir()
        self._emulators.append(kind(folder, *args))
        return self._emulators[-1]

    def run_program(self, *args, **kwargs):
        """Starts abs_hil in this test's folder."""
        return super().run_program(*args, **{'cwd': self.folder, **kwargs})

    def start_program(self, *args):
        """Runs abs_hil in this test's folder."""
        self._programs.append(subprocess.Popen([pathlib.Path(PROGRAM).resolve(), *map(str, args)], cwd=self.folder,
                                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
        return self._programs[-1]
