#!/usr/bin/env python3
"""usage: coverage_table.py LINES.lcov

Prints the export of llvm-cov as tables: by room, and the files with the most unreached lines.
Status 1 if less than 95 % of the lines outside apps are reached.
"""
import collections
import pathlib
import sys

from marked_tables import ROOT

LEAST_LINES_PERCENT = 95.0
FILES_SHOWN = 15


def room_of(name):
    parts = pathlib.PurePath(name).parts
    parts = parts[2:] if parts[0] == 'include' else parts[1:] if parts[0] in ('src', 'extras') else parts
    return '/'.join(parts[:2]) if parts[0] == 'driver' and len(parts) > 2 else parts[0]


def percent(reached, of):
    return f'{100.0 * reached / of:.1f} %' if of else '-'


def table(head, rows):
    lines = ['| ' + ' | '.join(head) + ' |', '|' + '---|' * len(head)]
    return '\n'.join(lines + ['| ' + ' | '.join(str(cell) for cell in row) + ' |' for row in rows]) + '\n'


def counts_of_files(export):
    """{file: lines reached, lines, branches reached, branches}, files named from the project's root."""
    counts = {}
    for line in export.splitlines():
        kind, _, rest = line.partition(':')
        if kind == 'SF':
            now = counts.setdefault(str(pathlib.Path(rest).resolve().relative_to(ROOT)), [0, 0, 0, 0])
        elif kind == 'DA':
            now[0] += rest.split(',')[1] != '0'
            now[1] += 1
        elif kind == 'BRDA':
            now[2] += rest.split(',')[3] not in ('0', '-')
            now[3] += 1
    return counts


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    rooms = collections.defaultdict(lambda: [0, 0, 0, 0])
    files = []
    for name, counts in counts_of_files(pathlib.Path(sys.argv[1]).read_text()).items():
        rooms[room_of(name)] = [a + b for a, b in zip(rooms[room_of(name)], counts)]
        files.append((counts[1] - counts[0], name, counts))
    apps = rooms.pop('apps')
    outside = [sum(column) for column in zip(*rooms.values())]
    rows = [*sorted(rooms.items()), ('**all outside apps**', outside), ('apps', apps)]
    print(table(
        ['room', 'lines', 'reached', 'branches', 'reached'],
        [[room, c[1], percent(c[0], c[1]), c[3], percent(c[2], c[3])] for room, c in rows]))
    weakest = sorted((file for file in files if file[0]), key=lambda file: (-file[0], file[1]))[:FILES_SHOWN]
    print(table(
        ['file', 'lines', 'not reached', 'reached'],
        [[f'`{name}`', c[1], missed, percent(c[0], c[1])] for missed, name, c in weakest]))
    reached = 100.0 * outside[0] / outside[1]
    print(f'coverage: {reached:.1f} % of the lines outside apps')
    if reached < LEAST_LINES_PERCENT:
        sys.exit(f'coverage: at least {LEAST_LINES_PERCENT:.0f} % of them must be reached')


if __name__ == '__main__':
    main()
