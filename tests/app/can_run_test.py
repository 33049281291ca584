"""The paper's experiment through driver.kind=can, against the emulated node in another process. Outcomes are asserted,
never timing; tests/vm has the same on real kernels' CAN."""
import json
import subprocess
import unittest

from can_emulator import CanTest, skip_unless_possible
from emulator_process import EMULATOR, WAIVED_FOR_EMULATORS

SAFE = (0.0, 0.0)
# fault that the node has from its first second on, words on stderr
BROKEN = [
    ('silent', 'CAN node missed too many answers'),
    ('stale=20', 'CAN node answers with old sequence numbers'),
    ('wrong-size=6', 'CAN frames have the wrong length'),
    ('babble=10', "have a wrong check value"),
]
# the first run's limit is below the speed that it accelerates to
SERIES = '''
[[phase]]
name = "accelerate"
motor = 1.0
until = { upper_speed_above_rad_s = 60 }
at_most_s = 20
[[phase]]
name = "hold"
brake = { torque_Nm = 2 }
until = { standstill = true }
at_most_s = 20
[factors]
gate.overspeed_rad_s = [50, 250]
'''


class CanRun(CanTest):
    def test_emulator_removes_nobody_s_file(self):
        file = self.folder / 'precious'
        file.write_text('data')
        result = subprocess.run([EMULATOR, '--can', f'unix:{file}'], capture_output=True, text=True, timeout=20)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('this file exists and is no socket', result.stderr)
        self.assertEqual(file.read_text(), 'data')

    def test_lock_step_agrees_with_the_simulator(self):
        rig, sim = self.folder / 'rig.json', self.folder / 'sim.json'
        self.fast('--summary', sim, '--set', 'gate.brake_duty_max=0.7')
        for fd in ('off', 'on'):
            node = self.node('--lock-step')
            result = self.lock_step(node, '--summary', rig, '--set', f'driver.can.fd={fd}')
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn('not verified on hardware', result.stderr)
            self.assertIn('CAN FD frames' if fd == 'on' else 'classic frames', result.stderr)
            self.assertIn('cycles, 0 without an answer in time', result.stderr)
            r, s = self.summary(rig), self.summary(sim)
            self.assertEqual(r['config']['gate']['brake_duty_max'], 0.7)
            for key in ('stop_time_s', 'stop_distance_m', 'theta_final_N', 'brake_start_s'):
                self.assertAlmostEqual(r[key] / s[key], 1.0, delta=0.01, msg=key)
            self.assertEqual(node.wire(), SAFE)
            node.end()

    def test_safe_reaches_a_node_that_is_named(self):
        """The emulated bus has one host at a time; tests/vm/can_vcan_guest.py has a run beside it."""
        node = self.node()
        result = self.run_program('safe', '--set', 'driver.kind=can', '--set', f'driver.can.interface={node.interface}')
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('board of driver.kind=can: drive 0 and brake 0, verified', result.stdout)
        self.assertEqual(node.wire(), SAFE)
        nobody = self.run_program('safe', '--insist', '0.1', '--set', 'driver.kind=can', '--set',
                                  f'driver.can.interface=unix:{self.folder / "nobody"}')
        self.assertEqual(nobody.returncode, 1, nobody.stdout)
        self.assertIn('SAFE STATE NOT VERIFIED', nobody.stderr)

    def test_at_500_kbit_s_the_checks_judge(self):
        """The emulated bus has no bit rate. Each read takes the time that its frames need on the bus (docs/can.md, "Bus
        load"): SYNC and up to three answers."""
        read = f'any@read:slow={(75 + 3 * 135) / 500:.3f}ms'
        for fault, reason in ((None, None), ('brake@encoder_lower:stuck+0.2s', 'lower wheel'),
                              ('brake@encoder_upper:stuck+0.2s', 'upper wheel'),
                              ('brake@encoder_lower:wrong=-1', 'counts backwards')):
            with self.subTest(fault):
                node = self.node('--lock-step', '--start-speed', 60)
                summary = self.folder / 'summary.json'
                result = self.lock_step(node, '--rate', 500, '--set', 'experiment.cut_speed_rad_s=120', '--inject', read,
                                        *(('--inject', fault) if fault else ()), '--summary', summary)
                self.assertEqual(result.returncode, 1 if fault else 0, result.stderr)
                found = self.summary(summary)
                self.assertLess(found['checks_unjudged'], 0.9)
                if fault:
                    self.assertIn(reason, found['reason'])
                self.assertEqual(node.wire(), SAFE)
                node.end()

    def test_lock_step_repeats_to_the_byte(self):
        runs = []
        for name in ('a', 'b'):
            node = self.node('--lock-step', '--start-speed', 60)
            csv = self.folder / name
            result = self.lock_step(node, '--csv', csv, '--set', 'experiment.cut_speed_rad_s=70')
            self.assertEqual(result.returncode, 0, result.stderr)
            runs.append(csv.read_bytes())
        self.assertEqual(runs[0], runs[1])

    def test_nothing_moves_again_by_itself_after_a_run_of_a_series_ended_early(self):
        node = self.node('--lock-step')
        script = self.folder / 'mine.toml'
        script.write_text(SERIES)
        series = ['--backend', 'rig', '--fast', '--no-lcm', '--set', 'driver.kind=can', '--set', 'driver.emulated=true',
                  '--set', f'driver.can.interface={node.interface}', '--experiment', script, '--out', self.folder / 'out']
        result = self.run_program(*series)
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn('run-0001 ended early', result.stdout)
        self.assertIn('1 of 2 runs done', result.stdout)
        self.assertFalse((self.folder / 'out' / 'run-0002').exists())
        result = self.run_program(*series)
        self.assertEqual(result.returncode, 1, result.stderr)
        index = json.loads((self.folder / 'out' / 'series.json').read_text())
        self.assertEqual([run['status'] for run in index['runs']], ['fault', 'completed'])

    def test_broken_node_in_lock_step(self):
        for fault, words in BROKEN:
            with self.subTest(fault):
                node = self.node('--lock-step', '--command', 'supply 24')
                # The fault begins with the run's first cycles, after the handshake, in which no time passes.
                program = self.real_time(node, '--fast', '--set', 'driver.emulated=true', '--set',
                                         'driver.can.answer_timeout_us=8000', '--set', 'experiment.idle_s=60',
                                         '--set', 'experiment.accelerate_limit_s=600')
                while node.time_s() < 0.01:
                    pass
                node.command(f'fault {fault}')
                _, errors = program.communicate(timeout=60)
                self.assertEqual(program.returncode, 1, errors)
                self.assertIn(words, errors)
                node.command('fault ok')
                self.assertEqual(node.wire(), SAFE)

    def test_a_run_without_a_verified_safe_state_has_not_completed(self):
        node = self.node('--lock-step', '--start-speed', 60, '--fault', 'no-deactivate')
        summary = self.folder / 'summary.json'
        result = self.lock_step(node, '--summary', summary, '--set', 'experiment.cut_speed_rad_s=70')
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertIn('the safe state may not have reached the board', result.stderr)
        self.assertEqual(self.summary(summary)['result'], 'fault')
        self.assertIn('could not verify the safe state', self.summary(summary)['reason'])

    def test_fast_needs_lock_step_and_real_time_its_own_time(self):
        node = self.node()
        result = self.lock_step(node)
        self.assertEqual(result.returncode, 3)
        self.assertIn('keeps its own time', result.stderr)
        result = self.run_program(*self.arguments(self.node('--lock-step')))
        self.assertEqual(result.returncode, 3)
        self.assertIn('an emulator in lock-step', result.stderr)

    def test_a_node_without_the_mark_is_real_behind_a_socket_too(self):
        node = self.node('--unmarked')
        for args in WAIVED_FOR_EMULATORS:
            with self.subTest(args):
                result = self.run_program(*self.arguments(node, *args))
                self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn('inactive', node.command('status'))

    def test_bad_input(self):
        node = self.node()
        for setting, status, words in (
                ('driver.can.interface=can99', 3, 'can99'),
                ('driver.can.interface=unix:/nowhere/bus', 3, 'start abs_rig_emulator --can unix:/nowhere/bus'),
                ('driver.can.fd=perhaps', 2, 'auto, on, off'),
                ('driver.can.watchdog_ms=1', 2, '[5, 10000]'),
                ('driver.can.answer_timeout_us=900', 2, 'at most 800 us'),
                ('driver.can.upper_sign=0', 2, 'give 1 or -1'),
                ('gate.brake_duty_max=0.9', 2, 'driver.can.brake_duty_max')):
            with self.subTest(setting):
                result = self.run_program(*self.arguments(node, '--set', setting))
                self.assertEqual(result.returncode, status, result.stderr)
                self.assertIn(words, result.stderr)
        self.assertIn('inactive', node.command('status'))

    def test_what_the_emulated_node_cannot_write_is_refused(self):
        for option in ('--truth', '--record'):
            with self.subTest(option):
                file = self.folder / 'file'
                result = subprocess.run([EMULATOR, '--can', f'unix:{self.folder}/bus', option, file], capture_output=True,
                                        text=True, timeout=20)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn(option, result.stderr)
                self.assertFalse(file.exists())


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
