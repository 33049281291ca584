"""Within the virtual machine: the emulated CAN node and abs_hil as processes, and what both tests of CAN ask of them."""
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest
import zlib

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / 'app'))
from emulator_process import EmulatorProcess  # noqa: E402
from program import PROGRAM  # noqa: E402

WATCHDOG_MS = 20
# The plant from standstill is stiff, and the emulator shares one slow CPU with the program: ten times fewer steps there.
PLANT = ['--set', 'plant.slip_regularisation_m_s=0.1']


def shell(command):
    done = subprocess.run(command, shell=True, capture_output=True, text=True)
    assert done.returncode == 0, f'{command}: {done.stderr}'
    return done.stdout


class Node(EmulatorProcess):
    """A running abs_rig_emulator --can."""

    def __init__(self, folder, interface, *args):
        self.interface = interface
        super().__init__(folder, '--can', interface, *PLANT, *args)

    def wait_for(self, wanted, program):
        while program.poll() is None:
            if wanted(*self.wire()):
                return
            time.sleep(0.003)
        raise AssertionError(f'ended before the duties wanted were seen: {self.lines[-3:]}, {program.stderr.read()}')

    def zeroed(self):
        """The last time its outputs went to zero: (why, ms since the last valid command)."""
        self.command('status')
        event = [line for line in self.lines if 'outputs zero' in line][-1]
        found = re.search(r'outputs zero: (.*); last valid command ([\d.]+) ms ago', event)
        return found[1], float(found[2])


def put_record(folder, interface):
    """A commissioning record of the node behind an adapter, which counts as hardware. Nobody is here to commission it."""
    keys = re.findall(r'(?m)^(driver\.can\.\w+) +(\S+)', shell(f'{PROGRAM} list --keys'))
    options = {**dict(keys), 'driver.can.watchdog_ms': str(WATCHDOG_MS)}
    record = {'abs_hil_board_record': 2, 'driver_kind': 'can', 'place': interface, 'logic': 'protocol 1',
              'emulated': False, 'date': '', 'version': '', 'encoder_counts_per_rev': 4096,
              'counts_of_one_turn': {'upper': 4096, 'lower': 4096}, 'options': options,
              'identity': {}}
    record['checksum'] = f"{zlib.crc32(json.dumps(record, separators=(',', ':')).encode()):08x}"
    (folder / f'can-{interface}.json').write_text(json.dumps(record))


class CanRigTest(unittest.TestCase):
    host, node_side = 'vcan0', 'vcan0'
    rate_Hz = 1000

    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self._folder.name)
        self.ends = []

    def tearDown(self):
        for end in reversed(self.ends):
            end()
        self._folder.cleanup()

    def node(self, *args):
        folder = self.folder / f'node{len(self.ends)}'
        folder.mkdir()
        node = Node(folder, self.node_side, *args)
        self.ends.append(node.kill)
        return node

    def start(self, *args):
        program = subprocess.Popen(
            [PROGRAM, '--backend', 'rig', '--no-lcm', '--no-out', '--rt', 'require', '--rate', str(self.rate_Hz),
             '--csv', self.folder / 'run.csv', '--log', self.folder / 'run.lcmlog', '--summary',
             self.folder / 'run.json', '--set', 'driver.kind=can', '--set', f'driver.can.interface={self.host}',
             '--set', f'driver.can.watchdog_ms={WATCHDOG_MS}', '--set', f'driver.records={self.folder}',
             # A guardian that cannot verify would go on until a person releases it.
             '--set', 'driver.emulated=true', '--set', 'guardian.insist_s=1',
             '--set', 'unsafe.keys=guardian.insist_s,driver.records', *map(str, args)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.ends.append(lambda: (program.kill() if program.poll() is None else None, program.communicate()))
        return program

    def finish(self, program, status):
        _, errors = program.communicate(timeout=200)
        self.assertEqual(program.returncode, status, errors)
        return errors

    def summary(self, name='run.json'):
        return json.loads((self.folder / name).read_text())

    def check_log_complete(self):
        """Every cycle of the run is in its record, to the one that found the fault."""
        summary = self.summary()
        with open(self.folder / 'run.csv', newline='') as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), summary['cycles'])
        self.assertEqual(summary['telemetry_drops'], 0)
        self.assertEqual(rows[-1]['phase'], 'fault')
        self.assertEqual((float(rows[-1]['brake_pwm']), float(rows[-1]['motor_pwm'])), (0.0, 0.0))
        self.assertGreater((self.folder / 'run.lcmlog').stat().st_size, 100 * len(rows))

    def check_ended(self, program, words):
        errors = self.finish(program, 1)
        self.assertIn(words, errors)
        self.assertIn(words, self.summary()['reason'])
        self.check_log_complete()
        return errors

    def check_zero_in_time(self, node):
        why, since_ms = node.zeroed()
        self.assertLessEqual(since_ms, WATCHDOG_MS + 0.001, why)
        self.assertEqual(node.wire(), (0.0, 0.0))
        print(f'  {self.id().split(".")[-1]}: outputs zero, {why}, {since_ms:.3f} ms after the last valid command')
        return why

    def accelerating(self, node, *args):
        program = self.start(*args)
        node.wait_for(lambda drive, brake: drive > 0.9, program)
        return program

    def braking(self, node, *args):
        program = self.start('--set', 'experiment.cut_speed_rad_s=60', *args)
        node.wait_for(lambda drive, brake: brake > 0.3, program)
        return program

    def check_paper_run(self, program):
        """Ran to its end without a lost or late cycle, and stopped as the simulator does under the same cap."""
        errors = self.finish(program, 0)
        sim = self.folder / 'sim.json'
        subprocess.run([PROGRAM, '--backend', 'sim', '--fast', '--no-lcm', '--set', 'gate.brake_duty_max=0.7',
                        *PLANT, '--summary', sim], check=True, capture_output=True)
        rig, wanted = self.summary(), self.summary('sim.json')
        self.assertEqual(rig['config']['gate']['brake_duty_max'], 0.7)
        self.assertRegex(errors, r'cycles, 0 without an answer in time', errors)
        self.assertEqual(rig['overruns'], 0, errors)
        self.assertEqual(rig['telemetry_drops'], 0)
        difference = rig['stop_distance_m'] / wanted['stop_distance_m'] - 1
        print(f'  paper over {self.host}: {rig["cycles"]} cycles, 0 lost, stop distance {rig["stop_distance_m"]:.4f} m, '
              f'{100 * difference:+.2f} % of the simulator\'s')
        print('  ' + next(line for line in errors.splitlines() if 'longest answer' in line))
        self.assertLess(abs(difference), 0.01)
