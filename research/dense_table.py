#!/usr/bin/env python3
"""usage: dense_table.py --check|--write

Compares the optimum with the dense dynamic programme on even roads, and keeps the table of docs/benchmark.md between the lines
<!-- dense --> and <!-- end -->. --write puts it there, --check fails where the page says something else. Needs casadi and the
package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import os
import pathlib
import sys

os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from dense import Grid, certify  # noqa: E402
from marked_tables import keep  # noqa: E402

from abs_hil.optimum import Rig, optimum  # noqa: E402

COARSE = Grid(slips=30, torques=12, layer_rad_s=2.0, layer_share=0.1)
#: plant, changes, start speed in rad/s, grid: a steep curve needs more slips
CASES = [('paper-table1', {}, 170.0, Grid(slips=100, torques=24)),
         ('paper-timing', {'plant.B': 10.0, 'plant.C': 1.4}, 40.0, COARSE),
         ('inteco-manual', {}, 40.0, COARSE)]


def distances_m(plant, changes, speed_rad_s, grid):
    """Collocation, value and driven distance."""
    rig = Rig.of(plant=plant, set=changes)
    found = optimum(plant, changes, start_speed_rad_s=speed_rad_s,
                    upper_speed_rad_s=speed_rad_s * rig['r2_m'] / rig['r1_m']).distance_m
    dense = certify(plant, changes, start_speed_rad_s=speed_rad_s, grid=grid)
    return found, dense.value_m, dense.driven_m


def table():
    lines = ['| plant, even road | from rad/s | collocation m | dense programme m | its braking, driven m |',
             '|---|---:|---:|---:|---:|']
    for plant, changes, speed_rad_s, grid in CASES:
        found, value, driven = distances_m(plant, changes, speed_rad_s, grid)
        with_ = ', '.join([f'`{plant}`', *(f'`{key}` {amount:.4g}' for key, amount in changes.items())])
        off = [f'{distance:.4f} ({100.0 * (distance / found - 1.0):+.2f} %)' for distance in (value, driven)]
        lines.append(f'| {with_} | {speed_rad_s:g} | {found:.4f} | {off[0]} | {off[1]} |')
    return '\n'.join(lines) + '\n'


def main():
    if sys.argv[1:] not in (['--check'], ['--write']):
        print(__doc__, file=sys.stderr)
        return 2
    return keep(sys.argv[1], [('benchmark.md', 'dense', table)])


if __name__ == '__main__':
    sys.exit(main())
