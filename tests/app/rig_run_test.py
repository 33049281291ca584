"""The paper's experiment through --backend rig, on the emulated card in another process."""
import pathlib
import re
import unittest

from rig_emulator import RigTest, skip_unless_possible

DOCUMENT = pathlib.Path(__file__).parents[2] / 'docs' / 'rig-setup.md'


def documented_cycle():
    """The accesses of one cycle according to docs/rig-setup.md: (direction, offset, value or its name)."""
    block = re.search(r'```register-traffic\n(.*?)```', DOCUMENT.read_text(), re.S).group(1)
    return [tuple(line.split('#')[0].split()) for line in block.splitlines() if line.strip()]


class RigRun(RigTest):
    def test_lock_step_agrees_with_the_simulator(self):
        emulator = self.emulator('--lock-step')
        rig, sim = self.folder / 'rig.json', self.folder / 'sim.json'
        result = self.lock_step(emulator, '--summary', rig)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('not verified on hardware', result.stderr)
        self.assertIn('12 register accesses a cycle', result.stderr)
        # The rig's brake is capped at 0.7, so the comparison uses the same cap.
        self.fast('--summary', sim, '--set', 'gate.brake_duty_max=0.7')
        r, s = self.summary(rig), self.summary(sim)
        self.assertEqual(r['config']['gate']['brake_duty_max'], 0.7)
        for key in ('stop_time_s', 'stop_distance_m', 'theta_final_N', 'brake_start_s'):
            self.assertAlmostEqual(r[key] / s[key], 1.0, delta=0.01, msg=key)
        self.assertEqual(emulator.wire(), (0.0, 0.0))

    def test_a_rig_has_a_model_and_no_plant(self):
        emulator = self.emulator('--lock-step', '--start-speed', 60)
        summary, log = self.folder / 'rig.json', self.folder / 'rig.lcmlog'
        short = ('--set', 'experiment.cut_speed_rad_s=70')
        result = self.lock_step(emulator, *short, '--model', 'paper-table1', '--set', 'model.theta_N=24', '--summary',
                                summary, '--log', log)
        self.assertEqual(result.returncode, 0, result.stderr)
        found = self.summary(summary)
        self.assertNotIn('plant', found['config'])
        self.assertEqual((len(found['config']['model']), found['config']['model']['theta_N']), (29, 24.0))
        self.assertEqual((found['model'], found['model_differences']), ('paper-table1', None))
        replayed = self.run_program('replay', log, '--check')
        self.assertEqual(replayed.returncode, 0, replayed.stderr)
        refused = self.run_program('replay', log, '--controller', 'pi', '--set', 'plant.theta_N=30')
        self.assertEqual(refused.returncode, 2, refused.stderr)
        self.assertIn('model.theta_N', refused.stderr)

    def test_replay_of_runs_whose_commands_the_board_did_not_take(self):
        log = self.folder / 'rig.lcmlog'
        for fault, reason in (('accelerate@write:off+0.1s', 'writing'), ('brake@write:off+0.1s', 'writing'),
                              ('brake@write:intermittent+0.1s', 'writing'), ('brake@write:stuck+0.1s', ''),
                              ('brake@brake_pwm:off+0.1s', 'brake')):
            with self.subTest(fault):
                emulator = self.emulator('--lock-step', '--start-speed', 60)
                result = self.lock_step(emulator, '--set', 'experiment.cut_speed_rad_s=70', '--inject', fault, '--log', log)
                self.assertEqual(result.returncode, 1, result.stderr)
                self.assertIn(reason, result.stderr.splitlines()[-1])
                emulator.end()
                replayed = self.run_program('replay', log, '--check')
                self.assertEqual(replayed.returncode, 0, replayed.stdout + replayed.stderr)
                self.assertIn('bit-equal', replayed.stdout)

    def test_lock_step_repeats_to_the_byte(self):
        runs = []
        for name in ('a', 'b'):
            emulator = self.emulator('--lock-step', '--start-speed', 60)
            csv = self.folder / name
            self.assertEqual(self.lock_step(emulator, '--csv', csv, '--set', 'experiment.cut_speed_rad_s=70').returncode,
                             0)
            emulator.end()
            runs.append(csv.read_bytes())
        self.assertEqual(runs[0], runs[1])

    def test_no_ground_truth_reaches_the_client(self):
        emulator = self.emulator('--lock-step')
        csv = self.folder / 'run.csv'
        self.assertEqual(self.lock_step(emulator, '--csv', csv, '--set', 'experiment.cut_speed_rad_s=30').returncode, 0)
        for row in self.rows(csv):
            for column in ('omega1_rad_s', 'omega2_rad_s', 'slip', 'brake_torque_Nm', 'theta_N'):
                self.assertEqual(row[column], 'NaN', column)
        emulator.end()
        truth = self.rows(emulator.truth)
        self.assertAlmostEqual(max(float(row['omega1_rad_s']) for row in truth), 30, delta=1)

    def test_traffic_of_a_cycle_is_the_documented_one(self):
        traffic = self.folder / 'traffic'
        emulator = self.emulator('--lock-step', '--record', traffic)
        csv = self.folder / 'run.csv'
        self.assertEqual(self.lock_step(emulator, '--csv', csv, '--set', 'experiment.cut_speed_rad_s=30').returncode, 0)
        emulator.end()
        accesses = [line.split() for line in traffic.read_text().splitlines()]
        cycle = documented_cycle()
        self.assertEqual(len(cycle), 12)
        cycles = len(self.rows(csv))
        in_turn = ('AC', '38', 'B4', 'B8')
        settings = ('64', '00', '64', '04', '64', '68', '64', '68', '64', '50', '64', '5C', '64', 'A4', '64', 'A8')
        of_drive = (0, 4, 5, 8, 12)  # read while the index is 0
        # Before the first cycle: two reads of `configure`, and the take-over. After the last one: the safe state.
        start = next(i for i in range(2, len(accesses)) if accesses[i][1] == 'B8') + 1 + 2 * len(settings)
        self.assertEqual(len(accesses), start + cycles * len(cycle) + 6)
        last = {'0': '00000000', '1': '00000000'}  # the width of each PWM
        for number in range(cycles):
            expected, index, turn = list(cycle), '', number % len(settings)
            if turn in of_drive:
                expected.insert(8, expected.pop())
            for place, (direction, offset, value) in enumerate(expected):
                got = accesses[start + number * len(cycle) + place]
                wanted = {'health': in_turn[number % 4], 'setting': settings[turn]}.get(offset, offset)
                self.assertEqual(got[:2], [direction, wanted], f'cycle {number}, access {place}')
                if value in ('0', '1'):
                    self.assertEqual(int(got[2], 16), int(value), f'cycle {number}, access {place}')
                    index = value
                if value == 'last':
                    self.assertEqual(got[2], last[index])
                if value == 'width':
                    last[index] = got[2]
        self.assertEqual([' '.join(a) for a in accesses[-6:]],
                         ['W 60 00000000', 'W 6C 00000000', 'R 6C 00000000', 'W 60 00000001', 'W 6C 00000000',
                          'R 6C 00000000'])

    def test_fast_needs_an_emulator_in_lock_step(self):
        emulator = self.emulator()
        result = self.run_program('--backend', 'rig', '--fast', '--no-lcm', '--set', f'driver.pci.root={emulator.root}')
        self.assertEqual(result.returncode, 2)
        self.assertIn('driver.emulated=true', result.stderr)
        result = self.lock_step(emulator)
        self.assertEqual(result.returncode, 3)
        self.assertIn('keeps its own time: it is hardware', result.stderr)


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main()
