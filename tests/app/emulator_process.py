"""A running abs_rig_emulator, whatever its board, told by lines into its control FIFO."""
import pathlib
import re
import subprocess

import program

EMULATOR = pathlib.Path(program.PROGRAM).parent / 'abs_rig_emulator'


class EmulatorProcess:
    def __init__(self, folder, *args):
        self.control = folder / 'control'
        self.lines = []  # all that it has said, stripped
        self.process = subprocess.Popen([EMULATOR, '--control', self.control, *map(str, args)], stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True)
        self.line('ready')  # "not in real time" may come before

    def line(self, start):
        """Its next line with this start."""
        for line in self.process.stdout:
            self.lines.append(line.strip())
            if line.startswith(start):
                return line
        raise AssertionError(f'the emulator ended without "{start}": {self.lines}')

    def command(self, text):
        """Its answer, once the command has been obeyed."""
        with open(self.control, 'w') as fifo:
            fifo.write(text + '\n')
        return self.line(f'{text}: ')

    def wire(self):
        """Duties (drive, brake) that act on the rig now."""
        found = re.search(r'drive ([\d.]+), brake ([\d.]+)', self.command('status'))
        return float(found[1]), float(found[2])

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
