#!/usr/bin/env python3
"""usage: braking_table.py --check|--write

Keeps two tables of adaptive-optimal for docs/theory-beyond.md, next to adaptive-peak: the three plants on three roads, at
1 kHz and at 5 kHz, in docs/reference/braking.csv; and the same nine with one thing wrong, in
docs/reference/braking-mismatch.csv. Cases and bounds are those of the benchmark. --write puts them there, --check fails where a
file says something else. Needs the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import csv_text, keep  # noqa: E402

import numpy as np


from abs_hil.benchmark import Entry, bounds, cases, run

ROADS = ('even', 'jump', 'patches')
SEEDS = (1, 2, 3, 4, 5)
FAST = {'control.rate_Hz': 5000.0}


def figures(name, chosen, settings=None):
    """Excess in per cent, torque variation in N m, largest slip and time locked, each of shape (cases, seeds)."""
    result = run(Entry(name, settings or {}), chosen, bounds.stored(), SEEDS)

    def of(column):
        return np.array([row[column] for row in result.rows], dtype=float).reshape(len(chosen), len(SEEDS))
    return 100.0 * of('excess'), of('torque_total_variation_Nm'), of('time_locked_s')


def cells():
    chosen = [case for case in cases.whole_set() if case.group == 'nominal' and case.road in ROADS]
    own, peak = figures('adaptive-optimal', chosen), figures('adaptive-peak', chosen)
    fast = figures('adaptive-optimal', chosen, FAST)
    rows = []
    for law, (excess, variation, locked) in (('adaptive-optimal', own), ('adaptive-optimal at 5 kHz', fast), ('adaptive-peak', peak)):
        for number, case in enumerate(chosen):
            rows.append([law, case.plant, case.road, f'{bounds.stored()[bounds.identity(case)]["distance_m"]:.3f}',
                         f'{excess[number].mean():.1f}', f'{excess[number].max():.1f}', f'{variation[number].mean():.0f}',
                         f'{variation[number].max():.0f}', str(int((locked[number] > 0).sum()))])
    return csv_text(['controller', 'plant', 'road', 'bound_m', 'excess_mean_percent', 'excess_worst_percent',
                     'torque_variation_mean_Nm', 'torque_variation_worst_Nm', 'runs_locked'], rows)


def mismatches():
    chosen = [case for case in cases.whole_set() if case.group == 'mismatch']
    own, peak = figures('adaptive-optimal', chosen), figures('adaptive-peak', chosen)
    lines = []
    for name in cases.MISMATCHES:
        rows = [number for number, case in enumerate(chosen) if case.name == name]
        for law, (excess, variation, _) in (('adaptive-optimal', own), ('adaptive-peak', peak)):
            worst = chosen[rows[int(np.argmax(excess[rows].max(axis=1)))]]
            lines.append([name, law, f'{excess[rows].mean():.1f}', f'{excess[rows].max():.1f}', worst.plant, worst.road,
                          f'{np.median(variation[rows]):.0f}', f'{variation[rows].max():.0f}'])
    return csv_text(['wrong', 'controller', 'excess_mean_percent', 'excess_worst_percent', 'worst_plant', 'worst_road',
                     'torque_variation_median_Nm', 'torque_variation_worst_Nm'], lines)


def main():
    if sys.argv[1:] not in (['--check'], ['--write']):
        print(__doc__, file=sys.stderr)
        return 2
    return keep(sys.argv[1], [('reference/braking.csv', None, cells), ('reference/braking-mismatch.csv', None, mismatches)])


if __name__ == '__main__':
    sys.exit(main())
