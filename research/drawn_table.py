#!/usr/bin/env python3
"""usage: drawn_table.py KEPT [--sentences | --combined]

Brakings that docs/theory-beyond.md draws besides the benchmark: 200 cases of a seed under five laws. Prints the table "drawn";
--sentences prints the sentence on the worst of them, --combined that on draws of cases with several things wrong at once, cold
and after a stop. KEPT is the folder of the bounds drawn.json and combined.json, which are computed if they are not there.
Needs the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import pathlib
import sys

import numpy as np
from search_braking_gains import COMBINED_BOUNDS, COMBINED_COUNT, COMBINED_SEEDS

from abs_hil.benchmark import Entry, bounds, cases, run

SEED, COUNT = 27182, 200
#: a draw of combined cases that chose nothing of the law; each case with so many positions of the wheels within a count
HELD_OUT_SEED, PHASES = 20261201, 6
OWN = 'adaptive-optimal'
#: row -> controller, settings
ROWS = {f'`{OWN}`': (OWN, {}), f'`{OWN}` at 5 kHz': (OWN, {'control.rate_Hz': 5000.0}), '`adaptive-peak`': ('adaptive-peak', {}),
        '`braking-stiffness`': ('braking-stiffness', {}), '`mixed-slip-deceleration`': ('mixed-slip-deceleration', {})}


def drawn_cases():
    return cases.drawn(SEED, COUNT)


def figures(name, settings, chosen, kept, seeds=cases.SEEDS, warm=False):
    """The chosen cases that have a bound, excess in per cent of shape (cases, seeds), variation in N m, runs that locked."""
    known = bounds.found(chosen, kept)
    bounded = [case for case in chosen if known[bounds.identity(case)]]
    rows = run(Entry(name, settings, warm), bounded, known, seeds).rows
    excess = 100.0 * np.array([row['excess'] for row in rows]).reshape(len(bounded), len(seeds))
    return (bounded, excess, np.array([row['torque_total_variation_Nm'] for row in rows]),
            sum(row['time_locked_s'] > 0.0 for row in rows))


def table(kept):
    lines = ['| controller | excess: median, mean % | 90 %, worst % | torque variation N m: median, worst | locked |',
             '|---|---:|---:|---:|---:|']
    for words, (name, settings) in ROWS.items():
        _, excess, variation, locked = figures(name, settings, drawn_cases(), kept)
        lines.append(f'| {words} | {np.median(excess):.1f}, {excess.mean():.1f} | {np.quantile(excess, 0.9):.1f}, '
                     f'{excess.max():.1f} | {np.median(variation):.0f}, {variation.max():.0f} | {locked} |')
    return '\n'.join(lines)


def sentences(kept):
    bounded, excess, _, _ = figures(OWN, {}, drawn_cases(), kept)
    worst = bounded[int(np.argmax(excess.max(axis=1)))]
    theta, B, C = (float(worst.changes[key]) for key in ('theta_N', 'B', 'C'))
    faster = excess[[case.start_speed_rad_s >= 80.0 for case in bounded]].max()
    return (f'the worst {excess.max():.1f} % (θ {theta:.0f}, B {B:.0f}, C {C:.1f} from {worst.start_speed_rad_s:.0f} rad/s). '
            f'From 80 rad/s on the worst is {faster:.1f} %.')


def draws(kept):
    """The draws that the gains were searched on, and the held-out one, each with its file of bounds."""
    return [(cases.combined(seed, COMBINED_COUNT), file)
            for seed, file in [*((seed, COMBINED_BOUNDS) for seed in COMBINED_SEEDS), (HELD_OUT_SEED, kept)]]


def combined(kept):
    """A figure for each draw, in their order."""
    phases = tuple(range(1, PHASES + 1))

    def of_draws(warm):
        found = [figures(OWN, {}, chosen, file, phases, warm)[1:3] for chosen, file in draws(kept)]
        excess = [draw for draw, _ in found]
        parts = ([draw.mean() for draw in excess], [np.quantile(draw, 0.9) for draw in excess], [draw.max() for draw in excess])
        return [', '.join(f'{value:.1f}' for value in values) for values in parts], max(most.max() for _, most in found)
    (mean, most, worst), variation_Nm = of_draws(False)
    (warm_mean, warm_most, warm_worst), _ = of_draws(True)
    return (f'mean {mean} %, 90 % {most} %, worst {worst} %, torque variation at most {variation_Nm:.0f} N m; after a stop '
            f'{warm_mean}, {warm_most} and {warm_worst} %.')


def main():
    options = {(): (table, 'drawn.json'), ('--sentences',): (sentences, 'drawn.json'),
               ('--combined',): (combined, 'combined.json')}
    if len(sys.argv) < 2 or tuple(sys.argv[2:]) not in options:
        print(__doc__, file=sys.stderr)
        return 2
    made, file = options[tuple(sys.argv[2:])]
    print(made(pathlib.Path(sys.argv[1]) / file))
    return 0


if __name__ == '__main__':
    sys.exit(main())
