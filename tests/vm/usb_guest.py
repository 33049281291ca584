"""usb_guest.py ABS_HIL [unittest arguments]: within the virtual machine. The emulated RT-DAC/USB2 is a USB device of
this kernel (vhci_hcd), abs_hil drives it through usbfs.

Class LockStep: time goes on with the client's cycles alone, so that runs repeat themselves and failures happen in
mid-braking. Class RealTime, for vm_run.sh -V: both on the guest's own clock. /out, if there, gets the figures.
"""
import os
import pathlib
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / 'app'))
from emulator_process import EmulatorProcess  # noqa: E402
from program import PROGRAM, ProgramTest  # noqa: E402

DEVICES = pathlib.Path('/sys/bus/usb/devices')
SAFE = (0.0, 0.0)
# What breaks breaks in braking: a computer under emulation need not go through the whole acceleration each time.
ALMOST_AT_SPEED = ['--lock-step', '--start-speed', 75]
SHORT_RUN = ['--set', 'experiment.idle_s=0.2', '--set', 'experiment.cut_speed_rad_s=80']
UNSAFE_WORDS = 'the safe state may not have reached the board'

# name, command in mid-braking, words on stderr, what is on the wire afterwards, whether the safe state is known
BROKEN = [
    ('unplugged', 'unplug', 'USB board unplugged: its outputs keep their last values, press the E-stop', 'held', False),
    ('STALL of IN', 'fault stall in', 'USB board refused a transfer (STALL)', 'safe', False),
    ('STALL of IN, clearable', 'fault stall in once', 'USB board refused a transfer (STALL)', 'safe', True),
    ('STALL of OUT', 'fault stall out', 'USB board refused a transfer (STALL)', 'held', False),
    ('STALL of OUT, clearable', 'fault stall out once', 'USB board refused a transfer (STALL)', 'safe', True),
    ('short frame', 'fault length 100', 'USB board sent a frame of the wrong length', 'safe', False),
    ('long frame', 'fault length 512', 'USB board sent a frame of the wrong length', 'safe', False),
    ('no answer', 'fault silent', 'USB board missed too many answers', 'safe', False),
    ('garbage', 'fault garbage', 'USB board sent data that is not one of its frames', 'safe', False),
    ('brake not taken', 'break-brake on', 'USB board does not show the duties that were sent', 'brake off by one', False),
]


class Emulator(EmulatorProcess):
    def __init__(self, folder, *args):
        super().__init__(folder, '--usb', *args)

    def end(self):
        super().end()
        while any(line.read_text().strip() == 'InTeCo' for line in DEVICES.glob('*/manufacturer')):
            time.sleep(0.05)  # the kernel takes its time to see that it is gone


class UsbTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.boards = 0
        self.board = None

    def tearDown(self):
        if self.board:
            self.board.end()
        super().tearDown()

    def emulator(self, *args):
        """A new board, the one before unplugged."""
        if self.board:
            self.board.end()
        self.boards += 1
        folder = self.folder / str(self.boards)
        folder.mkdir()
        self.board = Emulator(folder, *args)
        return self.board

    def rig(self, *args):
        return subprocess.run([PROGRAM, '--backend', 'rig', '--no-lcm', '--set', 'driver.kind=usb', '--set',
                               'driver.emulated=true', *map(str, args)], capture_output=True, text=True, timeout=400)

    def lock_step(self, *args):
        return self.rig('--fast', '--set', 'driver.usb.answer_timeout_us=300000', *args)

    def report(self, text):
        print(text, flush=True)
        if os.path.isdir('/out'):
            with open('/out/figures', 'a') as file:
                file.write(text + '\n')


