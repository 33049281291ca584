#!/usr/bin/env python3
"""usage: coverage_table.py COVERAGE.json: gcovr's JSON as a Markdown table of the rooms, then the least covered files."""
import collections
import json
import pathlib
import sys


def room_of(name):
    parts = pathlib.PurePath(name).parts
    parts = parts[2:] if parts[0] == 'include' else parts[1:] if parts[0] == 'src' else parts
    if parts[0] == 'driver' and len(parts) > 2:
        return '/'.join(parts[:2])
    return parts[0]


def percent(reached, of):
    return f'{100.0 * reached / of:.1f} %' if of else '-'


def main():
    files = json.load(open(sys.argv[1]))['files']
    rooms = collections.defaultdict(lambda: [0, 0, 0, 0])
    weakest = []
    for file in files:
        lines = [line for line in file['lines'] if not line.get('gcovr/noncode')]
        branches = [branch for line in lines for branch in line['branches']]
        counts = [sum(line['count'] > 0 for line in lines), len(lines), sum(b['count'] > 0 for b in branches), len(branches)]
        rooms[room_of(file['file'])] = [a + b for a, b in zip(rooms[room_of(file['file'])], counts)]
        weakest.append((counts[1] - counts[0], file['file'], counts))
    outside = [sum(counts[i] for room, counts in rooms.items() if room != 'apps') for i in range(4)]
    print('| room | lines | reached | branches | reached |\n|---|---|---|---|---|')
    for room, c in [*sorted(rooms.items()), ('**all outside apps**', outside)]:
        print(f'| {room} | {c[1]} | {percent(c[0], c[1])} | {c[3]} | {percent(c[2], c[3])} |')
    print('\n| most lines not reached in | lines | reached |\n|---|---|---|')
    for missed, name, c in sorted(weakest, reverse=True)[:12]:
        if missed:
            print(f'| `{name}` | {c[1]} | {percent(c[0], c[1])} |')


if __name__ == '__main__':
    main()
