#!/usr/bin/env python3
"""usage: benchmark_table.py --check|--write

Keeps two tables of docs/benchmark.md: the standing of all controllers, between the lines <!-- benchmark --> and <!-- end -->,
and the bounds of the nominal cases, between <!-- bounds --> and <!-- end -->. --write puts them there, --check fails where
the page says something else. Needs the package abs_hil of a build
(PYTHONPATH=build/release/share/abs_hil/python).
"""
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import keep  # noqa: E402


import abs_hil
from abs_hil.benchmark import Entry, bounds, cases, page, run


def standing():
    known = bounds.stored()
    return page.table([run(Entry(name, {}), cases.whole_set(), known) for name in abs_hil.controllers()])


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
    return keep(sys.argv[1], [('benchmark.md', 'bounds', nominal_bounds), ('benchmark.md', 'benchmark', standing)])


if __name__ == '__main__':
    sys.exit(main())