class LockStep(UsbTest):
    def test_paper_at_1_kHz_agrees_with_the_simulator(self):
        emulator = self.emulator('--lock-step')
        rig, sim = self.folder / 'rig.json', self.folder / 'sim.json'
        result = self.lock_step('--summary', rig, '--csv', self.folder / 'rig.csv')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('not verified on hardware', result.stderr)
        self.assertIn('0 cycles without their frame', result.stderr)
        self.fast('--summary', sim, '--set', 'gate.brake_duty_max=0.7')
        r, s = self.summary(rig), self.summary(sim)
        self.assertEqual(r['config']['control']['rate_Hz'], 1000)
        self.assertEqual(len(self.rows(self.folder / 'rig.csv')), r['cycles'])
        self.report(f'paper at 1 kHz in lock-step: {r["cycles"]} cycles, stop distance {r["stop_distance_m"]:.4f} m, '
                    f'simulated {s["stop_distance_m"]:.4f} m')
        for key in ('stop_time_s', 'stop_distance_m', 'theta_final_N', 'brake_start_s'):
            self.assertAlmostEqual(r[key] / s[key], 1.0, delta=0.01, msg=key)
        self.assertEqual(emulator.wire(), SAFE)
        self.assertIn('nonsense 0, JTAG 0', emulator.command('status'))

    def test_broken_in_mid_braking(self):
        for name, command, words, wire, known in BROKEN:
            with self.subTest(name):
                emulator = self.emulator(*ALMOST_AT_SPEED, '--when-braking', command)
                csv, summary, log = (self.folder / file for file in ('run.csv', 'run.json', 'run.lcmlog'))
                for file in (csv, summary, log):
                    file.unlink(missing_ok=True)
                result = self.lock_step(*SHORT_RUN, '--csv', csv, '--summary', summary, '--log', log)
                self.assertEqual(result.returncode, 1, result.stderr)
                self.assertIn(words, result.stderr)
                self.assertEqual(UNSAFE_WORDS in result.stderr, not known, result.stderr)
                if not known:
                    self.assertIn('Press the E-stop', result.stderr)
                rows, s = self.rows(csv), self.summary(summary)
                self.assertEqual(s['result'], 'fault')
                self.assertIn(words, s['reason'])
                self.assertEqual((len(rows), s['telemetry_drops']), (s['cycles'], 0))
                self.assertEqual((rows[-1]['phase'], rows[-2]['phase']), ('fault', 'brake'))
                self.assertIn(words.encode(), log.read_bytes())
                drive, brake = emulator.wire()
                self.report(f'{name}: {words}; at the power stage: drive {drive}, brake {brake}')
                self.assertEqual(drive, 0.0)
                if wire == 'held':
                    self.assertGreater(brake, 0.1)  # no watchdog
                elif wire == 'safe':
                    self.assertEqual(brake, 0.0)
                else:
                    self.assertAlmostEqual(brake, 1 / 4095, delta=1e-4)

    def test_late_answers_pass_until_there_are_too_many(self):
        for late, status in ((3, 0), (200, 1)):
            with self.subTest(late=late):
                emulator = self.emulator(*ALMOST_AT_SPEED, '--when-braking', f'fault late 450000 {late}')
                result = self.lock_step(*SHORT_RUN)
                self.assertEqual(result.returncode, status, result.stderr)
                if status == 0:
                    self.assertIn(f'{late} cycles without their frame', result.stderr)
                self.assertEqual(emulator.wire(), SAFE)

    def test_doctor_and_owner(self):
        self.emulator('--lock-step', '--usb-serial', '77')
        doctor = self.run_program('doctor', '--only', 'boards')
        self.assertEqual(doctor.returncode, 0, doctor.stdout)
        self.assertIn('RT-DAC/USB2 1209:0001 serial 77', doctor.stdout)
        self.assertIn('unverified on hardware', doctor.stdout)
        other = self.lock_step('--set', 'driver.usb.serial=78')
        self.assertEqual(other.returncode, 3)
        self.assertIn('no RT-DAC/USB2 board', other.stderr)
        real_time = self.rig()
        self.assertEqual(real_time.returncode, 3)
        self.assertIn('is an emulator in lock-step', real_time.stderr)


class RealTime(UsbTest):
    """The outcome is asserted at the vendor's own rate, never timing; the figures are for people."""

    def run_at(self, rate):
        emulator = self.emulator()
        summary = self.folder / f'{rate}.json'
        result = self.rig('--rt', 'prefer', '--rate', rate, '--summary', summary, '--set',
                          f'driver.usb.answer_timeout_us={800_000 // rate}',
                          # An emulated processor stands still for some 30 ms now and then.
                          '--set', 'realtime.cycle_gap_max_s=0.5')
        s = self.summary(summary)
        lost = [line for line in result.stderr.splitlines() if 'without their frame' in line]
        self.report(f'{rate} Hz: status {result.returncode}, {s["result"]}, {s["cycles"]} cycles, overruns '
                    f'{s["overruns"]}, stop distance {s["stop_distance_m"]} m, cycle time us {s["cycle_time_us"]}, {lost}')
        self.assertEqual(emulator.wire(), SAFE)
        return result, s

    def test_vendors_100_Hz(self):
        result, s = self.run_at(100)
        self.assertEqual((result.returncode, s['result'], s['telemetry_drops']), (0, 'completed', 0), result.stderr)

    def test_faster_completes_or_says_why(self):
        for rate in (1000, 500):
            with self.subTest(rate=rate):
                result, s = self.run_at(rate)
                self.assertIn((result.returncode, s['result']), ((0, 'completed'), (1, 'fault')), result.stderr)
                if s['result'] == 'fault':
                    self.assertRegex(s['reason'], 'missed too many answers|consecutive overruns')


if __name__ == '__main__':
    unittest.main()
