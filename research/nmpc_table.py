#!/usr/bin/env python3
"""usage: nmpc_table.py --out FOLDER|--tune

Brakes with NMPC on the posterior of `adaptive-optimal` (research/nmpc.py) in all cases of the benchmark, with the first seed, and
with `adaptive-optimal` itself. Writes docs/benchmark.md with its table between the lines <!-- nmpc --> and <!-- end -->, and
docs/reference/nmpc.csv with more figures, below FOLDER. Prints the processor time of a solve.

--tune compares values of the free numbers on other cases: the plants from other speeds, and drawn and combined cases of another
seed. Each number is moved alone, and stays where the score is least: the mean excess over the distance of `adaptive-optimal`, plus
a fifth of that of the worst twentieth, plus one per cent for 60 N m of torque variation, as in the training of its gains.

Needs casadi, a C compiler, and the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import argparse
import dataclasses
import functools
import os
import pathlib
import random
import sys
from collections.abc import Callable

os.environ['OMP_NUM_THREADS'] = '1'
sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
import numpy as np  # noqa: E402
from marked_tables import csv_text, replaced  # noqa: E402
from nmpc import Nmpc, Tuning, compiled, operations  # noqa: E402

import abs_hil  # noqa: E402
from abs_hil.benchmark import Case, Entry, bounds, cases, run  # noqa: E402

LAW = 'adaptive-optimal'
SEEDS = cases.SEEDS[:1]
TUNING_SEED = 20_261_129
TRIED = {'recourse_per_s': (0.0, 60.0, 120.0, 480.0), 'caution': (0.0, 1.0, 2.0, 8.0), 'movement': (3e-4, 3e-3),
         'horizon_s': (0.1, 0.2), 'rest_s': (0.02, 0.1)}


@dataclasses.dataclass(frozen=True)
class Made(Entry):
    """An entry whose object needs to know the case, and so runs in this process."""
    make: Callable[[], object] = object
    without_host = True

    def made(self):
        return self.make()


@functools.cache
def nominal(plant):
    return {name: row['value'] for name, row in abs_hil.keys(plant=plant).items()}


@functools.cache
def functions():
    return compiled()


def braked(chosen, known, tuning):
    """The benchmark's rows of both laws, and the objects of NMPC."""
    rows, made = [], []

    def make(case):
        made.append(Nmpc(case.plant, case.values(nominal(case.plant)), tuning, functions()))
        return made[-1]

    for case in chosen:
        rows += run(Made('nmpc:Nmpc', {}, make=functools.partial(make, case)), [case], known, SEEDS).rows
    return rows, made


@functools.cache
def judged():
    """group -> (rows of NMPC, rows of the law, objects of NMPC)"""
    known, every = bounds.stored(), cases.whole_set()
    rows, made = braked(every, known, Tuning())
    others = run(Entry(LAW, {}), every, known, SEEDS).rows
    groups = {group: [number for number, row in enumerate(rows) if row['group'] == group]
              for group in dict.fromkeys(row['group'] for row in rows)}
    return {group: tuple([of[number] for number in numbers] for of in (rows, others, made))
            for group, numbers in {**groups, 'all': range(len(rows))}.items()}


def figures(rows):
    """Excess in per cent: mean, 90 %, worst; median and largest torque variation; runs that failed."""
    excess = 100.0 * np.array([row['excess'] for row in rows])
    sound = np.isfinite(excess)
    variation = np.array([row['torque_total_variation_Nm'] for row in rows])[sound]
    return (excess[sound].mean(), np.percentile(excess[sound], 90), excess[sound].max(), np.median(variation), variation.max(),
            int((~sound).sum()))


def table():
    """A row for each group."""
    lines = [f'| | NMPC | `{LAW}` |', '|---|---:|---:|']
    for group, laws in judged().items():
        cells = []
        for rows in laws[:2]:
            mean, most, worst, median, _, failed = figures(rows)
            cells.append(f'{mean:.1f}/{most:.1f}/{worst:.1f}/{median:.0f}' + (f' ({failed} failed)' if failed else ''))
        lines.append(f'| {group} | {" | ".join(cells)} |')
    return '\n'.join(lines) + '\n'


def every():
    value, newton = operations()
    rows = []
    for group, (own, others, made) in judged().items():
        solves, steps, newtons, values, failures = (sum(of) for of in zip(*(
            (one.solves, one.solver.steps, one.solver.newtons, one.solver.values, one.failures) for one in made)))
        for name, of, more in (('nmpc', own, [solves, failures, f'{steps / solves:.1f}',
                                              f'{(newtons * newton + values * value) / solves / 1e6:.2f}']),
                               (LAW, others, ['', '', '', ''])):
            rows.append([group, name, len(of), *(f'{number:.1f}' for number in figures(of)[:5]), figures(of)[5], *more])
    return csv_text(['group', 'controller', 'runs', 'excess mean %', '90 % %', 'worst %', 'variation median N m', 'largest N m',
                     'failed', 'solves', 'solves without a solution', 'newton steps a solve', 'million operations a solve'], rows)


def tuning_cases():
    """Twelve: every second one, which takes half the time."""
    generator = random.Random(f'nmpc tuning {TUNING_SEED}')
    plants = [Case('plants', f'{plant} {road}', plant, road, generator.uniform(60.0, 170.0))
              for plant in cases.PLANTS for road in ('even', 'jump', 'patches')]
    return [*plants, *cases.drawn(TUNING_SEED, 8), *cases.combined(TUNING_SEED, 6)][::2]


def tune():
    """Each number in turn."""
    chosen = tuning_cases()
    unit = {bounds.identity(case): {'distance_m': 1.0} for case in chosen}
    same = run(Entry(LAW, {}), chosen, unit, SEEDS).rows
    known = {bounds.identity(case): {'distance_m': row['stop_distance_m']} for case, row in zip(chosen, same)}

    def score(tuning):
        rows, _ = braked(chosen, known, tuning)
        excess = np.sort([10.0 if row['fault'] else min(100.0 * row['excess'], 10.0) for row in rows])
        twentieth = max(1, round(len(excess) / 20))
        varied = np.mean([row['torque_total_variation_Nm'] for row in rows])
        total = excess.mean() + excess[-twentieth:].mean() / 5.0 + varied / 60.0
        print(f'{tuning}: {total:.3f}; mean {excess.mean():.2f} %, worst {excess[-1]:.2f} %, variation {varied:.0f} N m',
              flush=True)
        return total

    best, least = Tuning(), score(Tuning())
    for name, values in TRIED.items():
        for value in values:
            tried = dataclasses.replace(best, **{name: value})
            if tried != best and (total := score(tried)) < least:
                best, least = tried, total
    print(f'least: {best}')
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument('--out', type=pathlib.Path, metavar='FOLDER')
    what.add_argument('--tune', action='store_true')
    o = parser.parse_args()
    if o.tune:
        return tune()
    for file, text in (('benchmark.md', replaced('benchmark.md', 'nmpc', table())), ('reference/nmpc.csv', every())):
        path = o.out / 'docs' / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding='utf-8')
    made = judged()['all'][2]
    print(f'a solve takes {1e3 * sum(one.solving_s for one in made) / sum(one.solves for one in made):.2f} ms of processor time')
    return 0


if __name__ == '__main__':
    sys.exit(main())
