#!/usr/bin/env python3
"""usage: controllers_page.py ABS_HIL PAGE

Compares the tables of docs/controllers.md with the program. Exactly the controllers of `abs_hil list` must have a row.
Every key must have the default and the unit of `abs_hil list --keys`.
"""
import re
import subprocess
import sys


def output(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def listed_controllers(text):
    section = text.split('plants\n')[0].splitlines()[1:]
    return [line.split()[0] for line in section]


def listed_keys(text):
    """name: (default, unit) of each line `NAME  DEFAULT  RANGE UNIT; MEANING`."""
    keys = {}
    for line in text.splitlines():
        name, *default, rest = re.split(r'\s{2,}', line, maxsplit=2)  # a text may be empty
        unit = re.match(r'[\[(][^\])]*[\])] ?([^;]*);', rest)
        keys[name] = (''.join(default), unit.group(1) if unit else '')
    return keys


def problems(page, controllers, keys):
    rows = [[cell.strip() for cell in line.strip('|').split('|')] for line in page.splitlines() if line.startswith('| `')]
    named = [row[0].strip('`') for row in rows]
    described = [name for name in named if not name.startswith('control.')]
    if sorted(described) != sorted(controllers):
        yield f'the page describes {described}, abs_hil list has {controllers}'
    for name, row in zip(named, rows):
        if name.startswith('control.') and tuple(row[1:3]) != keys.get(name):
            yield f'{name}: the page says {row[1:3]}, abs_hil list --keys {keys.get(name, "nothing")}'
    if not any(name.startswith('control.') for name in named):
        yield 'the page has no table of gains'


def main():
    program, page = sys.argv[1:]
    with open(page, encoding='utf-8') as file:
        text = file.read()
    found = list(problems(text, listed_controllers(output(program, 'list')), listed_keys(output(program, 'list', '--keys'))))
    print('\n'.join(found))
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
