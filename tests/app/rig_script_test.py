"""One experiment file of a user's own, unchanged, in the simulator and on the emulated card; and the report of a rig run,
which has no truth."""
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

from program import PROGRAM
from rig_emulator import RigTest, skip_unless_possible

sys.path.append(str(pathlib.Path(__file__).parents[1] / 'report'))
from page_reader import PageReader  # noqa: E402

REPORT = os.path.join(os.path.dirname(os.path.abspath(PROGRAM)), 'abs_report')
PACKAGE = pathlib.Path(PROGRAM).resolve().parents[1] / 'share/abs_hil/python/abs_hil'
TOLERANCE = 0.01

SCRIPT = '''
description = "run up in two steps, brake first with a torque, then under slip control"

[[phase]]
name = "push"
motor = { points = [[0, 0.4], [1, 0.9]] }
until.any = [{ lower_speed_above = "900 rpm" }, { upper_wheel_peak_s = 0.5 }]
at_most_s = 20

[[phase]]
name = "roll"
until = { lasts = "300 ms" }

[[phase]]
name = "touch"
brake = { torque_Nm = { from = 0, to = 0.8, over_s = 0.5 } }
until.all = [{ upper_speed_below_rad_s = 88 }, { distance_m = 1 }]
at_most_s = 5

[[phase]]
name = "slip"
brake = { slip_ref = { before = 0.05, after = 0.1, at_s = 0.2 } }
until = { car_speed_below = "2 km/h" }
at_most_s = 10

[[phase]]
name = "stand"
kind = "hold"
brake = { duty = "60 %" }
until = { standstill = true }
at_most_s = 10

[limits]
wheel_speed_rad_s = 120
brake_duty = 0.7
'''


class RigScript(RigTest):
    def script(self, text=SCRIPT):
        path = self.folder / 'own.toml'
        path.write_text(text)
        return path

    def on_the_card(self, *args):
        result = self.lock_step(self.emulator('--lock-step'), *args)
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_the_same_file_in_simulation_and_on_the_card(self):
        path, rig, sim = self.script(), self.folder / 'rig', self.folder / 'sim'
        self.on_the_card('--experiment', path, '--out', rig)
        self.fast('--experiment', path, '--out', sim)
        self.assertEqual((rig / 'experiment.toml').read_text(), (sim / 'experiment.toml').read_text())
        phases = {folder: [row for row in self.rows(folder / 'events.csv') if row['event'] == 'phase']
                  for folder in (rig, sim)}
        words = [(row['phase'], row['reason']) for row in phases[sim]]
        self.assertEqual([phase for phase, _ in words],
                         ['accelerate', 'coast', 'brake', 'brake', 'hold', 'stopped'])
        self.assertEqual([(row['phase'], row['reason']) for row in phases[rig]], words)
        for r, s in zip(phases[rig][1:], phases[sim][1:]):
            self.assertAlmostEqual(float(r['time_s']) / float(s['time_s']), 1.0, delta=TOLERANCE, msg=r)
        r, s = self.summary(rig / 'summary.json'), self.summary(sim / 'summary.json')
        self.assertEqual((r['backend'], s['backend']), ('rig', 'sim'))
        for key in ('brake_start_s', 'stop_time_s', 'stop_distance_m'):
            self.assertAlmostEqual(r[key] / s[key], 1.0, delta=TOLERANCE, msg=key)
        way = [float(self.rows(folder / 'run.csv')[-1]['distance_m']) for folder in (rig, sim)]
        self.assertAlmostEqual(way[0] / way[1], 1.0, delta=TOLERANCE)

    def test_with_events_it_is_refused_on_the_card_by_name(self):
        path = self.script(SCRIPT + '\n[[event]]\nat_s = 0.5\nover_s = 1\ncounted_from = "braking"\nbrake_torque = 0.7\n')
        self.fast('--experiment', path)
        emulator = self.emulator('--lock-step')
        result = self.lock_step(emulator, '--experiment', path)
        self.assertEqual(result.returncode, 2, result.stderr)
        line = 2 + SCRIPT.count('\n')
        self.assertIn(f'own.toml:{line}:1: [[event]] brake_torque: only a simulated plant', result.stderr)
        self.assertEqual(emulator.wire(), (0.0, 0.0))

    def test_report_of_a_rig_run(self):
        if not any(PACKAGE.glob('_core*.so')):
            self.skipTest('this build has no Python package (ABS_HIL_PYTHON)')
        rig, sim, page = self.folder / 'rig', self.folder / 'sim', self.folder / 'page.html'
        self.on_the_card('--experiment', self.script(), '--controller', 'adaptive', '--out', rig)
        self.fast('--experiment', self.script(), '--controller', 'adaptive', '--out', sim)

        def report(*runs):
            result = subprocess.run([REPORT, *map(str, runs), '--output', page, '--force'], capture_output=True, text=True,
                                    timeout=120, cwd=self.folder)
            self.assertEqual(result.returncode, 0, result.stderr)
            return page.read_text()

        read = PageReader(report(rig))
        text = page.read_text()
        self.assertEqual(read.cell('metrics', 'speeds and slip'), 'estimates')
        self.assertIn('Runs without true values show estimates from the encoders', text)
        self.assertIn('have no true θ', text)
        # The true θ is unknown, so neither it nor the error is drawn; values from the encoders are.
        self.assertEqual([curve['quantity'] for curve in read.figures['fig9']], ['theta_est'])
        for figure in ('fig5', 'fig6', 'fig7', 'fig8', 'fig10'):
            self.assertGreater(max(curve['drawn'] for curve in read.figures[figure]), 50, figure)
        # A simulated run on the same page shows its truth.
        read = PageReader(report(rig, sim))
        self.assertEqual([read.cell('metrics', 'speeds and slip', run) for run in (1, 2)], ['estimates', 'truth'])
        self.assertEqual({(curve['run'], curve['quantity']) for curve in read.figures['fig9']
                          if curve['quantity'] == 'theta'}, {(2, 'theta')})


if __name__ == '__main__':
    skip_unless_possible()
    unittest.main(verbosity=2)
