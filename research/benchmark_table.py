#!/usr/bin/env python3
"""usage: benchmark_table.py --check|--write

Keeps the tables of docs/benchmark.md: the standing of all controllers, over all cases and over the groups of combined
mismatches and of the capped brake; what version 2 changed; the bounds of the nominal cases. Each stands between a line
<!-- NAME --> and <!-- end -->. --write puts them there, --check fails where the page says something else. Needs the package
abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import functools
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import keep  # noqa: E402


import abs_hil
from abs_hil.benchmark import Entry, bounds, cases, page, run


#: excess in per cent over the 126 cases of version 1, mean and worst, as version 1 published them with its own bounds
BEFORE = {
    'adaptive-optimal': (1.7, 9.2), 'adaptive-peak': (2.9, 19.7), 'braking-stiffness': (6.5, 23.2),
    'mixed-slip-deceleration': (10.4, 48.2), 'relay': (11.8, 50.7), 'adaptive-actuator': (14.2, 50.4),
    'sliding-mode-actuator': (14.4, 53.3), 'pi': (17.2, 146.7), 'nominal': (19.3, 72.0), 'adaptive': (20.7, 76.1),
    'sliding-mode-smooth': (20.8, 92.1), 'super-twisting': (21.1, 65.5), 'sliding-mode': (30.1, 77.4),
    'five-phase': (33.8, 129.5), 'locked': (42.8, 158.8)}


def of_version_1(case):
    """Version 1 had neither the last two groups nor a limited rate on patches."""
    return case.group not in ('capped', 'combined') and not (case.road == 'patches' and case.name.startswith('rate'))


@functools.cache
def results():
    known = bounds.stored()
    return [run(Entry(name, {}), cases.whole_set(), known) for name in abs_hil.controllers()]


def standing(group='all'):
    return page.table(results(), group)


def changed():
    same = {case.key for case in cases.whole_set() if of_version_1(case)}
    lines = ['| excess %: mean, worst | version 1 | version 2, the same 126 cases | version 2, all |', '|---|---:|---:|---:|']
    for name, score in page.ranked(results()):
        result = next(one for one in results() if one.entry.name == name)
        excess = [100.0 * row['excess'] for row in result.rows if row['case'] in same]
        mean, worst = BEFORE[name]
        lines.append(f'| `{name}` | {mean:.1f}, {worst:.1f} | {sum(excess) / len(excess):.1f}, {max(excess):.1f} '
                     f'| {100.0 * score.excess_mean:.1f}, {100.0 * score.excess_worst:.1f} |')
    return '\n'.join(lines) + '\n'


def nominal_bounds():
    known = bounds.stored()
    lines = ['| distance m (time s), variation N m | ' + ' | '.join(f'`{plant}`' for plant in cases.PLANTS) + ' |',
             '|---' + '|---:' * len(cases.PLANTS) + '|']
    largest = 0.0
    for road in cases.ROADS:
        cells = []
        for case in (case for case in cases.whole_set() if case.group == 'nominal' and case.road == road):
            bound = known[bounds.identity(case)]
            largest = max(largest, abs(bound['distance_on_plant_m'] / bound['distance_m'] - 1.0))
            cells.append(f'{bound["distance_m"]:.3f} ({bound["time_s"]:.3f}), {bound["torque_variation_Nm"]:.0f}')
        lines.append(f'| {road} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines) + f'\n\nUnder the same commands the plant of the program is within {1e6 * largest:.0f} ppm of these.\n'


def main():
    if sys.argv[1:] not in (['--check'], ['--write']):
        print(__doc__, file=sys.stderr)
        return 2
    return keep(sys.argv[1], [('benchmark.md', name, table) for name, table in (
        ('bounds', nominal_bounds), ('benchmark', standing), ('benchmark combined', lambda: standing('combined')),
        ('benchmark capped', lambda: standing('capped')), ('benchmark changed', changed))])


if __name__ == '__main__':
    sys.exit(main())
