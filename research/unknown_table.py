#!/usr/bin/env python3
"""usage: unknown_table.py --check|--write

Computes how much not knowing tyre or road costs at least (research/unknown.py) in families of the benchmark's cases,
and keeps the table of docs/benchmark.md between the lines <!-- unknown --> and <!-- end -->, and every family in
docs/reference/unknown.csv. Needs casadi and the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import dataclasses
import functools
import math
import os
import pathlib
import sys

os.environ.setdefault('OMP_NUM_THREADS', '1')
sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import csv_text, keep  # noqa: E402
from unknown import ignorance, of_roads, tyre_bound  # noqa: E402

from abs_hil.benchmark import Case, Entry, bounds, cases, run  # noqa: E402
from abs_hil.optimum import Rig, optimum  # noqa: E402
from abs_hil.optimum.road import road_of  # noqa: E402

LAW = 'adaptive-optimal'
THETA_N, B = (10.0, 60.0), (10.0, 40.0)  # what the benchmark draws
PLACES = 6
HEAD = ['group', 'family', 'members', 'optimum that knows m', 'not knowing costs at least %', f'{LAW} %']


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
    """The friction of the benchmark's jump, from other times on; the last one meets the car at 3 m/s."""
    even = dataclasses.replace(case, road='even')
    _, upper, lower = bounds.coasted(even)
    braking = optimum(case.plant, even.plant_values(), start_speed_rad_s=lower, upper_speed_rad_s=upper)
    speeds = braking.states[:, 1] * Rig.of(plant=case.plant, set=even.plant_values())['r2_m']
    last_s = float(braking.time_s[int((speeds > cases.LEAST_AT_DROP_M_S).sum()) - 1])
    times = [last_s * (number + 1) / PLACES for number in range(PLACES)]
    return [_on(case, f'jump at {at:.4f} s', f'braking time: 1; 0.521739 at {at:.4f}') for at in times]


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


def bound(members):
    """Distances of the optima that know the member, and the bound."""
    rigs = [Rig.of(plant=case.plant, set=bounds.values_of(case)) for case in members]
    _, upper, lower = bounds.coasted(members[0])
    start = rigs[0].state(upper, lower)
    found = (ignorance(of_roads(rigs[0], start, [road_of(rig) for rig in rigs], cases.END_SPEED_M_S)) if members[0].profile
             else tyre_bound(rigs, start, cases.END_SPEED_M_S))
    return found.known_m, found.loss


@functools.cache
def rows():
    """(group, family, members, mean distance, bound, excess of the law)"""
    made = []
    for group, name, make in families():
        members = make()
        known_m, loss = bound(members)
        result = run(Entry(LAW, {}), members, {bounds.identity(case): {'distance_m': distance_m}
                                               for case, distance_m in zip(members, known_m)})
        if result.total.failed or result.total.excess_mean < loss:
            sys.exit(f'{group} {name}: {LAW} failed, or brakes shorter than the bound: {result.total.excess_mean:.4f}, {loss:.4f}')
        made.append((group, name, len(members), sum(known_m) / len(known_m), loss, result.total.excess_mean))
    return made


def table():
    lines = ['| families | number | optimum that knows m | not knowing costs at least: mean % | largest % '
             f'| `{LAW}`, mean % |', '|---|---:|---:|---:|---:|---:|']
    for group in dict.fromkeys(row[0] for row in rows()):
        _, _, _, known_m, loss, excess = zip(*(row for row in rows() if row[0] == group))
        count = len(loss)
        lines.append(f'| {group} | {count} | {sum(known_m) / count:.2f} | {100 * sum(loss) / count:.3f} | {100 * max(loss):.3f} '
                     f'| {100 * sum(excess) / count:.1f} |')
    return '\n'.join(lines) + '\n'


def every():
    return csv_text(HEAD, [[group.replace('`', ''), name, count, f'{known_m:.4f}', f'{100 * loss:.4f}', f'{100 * excess:.2f}']
                           for group, name, count, known_m, loss, excess in rows()])


def main():
    if sys.argv[1:] not in (['--check'], ['--write']):
        print(__doc__, file=sys.stderr)
        return 2
    return keep(sys.argv[1], [('benchmark.md', 'unknown', table), ('reference/unknown.csv', None, every)])


if __name__ == '__main__':
    sys.exit(main())
