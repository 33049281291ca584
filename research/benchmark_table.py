#!/usr/bin/env python3
"""usage: benchmark_table.py --check|--write

Keeps the table of docs/benchmark.md, the standing of all controllers over all cases, between the lines <!-- benchmark --> and
<!-- end -->. docs/reference/benchmark.csv has the standing in each group of cases. A law that keeps something of a stop has a
second row, "warm". --write puts them there, --check fails where a file says something else. Needs the package abs_hil of a
build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import functools
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import csv_text, keep  # noqa: E402

import abs_hil
from abs_hil.benchmark import Entry, bounds, cases, page, run
from abs_hil.benchmark.score import keeps

#: of the page's table
SHOWN = ('locked', 'excess mean %', '95 % %', 'worst %', 'variation median N m', 'ε')


@functools.cache
def results():
    every, known = cases.whole_set(), bounds.stored()
    entries = [Entry(name, {}) for name in abs_hil.controllers()]
    entries += [Entry(entry.name, {}, True) for entry in entries if keeps(entry, every[0])]
    return [run(entry, every, known) for entry in entries]


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


def main():
    if sys.argv[1:] not in (['--check'], ['--write']):
        print(__doc__, file=sys.stderr)
        return 2
    return keep(sys.argv[1], [('benchmark.md', 'benchmark', standing),
                              ('reference/benchmark.csv', None, groups)])


if __name__ == '__main__':
    sys.exit(main())
