"""Failures of a card, one per row: reason, exit status, and the final state of the wire."""
import os
import pty
import signal
import subprocess
import time
import unittest

from rig_emulator import Emulator, RigTest, skip_unless_possible

SAFE = (0.0, 0.0)

# name, arguments of the emulator, arguments of abs_hil, exit status, words on stderr
REFUSED = [
    ('all ones', ['--command', 'all-ones on'], [], 3, 'answers all ones'),
    ('other bitstream', ['--bitstream', '0x123'], ['driver.pci.bitstream=0x124'], 3,
     'bitstream version 291 is not the configured 292'),
    ('wrong device', ['--device', '0x9030'], [], 3, 'no RT-DAC4/PCI card'),
    ('wrong vendor', ['--vendor', '0x8086'], [], 3, 'no RT-DAC4/PCI card'),
    ('wrong device by address', ['--device', '0x9030'], ['driver.pci.bdf=0000:03:00.0'], 3, '0x10b5:0x9030, not the'),
    ('several cards', ['--bdf', '0000:03:00.0', '--bdf', '0000:04:00.0'], [], 3, '0000:03:00.0, 0000:04:00.0'),
    ('BAR too small', ['--bar-bytes', 128], [], 3, 'has 128 bytes'),
    ('BAR in memory', ['--bar-kind', 'memory'], [], 3, 'is memory, not I/O ports'),
    ('permission denied', ['--command', 'deny on'], [], 3, 'permission denied'),
    ('unplugged', ['--command', 'unplug'], [], 3, 'no RT-DAC4/PCI card'),
    ('no supply', ['--command', 'supply 0'], [], 3, 'supply 0 V: the rig is switched off'),
    ('PWM does not hold its mode', ['--fault', '64:wrong=1'], [], 3, 'at 0x64'),
    ('supply tripped already', ['--command', 'supply 5'], [], 1, 'interlock tripped: supply undervoltage'),
    ('sign that is none', [], ['driver.pci.upper_sign=0'], 2, 'driver.pci.upper_sign = 0'),
    ('no such kind', [], ['driver.kind=isa'], 2, 'driver.kind'),
]

# name, command while accelerating, words on stderr; None: the wire can no longer be examined
BROKEN = [
    ('unplugged', 'unplug', 'board is gone', 'held'),
    ('all ones', 'all-ones on', 'board is gone', 'held'),
    ('overspeed (bit 0)', 'overspeed', "the board's own interlock tripped (trip flags 1; bound: 0)", 'safe'),
    ('supply', 'supply 5', 'interlock tripped: supply undervoltage', 'safe'),
    ('temperature (bit 2)', 'temperature 95', "the board's own interlock tripped (trip flags 4; bound: 0)", 'safe'),
    ('encoder off', 'fault 88:off', 'at 0x88', 'safe'),
    ('encoder nonsense', 'fault 88:garbage', 'answer outside what the board can say', 'safe'),
    ('PWM reads back otherwise', 'fault 6c:wrong=1', 'register does not read back what was written at 0x6c', 'safe'),
]


