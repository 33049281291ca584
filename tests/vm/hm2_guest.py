"""Within the virtual machine with its PREEMPT_RT kernel: the paper's experiment through driver.kind=hm2 over UDP on the
loopback interface, at 1 kHz against the emulated 7I92T in another process, and its cable pulled. Argument: ABS_HIL."""
import json
import pathlib
import re
import subprocess
import tempfile
import time
import unittest

from can_rig import PLANT, shell

from emulator_process import EmulatorProcess
from program import PROGRAM

ADDRESS = '127.0.0.1:27182'
WATCHDOG_MS = 20


class Hm2InTheMachine(unittest.TestCase):
    def setUp(self):
        shell('ip link set lo up')
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.board = EmulatorProcess(self.folder, '--hm2', ADDRESS, *PLANT)
        self.addCleanup(self.board.kill)

    def start(self):
        program = subprocess.Popen(
            [PROGRAM, '--backend', 'rig', '--no-lcm', '--no-out', '--rt', 'require', '--summary',
             self.folder / 'rig.json', '--set', 'driver.kind=hm2', '--set', f'driver.hm2.address={ADDRESS}',
             '--set', 'driver.emulated=true', '--set', 'gate.brake_duty_max=0.7'],
            cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(program.communicate)
        self.addCleanup(program.kill)
        return program

    def test_paper(self):
        program = self.start()
        errors = program.communicate(timeout=500)[1]
        self.assertEqual(program.returncode, 0, errors)
        subprocess.run([PROGRAM, '--backend', 'sim', '--fast', '--no-lcm', '--no-out', '--set',
                        'gate.brake_duty_max=0.7', *PLANT, '--summary', self.folder / 'sim.json'], check=True,
                       capture_output=True)
        rig, sim = (json.loads((self.folder / name).read_text()) for name in ('rig.json', 'sim.json'))
        print(f'  {rig["cycles"]} cycles, stopped after {rig["stop_time_s"]:.4f} s, {rig["stop_distance_m"]:.3f} m; '
              f'simulated {sim["stop_time_s"]:.4f} s, {sim["stop_distance_m"]:.3f} m')
        print('  ' + next(line for line in errors.splitlines() if 'hm2:' in line and 'at most' in line))
        self.assertIn('0 without an answer in time; 0 writes lost', errors)
        self.assertEqual((rig['overruns'], rig['telemetry_drops']), (0, 0), errors)
        for key in ('stop_time_s', 'stop_distance_m'):
            self.assertAlmostEqual(rig[key] / sim[key], 1.0, delta=0.01, msg=key)
        self.assertEqual(self.board.wire(), (0.0, 0.0))

    def test_cable_out_while_driving(self):
        program = self.start()
        while program.poll() is None and self.board.wire()[0] < 0.9:
            time.sleep(0.01)
        self.board.command('link down')
        errors = program.communicate(timeout=200)[1]
        self.assertEqual(program.returncode, 1, errors)
        self.assertIn('lost ten datagrams in a row', errors)
        self.assertEqual(self.board.wire(), (0.0, 0.0))
        zeroed = [re.search(r'outputs zero: watchdog; watchdog last reloaded ([\d.]+) ms ago', line)
                  for line in self.board.lines]
        since_ms = float([found for found in zeroed if found][-1][1])
        print(f'  outputs zero {since_ms:.3f} ms after the last command')
        self.assertLessEqual(since_ms, WATCHDOG_MS + 2)


if __name__ == '__main__':
    unittest.main()
