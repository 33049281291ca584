#!/usr/bin/env python3
"""usage: late_release.py [--sentences]

What a late release of the brake costs on steep tyres, whatever the law. A driver brakes with full torque until some time after
the slip has passed the peak, and is optimal from then on (python -m abs_hil.optimum, even road). The last column says when
the encoders could first tell the tyre from one of the same stiffness whose peak is half as far away again: either wheel's
angle is then COUNTS counts off. The cases are the steep tyres at slow starts among those that DRAW draws. Prints the table;
--sentences prints docs/theory-beyond.md's sentence on 10 ms. Needs casadi and the package abs_hil of a build
(PYTHONPATH=build/release/share/abs_hil/python).
"""
import math
import os
import sys

os.environ.setdefault('OMP_NUM_THREADS', '1')

import numpy as np  # noqa: E402

from abs_hil.benchmark import cases  # noqa: E402
from abs_hil.optimum.rig import OMEGA2, SLIP, TORQUE, Rig  # noqa: E402
from abs_hil.optimum.trajectory import NoOptimum, Piece, solve  # noqa: E402

DRAW, COUNT, SHOWN = 7007, 200, 6
STEEP = 60.0  # B C, of the slope at no slip over the peak force
SLOW_RAD_S = 85.0
LATE_S = (0.0, 0.005, 0.010, 0.015)
QUOTED_S = 0.010
FARTHER = 1.5
COUNTS = 4
STEP_S = 1e-4
LAST_S = 0.2


def full_braking(rig, speed_rad_s):
    """States under full torque, shape (steps, 4), and the angles of both wheels, shape (steps, 2), every STEP_S."""
    rates = rig.rates_function()

    def slope(x):
        return rates(x, rig['c31_per_s'] * (rig.max_torque_Nm - x[TORQUE]), 1.0).full().ravel()
    x, angles = rig.state(speed_rad_s * rig['r2_m'] / rig['r1_m'], speed_rad_s), np.zeros(2)
    states, turned = [x], [angles]
    while len(states) * STEP_S < LAST_S and x[SLIP] < 0.5:
        x = x + STEP_S * slope(x + 0.5 * STEP_S * slope(x))
        angles = angles + STEP_S * np.array([float(rig.omega1_rad_s(x)), x[OMEGA2]])
        states.append(x)
        turned.append(angles)
    return np.array(states), np.array(turned)


def told_s(rig, other, speed_rad_s, counts_per_rev):
    """When either wheel's angle is COUNTS counts off the one on the other tyre."""
    one, two = full_braking(rig, speed_rad_s)[1], full_braking(other, speed_rad_s)[1]
    both = min(len(one), len(two))
    apart = np.abs(one[:both] - two[:both]).max(axis=1) * counts_per_rev / (2.0 * math.pi)
    return STEP_S * int(np.argmax(apart > COUNTS))


def cells(case):
    """Of a line of the table."""
    values = {f'plant.{name}': value for name, value in case.changes.items()}
    rig = Rig.of(plant=case.plant, set=values)
    peak = math.tan(math.pi / (2.0 * rig['C'])) / rig['B']
    states, _ = full_braking(rig, case.start_speed_rad_s)
    passed = int(np.argmax(states[:, SLIP] > peak))
    best_m = solve(rig, states[0], 0.0, [Piece(1.0)], cases.END_SPEED_M_S).distance_m
    costs = []
    for late_s in LATE_S:
        at = passed + round(late_s / STEP_S)
        try:
            whole_m = solve(rig, states[at], at * STEP_S, [Piece(1.0)], cases.END_SPEED_M_S).distance_m
            costs.append(f'{100.0 * (whole_m / best_m - 1.0):.1f}')
        except (NoOptimum, IndexError):
            costs.append('–')
    farther = {**values, 'plant.theta_N': FARTHER * rig['theta_N'], 'plant.B': rig['B'] / FARTHER}
    told = told_s(rig, Rig.of(plant=case.plant, set=farther), case.start_speed_rad_s, int(rig['encoder_counts_per_rev']))
    return [case.name, f'{rig["theta_N"]:.0f}, {rig["B"]:.0f}, {rig["C"]:.2f}', f'{case.start_speed_rad_s:.0f}',
            f'{1e3 * passed * STEP_S:.0f}', *costs, f'{1e3 * (told - passed * STEP_S):+.0f}']


def lines():
    chosen = [case for case in cases.drawn(DRAW, COUNT) if float(case.changes['B']) * float(case.changes['C']) > STEEP
              and case.start_speed_rad_s < SLOW_RAD_S][:SHOWN]
    return [cells(case) for case in chosen]


def table():
    heads = ' | '.join(f'{1e3 * late_s:.0f} ms late, %' for late_s in LATE_S)
    return '\n'.join([f'| case | θ, B, C | start rad/s | peak passed at ms | {heads} | told apart, ms after the peak |',
                      '|---|---|---:|---:|' + '---:|' * len(LATE_S) + '---:|',
                      *(f'| {" | ".join(line)} |' for line in lines())])


def sentence():
    column = 4 + LATE_S.index(QUOTED_S)
    lost = sorted((line[column] for line in lines() if line[column] != '–'), key=float)
    return f'releases it {1e3 * QUOTED_S:.0f} ms after the peak, and is optimal then, loses {lost[0]} to {lost[-1]} %'


def main():
    if sys.argv[1:] not in ([], ['--sentences']):
        print(__doc__, file=sys.stderr)
        return 2
    print(sentence() if sys.argv[1:] else table())
    return 0


if __name__ == '__main__':
    sys.exit(main())
