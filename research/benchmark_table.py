#!/usr/bin/env python3
"""usage: benchmark_table.py --check|--write

Keeps the tables of docs/benchmark.md: the standing of all controllers over all cases, and the bounds of the nominal cases. Each
stands between a line <!-- NAME --> and <!-- end -->. docs/reference/benchmark.csv has the standing in each group of cases. --write
puts them there, --check fails where a file says something else. Needs the package abs_hil of a build
(PYTHONPATH=build/release/share/abs_hil/python).
"""
import functools
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import csv_text, keep  # noqa: E402


import abs_hil
from abs_hil.benchmark import Entry, bounds, cases, page, run


#: of the page's table
SHOWN = ('locked', 'excess mean %', '95 % %', 'worst %', 'variation median N m', 'ε')


@functools.cache
def results():
    known = bounds.stored()
    return [run(Entry(name, {}), cases.whole_set(), known) for name in abs_hil.controllers()]


def standing():
    """The columns that the page speaks of; the CSV file has all."""
    shown = [page.HEADINGS.index(heading) for heading in SHOWN]
    lines = ['| controller | ' + ' | '.join(SHOWN) + ' |', '|---' + '|---:' * len(SHOWN) + '|']
    lines += [f'| `{name}` | ' + ' | '.join(figures[column] for column in shown) + ' |'
              for name, *figures in page.cells(results())]
    return '\n'.join(lines) + '\n'



def groups():
    rows = [[score.group, *cells] for score in results()[0].scores for cells in page.cells(results(), score.group)]
    return csv_text(['group', 'controller', *page.HEADINGS], rows)


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
    return keep(sys.argv[1], [('benchmark.md', 'bounds', nominal_bounds), ('benchmark.md', 'benchmark', standing),
                              ('reference/benchmark.csv', None, groups)])


if __name__ == '__main__':
    sys.exit(main())
