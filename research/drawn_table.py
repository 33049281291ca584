#!/usr/bin/env python3
"""usage: drawn_table.py KEPT [--combined | --warm | --sentences]

Brakings that docs/theory-beyond.md draws besides the benchmark: 200 cases of a seed under five laws. Prints the table "drawn";
--sentences prints the sentence on the worst of them, --combined that on two draws of cases with several things wrong at once,
--warm that on three such draws after a stop. KEPT is the folder of the bounds drawn.json and combined.json, which
research/benchmark_bounds.py computes. Needs the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import pathlib
import sys

import numpy as np

from abs_hil.benchmark import Entry, bounds, cases, run

SEED, COUNT = 27182, 200
COMBINED_SEEDS, COMBINED_COUNT, COMBINED_PHASES = (20261126, 20261127), 110, 6
#: the last one chose nothing of the law
WARM_SEEDS = (*COMBINED_SEEDS, 20261128)
OWN = 'adaptive-optimal'
#: row -> controller, settings
ROWS = {f'`{OWN}`': (OWN, {}), f'`{OWN}` at 5 kHz': (OWN, {'control.rate_Hz': 5000.0}), '`adaptive-peak`': ('adaptive-peak', {}),
        '`braking-stiffness`': ('braking-stiffness', {}), '`mixed-slip-deceleration`': ('mixed-slip-deceleration', {})}


def drawn_cases():
    return cases.drawn(SEED, COUNT)


def combined_cases():
    """Two draws, and those of the benchmark."""
    return [*(case for seed in COMBINED_SEEDS for case in cases.combined(seed, COMBINED_COUNT)),
            *(case for case in cases.whole_set() if case.group == 'combined')]


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


def combined(kept):
    _, excess, variation, _ = figures(OWN, {}, combined_cases(), kept, tuple(range(1, COMBINED_PHASES + 1)))
    return (f"seeds each: mean {excess.mean():.1f} %, 90 % {np.quantile(excess, 0.9):.1f} %, worst {excess.max():.1f} %, "
            f'torque variation at most {variation.max():.0f} N m.')


def warm(kept):
    def of_draws(warm):
        draws = [figures(OWN, {}, cases.combined(seed, COMBINED_COUNT), kept, warm=warm)[1] for seed in WARM_SEEDS]
        return [', '.join(f'{value:.1f}' for value in values) for values in
                ([draw.mean() for draw in draws], [np.quantile(draw, 0.9) for draw in draws], [draw.max() for draw in draws])]
    (mean, most, worst), (warm_mean, warm_most, warm_worst) = of_draws(False), of_draws(True)
    return (f'seed {WARM_SEEDS[-1]}, two seeds each: mean {mean} %, 90 % {most} %, worst {worst} %; after a stop {warm_mean}, '
            f'{warm_most} and {warm_worst} %.')


def main():
    options = {(): (table, 'drawn.json'), ('--sentences',): (sentences, 'drawn.json'),
               ('--combined',): (combined, 'combined.json'), ('--warm',): (warm, 'combined.json')}
    if len(sys.argv) < 2 or tuple(sys.argv[2:]) not in options:
        print(__doc__, file=sys.stderr)
        return 2
    made, file = options[tuple(sys.argv[2:])]
    print(made(pathlib.Path(sys.argv[1]) / file))
    return 0


if __name__ == '__main__':
    sys.exit(main())