class RigFailures(RigTest):
    def test_refused_before_anything_moves(self):
        for name, emulator_args, settings, status, words in REFUSED:
            with self.subTest(name):
                traffic = self.folder / 'traffic'
                emulator = self.emulator('--record', traffic, '--lock-step', *emulator_args)
                result = self.lock_step(emulator, *(a for s in settings for a in ('--set', s)))
                self.assertEqual(result.returncode, status, result.stderr)
                self.assertIn(words, result.stderr)
                self.assertEqual(emulator.wire(), SAFE)
                emulator.end()
                written = [line for line in traffic.read_text().splitlines() if line.startswith('W 6C')]
                self.assertFalse([line for line in written if not line.endswith(' 00000000')], 'only zeros')
                if status != 1 and 'at 0x64' not in words:
                    self.assertNotIn('W ', traffic.read_text(), 'nothing is written to what is not the card')

    def test_an_identity_that_is_too_small_is_named(self):
        # Full brake on a tyre that holds slows the lower wheel twice as fast as an identity of 23 N allows.
        strong = ('--controller', 'locked', '--set', 'driver.pci.brake_duty_max=1', '--set', 'experiment.cut_speed_rad_s=120')
        for identity, status in (('rig.theta_N=23', 1), ('rig.theta_N=120', 0)):
            with self.subTest(identity):
                emulator = self.emulator('--lock-step', '--set', 'plant.theta_N=120')
                result = self.lock_step(emulator, *strong, '--set', 'model.theta_N=23', '--set', identity)
                self.assertEqual(result.returncode, status, result.stderr)
                hint = "the rig's identity (rig.theta_N = 23 N, rig.motor_stall_torque_Nm = 2.1122 N m) may be too small"
                (self.assertIn if status else self.assertNotIn)(hint, result.stderr)
                emulator.end()

    def test_second_owner_is_told_who_holds_the_card(self):
        emulator = self.emulator()
        first = self.real_time(emulator)
        self.wait_until_driving(emulator)
        second = self.real_time(emulator)
        _, errors = second.communicate(timeout=20)
        self.assertEqual(second.returncode, 3)
        self.assertIn(f'in use by process {first.pid} (abs_hil)', errors)
        self.assertGreater(emulator.wire()[0], 0.9, 'the first one goes on')
        first.send_signal(signal.SIGINT)
        first.communicate(timeout=20)
        self.assertEqual(first.returncode, 130)
        self.assertEqual(emulator.wire(), SAFE)

    def test_broken_while_running(self):
        for name, command, words, wire in BROKEN:
            with self.subTest(name):
                emulator = self.emulator('--overspeed-bit', 0, '--temperature-max', 90)
                program = self.real_time(emulator, '--set', 'gate.temperature_max_C=200')
                self.wait_until_driving(emulator)
                emulator.command(command)
                _, errors = program.communicate(timeout=20)
                self.assertEqual(program.returncode, 1, errors)
                self.assertIn(words, errors)
                if wire == 'safe':
                    self.assertEqual(emulator.wire(), SAFE)
                else:
                    # Nothing can reach the wire: the PWMs hold, and a message asks the user to act.
                    self.assertIn('the safe state may not have reached the board', errors)
                    self.assertGreater(emulator.wire()[0], 0.9)
                emulator.end()

    def test_another_writer_on_the_card(self):
        # It writes until the run has seen it and ended its outputs. A write between a cycle's look and its own write has
        # no effect; after the run only the resident guardian would keep zeros.
        for name, writes, words in (
                ('drive', ((0x60, 0), (0x6C, 4094)), 'something else writes to the board'),
                ('brake while accelerating', ((0x60, 1), (0x6C, 2000)), 'something else writes to the board'),
                ('brake at 8 bits', ((0x60, 1), (0x64, 0)), 'version or settings changed during the run'),
                ('overspeed limit', ((0x5C, 0xFFFF),), 'version or settings changed during the run')):
            with self.subTest(name):
                for _ in range(3):
                    emulator = self.emulator()
                    program = self.real_time(emulator)
                    self.wait_until_driving(emulator)
                    for _ in range(5):
                        emulator.write_registers(*writes)
                        time.sleep(0.1)
                        if emulator.wire()[0] == 0.0:
                            break
                    _, errors = program.communicate(timeout=20)
                    self.assertEqual(emulator.wire(), SAFE)
                    emulator.end()
                    # The second of two writes may come after the run has seen the first and released its outputs. Then
                    # it looks like the run's own, and the guardian ends the run.
                    if 'did not read back as zero after it had given them back' not in errors:
                        break
                    self.assertEqual(program.returncode, -signal.SIGKILL, errors)
                self.assertEqual(program.returncode, 1, errors)
                self.assertIn(words, errors)

    def test_emulator_killed(self):
        emulator = self.emulator()
        program = self.real_time(emulator)
        self.wait_until_driving(emulator)
        emulator.kill()
        _, errors = program.communicate(timeout=20)
        self.assertEqual(program.returncode, 1, errors)
        self.assertIn('board is gone', errors)

    def test_emulator_starts_again_where_one_was_killed(self):
        emulator = self.emulator()
        emulator.kill_and_leave_mount()
        with self.assertRaises(OSError):
            emulator.root.stat()
        again = self.start_emulator(Emulator, folder=emulator.root.parent)
        self.assertTrue(any(again.root.iterdir()))
        self.assertEqual(again.end(), 0)
        self.assertFalse(any(again.root.iterdir()))

    def test_client_ended_by_signals(self):
        for number, status in ((signal.SIGTERM, 143), (signal.SIGINT, 130), (signal.SIGHUP, 129)):
            with self.subTest(signal=number):
                emulator = self.emulator()
                program = self.real_time(emulator)
                self.wait_until_driving(emulator)
                program.send_signal(number)
                program.communicate(timeout=20)
                self.assertEqual(program.returncode, status)
                self.assertEqual(emulator.wire(), SAFE)
                emulator.end()

    def test_host_limits_on_supply_and_temperature(self):
        for setting, command, words in (('gate.supply_min_V=20', 'supply 18', 'supply is off or below gate.supply_min_V'),
                                        ('gate.temperature_max_C=60', 'temperature 70', 'hotter than gate.temp')):
            with self.subTest(setting):
                emulator = self.emulator('--lock-step', '--command', command)
                result = self.lock_step(emulator, '--set', setting)
                self.assertEqual(result.returncode, 1, result.stderr)
                self.assertIn(words, result.stderr)
                self.assertEqual(emulator.wire(), SAFE)
                emulator.end()

    def test_commission_by_hand(self):
        emulator = self.emulator()
        # This guardian tolerates this computer's pauses.
        arguments = [self.program_path(), 'commission', '--set', f'driver.pci.root={emulator.root}', '--set',
                     'guardian.timeout_ms=1000']
        program = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   text=True, bufsize=1)
        said = self.go_through_commissioning(program, emulator)
        program.communicate(timeout=20)
        self.assertEqual(program.returncode, 0, said)
        self.assertEqual(said.count('[y/N]'), 5)
        self.assertIn('bitstream version', said)
        self.assertIn('All steps passed', said)
        self.assertEqual(emulator.wire(), SAFE)

    def test_the_emulated_brake_is_judged_by_the_emulators_file(self):
        """In a terminal, as a person would: the last question asks for what an emulator can show, and takes a no."""
        for sees_the_brake in (True, False):
            with self.subTest(sees_the_brake):
                emulator = self.emulator()
                person, terminal = pty.openpty()
                records = emulator.root.parent / 'records'
                program = subprocess.Popen(
                    [self.program_path(), 'commission', '--set', f'driver.pci.root={emulator.root}', '--set',
                     'guardian.timeout_ms=1000', '--set', f'driver.records={records}'], stdin=terminal,
                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, bufsize=1)
                os.close(terminal)
                self._programs.append(program)
                torques = []

                def answer(question):
                    if 'emulated brake' not in question:
                        return 'y'
                    self.assertIn('brake_torque_Nm', question)
                    self.assertNotIn('Did you see or hear', question)
                    deadline = time.monotonic() + 20
                    while not torques or torques[-1] > 0.1:  # the file is written in blocks
                        self.assertLess(time.monotonic(), deadline, 'it did not release')
                        torques[:] = [float(row['brake_torque_Nm']) for row in self.rows(emulator.truth)[:-1]]
                    return 'y' if sees_the_brake else 'n'

                program.stdin = open(person, 'w', buffering=1)
                said = self.go_through_commissioning(program, emulator, answer)
                program.stdin.close()
                program.stdin = None
                program.communicate(timeout=20)
                self.assertGreater(max(torques), 0.5, 'it gripped')
                self.assertEqual(program.returncode, 0 if sees_the_brake else 1, said)
                self.assertEqual('FAILED: check the brake' in said, not sees_the_brake)
                self.assertEqual(records.exists(), sees_the_brake, 'only a brake that grips earns a record')
                self.assertEqual(emulator.wire(), SAFE)
                emulator.end()

    def test_commissioning_that_dies_in_its_pulse_leaves_nothing_driven(self):
        for number in (signal.SIGKILL, signal.SIGSTOP):
            with self.subTest(number.name):
                emulator = self.emulator()
                program = subprocess.Popen(
                    [self.program_path(), 'commission', '--set', f'driver.pci.root={emulator.root}', '--set',
                     'guardian.timeout_ms=500'], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                    text=True, bufsize=1)
                self._programs.append(program)
                while line := program.stdout.readline():
                    if '[y/N]' in line:
                        program.stdin.write('y\n')
                        if 'Step 3' in line:
                            break
                    elif line.startswith('Turn the '):
                        emulator.turn('upper' if 'UPPER' in line else 'lower', 1)
                        program.stdin.write('\n')
                deadline = time.monotonic() + 20
                while emulator.wire()[0] == 0.0:
                    self.assertLess(time.monotonic(), deadline, 'no pulse')
                program.send_signal(number)
                while emulator.wire() != SAFE:
                    self.assertLess(time.monotonic(), deadline, 'the outputs hold')
                program.kill()
                program.communicate(timeout=20)
                self.assertEqual(emulator.wire(), SAFE)
                emulator.end()

    def program_path(self):
        from program import PROGRAM
        return PROGRAM


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
