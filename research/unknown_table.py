#!/usr/bin/env python3
"""usage: unknown_table.py --check|--write

Computes how much not knowing tyre or road costs at least (research/unknown.py) in families of the benchmark's cases, those of
GRIDS also with the certificate of research/certificate.py, of which the lower figure counts. Keeps the table of
docs/benchmark.md between the lines <!-- unknown --> and <!-- end -->, and every family in docs/reference/unknown.csv. Needs
casadi and the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import dataclasses
import functools
import math
import os
import pathlib
import sys

os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from certificate import certify  # noqa: E402
from layers import Grid  # noqa: E402
from marked_tables import csv_text, keep  # noqa: E402
from unknown import PERIOD_S, bound, ignorance, of_roads, of_tyres_parting  # noqa: E402

from abs_hil.benchmark import Case, Entry, bounds, cases, run  # noqa: E402
from abs_hil.optimum import Rig, optimum  # noqa: E402
from abs_hil.optimum.rig import road_of  # noqa: E402

LAW = 'adaptive-optimal'
THETA_N, B = (10.0, 60.0), (10.0, 40.0)  # what the benchmark draws
PLACES = 6
HEAD = ['group', 'family', 'members', 'optimum that knows m', 'not knowing costs at least %', 'by collocation %',
        'by the programme on a coarse grid %', 'by the programme %', f'{LAW} %']
#: coarse and fine grids of the families that are certified
GRIDS = {('even road, farthest tyres', '60 rad/s'): (Grid(slips=80, torques=30, speed_share=0.1),
                                                      Grid(slips=120, torques=45, speed_share=0.1)),
         ('jump, drawn rigs', '16'): (Grid(), Grid(torques=40)),
         ('jump, `paper-timing`', '170 rad/s'): (Grid(slips=40, torques=16, speed_share=0.1), Grid(speed_share=0.1)),
         ('patch, `paper-timing`', '170 rad/s'): (Grid(slips=36, torques=16, layer_m=0.04),
                                                  Grid(slips=48, torques=20, layer_m=0.03, speed_share=0.06))}


def partner(case):
    """Another tyre as likely as this one, with the same C and the same force at small slips, theta B C.

    Of theta and B that are drawn evenly and of which theta B is known, log theta is even between two ends. A shift by half of that
    range, around it, keeps the likelihood, so that the mean over pairs is one over what the benchmark draws.
    """
    theta, product = case.changes['theta_N'], case.changes['theta_N'] * case.changes['B']
    low, high = (math.log(value) for value in (max(THETA_N[0], product / B[1]), min(THETA_N[1], product / B[0])))
    other = math.exp(low + (math.log(theta) - low + 0.5 * (high - low)) % (high - low))
    return dataclasses.replace(case, name=f'{case.name}, other tyre',
                               changes={**case.changes, 'theta_N': other, 'B': product / other})


def farthest():
    """The weakest and the strongest tyre with the same force at small slips, from 60 rad/s."""
    steep = 10.0 * 40.0 * 1.9
    both = [{'theta_N': 10.0, 'B': 40.0, 'C': 1.9}, {'theta_N': steep / 10.0 / 1.3, 'B': 10.0, 'C': 1.3}]
    return [Case('drawn', f'farthest {number}', 'paper-table1', 'even', 60.0, changes, ('B', 'C'), cases.ANY_TYRE)
            for number, changes in enumerate(both)]


def drops(case):
    """The friction of the benchmark's jump, from other control periods on; the last one meets the car at 3 m/s."""
    even = dataclasses.replace(case, road='even')
    _, upper, lower = bounds.coasted(even)
    braking = optimum(case.plant, even.plant_values(), start_speed_rad_s=lower, upper_speed_rad_s=upper)
    speeds = braking.states[:, 1] * Rig.of(plant=case.plant, set=even.plant_values())['r2_m']
    last_s = float(braking.time_s[int((speeds > cases.LEAST_AT_DROP_M_S).sum()) - 1])
    step_s = math.floor(last_s / PLACES / PERIOD_S) * PERIOD_S
    times = [step_s * (number + 1) for number in range(PLACES)]
    return [_on(case, f'jump at {at:.3f} s', f'braking time: 1; 0.521739 at {at:.3f}') for at in times]


