#!/usr/bin/env python3
"""usage: eccentricity_table.py --check|--write|--all

What eccentric encoders cost a controller: the mean braking distance over the three plants, relative to the same run with
sound encoders. The eccentricity is not learnt because that is off, or because the run begins with braking; or it is in the
model; or it is learnt while coasting. The table stands
in docs/plants.md between the lines

    <!-- eccentricity -->
    <!-- end -->

--write puts it there, --check fails where the page says something else, --all prints it for all controllers. Needs the package abs_hil of a build
(PYTHONPATH=build/release/share/abs_hil/python).
"""
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import keep  # noqa: E402

import numpy as np

import abs_hil

PLANTS = ('paper-table1', 'paper-timing', 'inteco-manual')
#: in the page: those that eccentricity costs most, and two for comparison
SHOWN = ('adaptive', 'adaptive-peak', 'adaptive-optimal', 'sliding-mode', 'braking-stiffness', 'five-phase')
#: several, because the distance depends on where the discs stand
PHASES_RAD = ((1.0, -2.0), (-2.5, 0.5), (2.5, 2.0), (-0.5, -1.0), (0.3, 3.0), (-1.5, 1.5))


def settings(e_rad, phases_rad, knows):
    values = {} if knows in ('learns', 'too late') else {'control.observer.learn_eccentricity_s': 0.0}
    for wheel, phase_rad in zip(('upper', 'lower'), phases_rad):
        values |= {f'plant.{wheel}_encoder_eccentricity_rad': e_rad, f'plant.{wheel}_encoder_phase_rad': phase_rad}
        if knows != 'model':
            values[f'model.{wheel}_encoder_eccentricity_rad'] = 0.0
    if knows == 'too late':
        values['experiment.start_speed_rad_s'] = 170.0
    return values


def distances_m(controller, e_rad, knows):
    """Shape (plants, phases); NaN for a run that a fault ended."""
    experiment = 'paper' if knows == 'too late' else 'coast-and-brake'
    runs = [{'controller': controller, 'plant': plant, 'experiment': experiment, 'set': settings(e_rad, phases, knows)}
            for plant in PLANTS for phases in PHASES_RAD]
    study = abs_hil.simulate_many(runs)
    found = np.where(study['fault'] == '', study['stop_distance_m'], np.nan)
    return found.reshape(len(PLANTS), len(PHASES_RAD))


def cell(excess):
    faults = int(np.isnan(excess).sum())
    if faults:
        return f'{faults} of {excess.size} runs fail'
    return f'{100 * excess.mean():+.1f} ({100 * excess.max():+.1f})'


def table(controllers=SHOWN):
    columns = [(3e-3, 'unknown'), (1e-2, 'unknown'), (3e-3, 'too late'), (1e-2, 'model'), (1e-2, 'learns')]
    words = {'unknown': 'learning off', 'too late': 'no time to learn', 'model': 'in the model', 'learns': 'learnt'}
    heads = [f'{1e3 * e:g} mrad, {words[knows]}' for e, knows in columns]
    lines = ['| braking distance, % more: mean (worst) | ' + ' | '.join(heads) + ' |', '|---' + '|---:' * len(heads) + '|']
    for controller in controllers:
        sound = {knows: distances_m(controller, 0.0, knows) for knows in ('model', 'too late')}
        cells = [cell(distances_m(controller, e, knows) / sound.get(knows, sound['model']) - 1.0) for e, knows in columns]
        lines.append(f'| `{controller}` | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines) + '\n'


def main():
    if sys.argv[1:] == ['--all']:
        print(table(abs_hil.controllers()), end='')
        return 0
    if sys.argv[1:] not in (['--check'], ['--write']):
        print(__doc__, file=sys.stderr)
        return 2
    return keep(sys.argv[1], [('plants.md', 'eccentricity', table)])


if __name__ == '__main__':
    sys.exit(main())
