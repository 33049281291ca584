#!/usr/bin/env python3
"""usage: braking_table.py --check|--write

Keeps two tables of adaptive-optimal in docs/theory-beyond.md, next to adaptive-peak: the three plants on three roads, at
1 kHz and at 5 kHz, between the lines <!-- braking --> and <!-- end -->; and the same nine with one thing wrong, between
<!-- braking mismatch --> and <!-- end -->. Cases and bounds are those of the benchmark. --write puts them there, --check
fails where the page says something else. Needs the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import keep  # noqa: E402

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
    lines = ['| plant, road | bound m | above it % | torque variation N m | at 5 kHz above it % | N m '
             '| `adaptive-peak` above it % | N m |', '|---|---:|---:|---:|---:|---:|---:|---:|']

    def both(values, digits):
        return f'{values.mean():.{digits}f} ({values.max():.{digits}f})'
    for number, case in enumerate(chosen):
        bound = bounds.stored()[bounds.identity(case)]
        columns = [text for one in (own, fast, peak) for text in (both(one[0][number], 1), both(one[1][number], 0))]
        lines.append(f'| {case.plant}, {case.road} | {bound["distance_m"]:.3f} | ' + ' | '.join(columns) + ' |')
    columns = [text for one in (own, fast, peak) for text in (both(one[0], 1), both(one[1], 0))]
    lines.append('| all nine | | ' + ' | '.join(columns) + ' |')
    locked = sum(int((one[2] > 0).sum()) for one in (own, fast))
    return '\n'.join(lines) + f'\n\nMean of five seeds, the largest in brackets. Locked above 3 m/s: {locked} runs.\n'


def mismatches():
    chosen = [case for case in cases.whole_set() if case.group == 'mismatch']
    own, peak = figures('adaptive-optimal', chosen), figures('adaptive-peak', chosen)
    lines = ['| wrong | above the bound %: mean, worst | worst in | torque variation N m: median, worst '
             '| `adaptive-peak` %: mean, worst | N m: median, worst |', '|---|---:|---|---:|---:|---:|']
    for name in cases.MISMATCHES:
        rows = [number for number, case in enumerate(chosen) if case.name == name]
        worst = chosen[rows[int(np.argmax(own[0][rows].max(axis=1)))]]
        columns = []
        for excess, variation, _ in (own, peak):
            columns.append(f'{excess[rows].mean():.1f}, {excess[rows].max():.1f}')
            columns.append(f'{np.median(variation[rows]):.0f}, {variation[rows].max():.0f}')
        lines.append(f'| {name} | {columns[0]} | {worst.plant}, {worst.road} | ' + ' | '.join(columns[1:]) + ' |')
    return '\n'.join(lines) + '\n'


def main():
    if sys.argv[1:] not in (['--check'], ['--write']):
        print(__doc__, file=sys.stderr)
        return 2
    return keep(sys.argv[1], [('theory-beyond.md', 'braking', cells), ('theory-beyond.md', 'braking mismatch', mismatches)])


if __name__ == '__main__':
    sys.exit(main())