def patches(plant):
    """One patch of 2 m with half the friction, at other places."""
    return [_on(Case('nominal', '', plant, 'patch'), f'at {at} m', f'braking distance: 1; 0.5 at {at}; 1 at {at + 2}')
            for at in range(1, PLACES + 1)]


def _on(case, name, profile):
    return dataclasses.replace(case, name=f'{case.name} {name}', changes={**case.changes, 'friction_profile': profile})


def families():
    """(group, name, function that makes its cases)"""
    drawn = cases.drawn(cases.DRAW_SEED, cases.DRAWN)
    for case in drawn:
        if case.road == 'even':
            yield 'even road, drawn tyres', case.name, lambda case=case: [case, partner(case)]
    yield 'even road, farthest tyres', '60 rad/s', farthest
    for case in drawn:
        if case.road == 'jump':
            yield 'jump, drawn rigs', case.name, lambda case=case: drops(case)
    for plant in ('paper-table1', 'paper-timing'):
        yield f'jump, `{plant}`', '170 rad/s', lambda plant=plant: drops(Case('nominal', '', plant, 'jump'))
    for plant in ('paper-table1', 'paper-timing'):
        yield f'patch, `{plant}`', '170 rad/s', lambda plant=plant: patches(plant)


def agreements(members):
    """S(n) and the family whose commands agree so long, for each step of the theorem."""
    rigs = [Rig.of(plant=case.plant, set=bounds.values_of(case)) for case in members]
    _, upper, lower = bounds.coasted(members[0])
    start = rigs[0].state(upper, lower)
    if members[0].profile:
        return [(1.0, of_roads(rigs[0], start, [road_of(rig) for rig in rigs], cases.END_SPEED_M_S))]
    return of_tyres_parting(rigs, start, cases.END_SPEED_M_S)


def losses(group, name, members):
    """Distances of the optima that know the member, and the bounds: what counts, of the collocation, of the programme on both
    grids; the latter are None without a certificate."""
    steps = agreements(members)
    found = [(family, ignorance(family)) for _, family in steps]
    every = [[one.loss for _, one in found]]
    every += [[one.loss for one in certify(found, grid)] for grid in GRIDS.get((group, name), ())]
    counts = [min(one) for one in zip(every[0], every[-1])]
    made = [bound((agree, loss) for (agree, _), loss in zip(steps, each)) for each in (counts, *every)]
    return found[-1][1].known_m, made + [None] * (4 - len(made))


@functools.cache
def rows():
    """(group, family, members, mean distance, bounds, excess of the law)"""
    made = []
    for group, name, make in families():
        members = make()
        known_m, each = losses(group, name, members)
        result = run(Entry(LAW, {}), members, {bounds.identity(case): {'distance_m': distance_m}
                                               for case, distance_m in zip(members, known_m)})
        if result.total.failed or result.total.excess_mean < each[0]:
            sys.exit(f'{group} {name}: {LAW} failed, or brakes shorter than the bound: {result.total.excess_mean:.4f}, '
                     f'{each[0]:.4f}')
        made.append((group, name, len(members), sum(known_m) / len(known_m), each, result.total.excess_mean))
    return made


def table():
    lines = ['| families | number | optimum that knows m | not knowing costs at least: mean % | largest % '
             f'| `{LAW}`, mean % |', '|---|---:|---:|---:|---:|---:|']
    for group in dict.fromkeys(row[0] for row in rows()):
        _, _, _, known_m, each, excess = zip(*(row for row in rows() if row[0] == group))
        count, loss = len(each), [one[0] for one in each]
        lines.append(f'| {group} | {count} | {sum(known_m) / count:.2f} | {100 * sum(loss) / count:.3f} | {100 * max(loss):.3f} '
                     f'| {100 * sum(excess) / count:.1f} |')
    return '\n'.join(lines) + '\n'


def every():
    return csv_text(HEAD, [[group.replace('`', ''), name, count, f'{known_m:.4f}',
                            *('' if one is None else f'{100 * one:.4f}' for one in each), f'{100 * excess:.2f}']
                           for group, name, count, known_m, each, excess in rows()])


def main():
    if sys.argv[1:] not in (['--check'], ['--write']):
        print(__doc__, file=sys.stderr)
        return 2
    return keep(sys.argv[1], [('benchmark.md', 'unknown', table), ('reference/unknown.csv', None, every)])


if __name__ == '__main__':
    sys.exit(main())
