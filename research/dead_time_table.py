#!/usr/bin/env python3
"""usage: dead_time_table.py [BUILD]

Brakes behind a dead time of the brake, 24 positions of the wheels each, and prints the table "dead time" of
docs/theory-beyond.md: how far above the optimum. On an even road that is the optimum without dead time and v0 Td more, since a
driver who knows everything can only coast for Td. BUILD is build/release by default. Needs casadi and the package abs_hil of a
build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import csv
import pathlib
import statistics
import subprocess
import sys
import tempfile

import abs_hil
from abs_hil.optimum import optimum
from abs_hil.options import settings_of

ROOT = pathlib.Path(__file__).resolve().parent.parent
DEAD_S = 0.024
#: plant, slip that a law is told there
PLANTS = (('paper-table1', 0.05), ('paper-timing', 0.05), ('inteco-manual', 0.2), ('measured-relay', 0.2), ('measured-step', 0.2))
#: law, dead time that it is told over the true one
SHOWN = (('adaptive-optimal', 1.0), ('adaptive-optimal', 0.7), ('adaptive-optimal', 1.3), ('adaptive-predictor', 1.0),
         ('adaptive', 1.0), ('locked', 1.0))
START_RAD_S = 170.0


def distances(build, plant, law, slip, told):
    settings = {'plant.brake_dead_time_s': DEAD_S, 'model.brake_dead_time_s': told * DEAD_S, 'control.slip_ref': slip}
    with tempfile.TemporaryDirectory() as folder:
        runs = pathlib.Path(folder) / 'runs.csv'
        command = [build / 'bin' / 'abs_hil', 'compare', '--plant', plant, '--controllers', law, '--repeat', '24', '--vary',
                   'phase', '--runs', runs]
        for key, value in settings.items():
            command += ['--set', f'{key}={value:g}']
        subprocess.run(command, check=True, capture_output=True, cwd=ROOT)
        with open(runs, encoding='utf-8', newline='') as lines:
            return [float(row['stop_distance_m']) for row in csv.DictReader(lines)]


def main():
    build = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / 'build' / 'release').resolve()
    print('| law, Td told | ' + ' | '.join(plant for plant, _ in PLANTS) + ' |\n|---' + '|---:' * len(PLANTS) + '|')
    bounds = {}
    for plant, _ in PLANTS:
        even = settings_of(['plant.brake_dead_time_s=0', 'plant.brake_release_lead_s=0'])
        found = optimum(plant, even, start_speed_rad_s=START_RAD_S, end_speed_m_s=0.3, knows_road=True)
        bounds[plant] = found.distance_m + START_RAD_S * abs_hil.keys(plant=plant)['plant.r2_m']['value'] * DEAD_S
    for law, told in SHOWN:
        cells = []
        for plant, slip in PLANTS:
            over = [100.0 * (way / bounds[plant] - 1.0) for way in distances(build, plant, law, slip, told)]
            cells.append(f'{statistics.mean(over):.1f}/{max(over):.1f}')
        print(f'| `{law}`' + (f', {told:g} times' if told != 1.0 else '') + ' | ' + ' | '.join(cells) + ' |')


if __name__ == '__main__':
    main()
