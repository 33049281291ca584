#!/usr/bin/env python3
"""usage: other_roads.py SEED COUNT BOUNDS [--all]

Brakes on roads and tyres that are in no table and no training: SEED draws COUNT of them. A fourth of the roads each is even,
changes in steps, in straight lines, or in stripes. Prints how far above the causal optimum some laws end: the table
"other roads" of docs/theory-beyond.md, or, with --all, each law on each kind of road. The optima are kept in the file BOUNDS,
so that another run needs not compute them again. Needs casadi and the package abs_hil of a build
(PYTHONPATH=build/release/share/abs_hil/python).
"""
import os
import pathlib
import random
import sys

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np  # noqa: E402

from abs_hil.benchmark import Case, Entry, bounds, run  # noqa: E402
from abs_hil.benchmark.cases import ANY_TYRE  # noqa: E402

#: law, road of the page's table; '' for all
SHOWN = (('adaptive-optimal', 'even'), ('adaptive-optimal', 'stripes'), ('adaptive-optimal', ''), ('adaptive-peak', ''))
LAWS = ('adaptive-optimal', 'adaptive-peak')
SEEDS = (1, 2)
LEVELS = (0.35, 1.0)


def steps(generator):
    at, parts = 0.0, [f'{generator.uniform(*LEVELS):.2f}']
    for _ in range(3):
        at += generator.uniform(0.2, 0.5)
        parts.append(f'{generator.uniform(*LEVELS):.2f} at {at:.2f}')
    return 'braking time: ' + '; '.join(parts)


def lines(generator):
    at, parts = 0.0, [f'{generator.uniform(*LEVELS):.2f}']
    for _ in range(3):
        start = at + generator.uniform(0.1, 0.4)
        at = start + generator.uniform(0.1, 0.6)
        parts.append(f'{generator.uniform(*LEVELS):.2f} from {start:.2f} to {at:.2f}')
    return 'braking time: ' + '; '.join(parts)


def stripes(generator):
    high = generator.uniform(0.7, 1.0)
    both, length = (high, high * generator.uniform(0.5, 0.8)), generator.uniform(1.5, 4.0)
    return f'braking distance: {high:.2f}; ' + '; '.join(f'{both[k % 2]:.2f} at {k * length:.2f}' for k in range(1, 25))


ROADS = {'even': lambda generator: f'braking time: {generator.uniform(*LEVELS):.2f}', 'steps': steps, 'lines': lines,
         'stripes': stripes}


def drawn(seed, count):
    cases = []
    for number in range(count):
        generator = random.Random(f'abs_hil other roads {seed} {number}')
        road = list(ROADS)[number % len(ROADS)]
        changes = {'theta_N': generator.uniform(10.0, 60.0), 'B': generator.uniform(10.0, 40.0),
                   'C': generator.uniform(1.3, 1.9)}
        speed = generator.uniform(120.0, 180.0)
        changes['friction_profile'] = ROADS[road](generator)
        cases.append(Case(road, f'{number}', 'paper-table1', 'even', speed, changes, ('B', 'C'), ANY_TYRE))
    return cases


def main():
    if len(sys.argv) < 4 or not all(text.isdigit() for text in sys.argv[1:3]) or sys.argv[4:] not in ([], ['--all']):
        print(__doc__, file=sys.stderr)
        return 2
    cases = drawn(int(sys.argv[1]), int(sys.argv[2]))
    known = bounds.found(cases, pathlib.Path(sys.argv[3]))
    cases = [case for case in cases if known[bounds.identity(case)]]
    print('| law, roads | cases | above the bound %: mean, worst | torque variation N m: median, worst | locked |\n'
          '|---|---:|---:|---:|---:|')
    for law in LAWS:
        rows = run(Entry(law, {}), cases, known, SEEDS).rows
        for road in (*ROADS, ''):
            if (law, road) not in SHOWN and not sys.argv[4:]:
                continue
            chosen = [row for case, row in zip(np.repeat(cases, len(SEEDS)), rows) if road in ('', case.group)]
            excess = 100.0 * np.array([row['excess'] for row in chosen])
            variation = np.array([row['torque_total_variation_Nm'] for row in chosen])
            locked = sum(row['time_locked_s'] > 0.0 for row in chosen)
            print(f'| `{law}`, {road or "all"} | {len(chosen) // len(SEEDS)} | {excess.mean():.1f}, {excess.max():.1f} '
                  f'| {np.median(variation):.0f}, {variation.max():.0f} | {locked} |')
    return 0


if __name__ == '__main__':
    sys.exit(main())
