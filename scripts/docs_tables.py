#!/usr/bin/env python3
"""usage: docs_tables.py --check|--write [BUILD] | --self-test

Keeps the tables in README.md and the pages of docs/ that a program can print. Between the lines

    <!-- table: NAME -->
    <!-- end -->

stands the table NAME of TABLES below. --write puts it there, --check fails where the page says something else. The long
tables of FILES are CSV files of their own.
BUILD is the folder of a build, by default build/release.
"""
import csv
import io
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent


def json_rows(*command):
    """Rows that a program of the build prints: a JSON list of objects."""
    def rows(build):
        program = build / 'bin' / command[0]
        return json.loads(subprocess.run([program, *command[1:]], check=True, capture_output=True, text=True).stdout)
    return rows


def tsv_rows(file):
    """Rows of a file in the build folder: tab-separated, names of the columns in the first line."""
    def rows(build):
        with open(build / file, encoding='utf-8', newline='') as lines:
            return list(csv.DictReader(lines, delimiter='\t', quoting=csv.QUOTE_NONE))
    return rows


# name -> where its rows come from, {heading: format of the cell}
TABLES = {
    'rooms': (tsv_rows('rooms.tsv'), {'room': '`{room}`', 'holds': '{holds}'}),
}
# file -> where its rows come from; the columns are the rows' own
FILES = {f'docs/reference/{name}.csv': json_rows('abs_hil', 'list', f'--{name}', '--json')
         for name in ('keys', 'quantities', 'reasons')}
MARKED = re.compile(r'^(<!-- table: (\S+) -->\n)(.*?)^(<!-- end -->)$', re.MULTILINE | re.DOTALL)


def table(rows, columns):
    """Markdown of the rows; a value that is None is an empty cell."""
    lines = ['| ' + ' | '.join(columns) + ' |', '|---' * len(columns) + '|']
    for row in rows:
        shown = {key: '' if value is None else str(value).replace('|', '\\|') for key, value in row.items()}
        lines.append('| ' + ' | '.join(cell.format(**shown) for cell in columns.values()) + ' |')
    return '\n'.join(lines) + '\n'


def filled(page, build, tables):
    """The page with every marked table as it should be. KeyError for a name that is not in `tables`."""
    def fill(match):
        rows, columns = tables[match[2]]
        return match[1] + table(rows(build), columns) + match[4]
    return MARKED.sub(fill, page)


def csv_text(rows):
    """CSV of rows; the columns of all of them, empty where a row has none."""
    text = io.StringIO()
    writer = csv.DictWriter(text, dict.fromkeys(name for row in rows for name in row), lineterminator='\n')
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def self_test():
    assert csv_text([{'a': 1, 'b': 'x, y'}, {'a': 2, 'c': 3}]) == 'a,b,c\n1,"x, y",\n2,,3\n'

    tables = {'two': (lambda build: [{'a': 1, 'b': None}, {'a': 'x|y', 'b': build}], {'A': '`{a}`', 'B': '{b}'})}
    page = 'before\n<!-- table: two -->\nold\n<!-- end -->\nafter\n'
    wanted = 'before\n<!-- table: two -->\n| A | B |\n|---|---|\n| `1` |  |\n| `x\\|y` | z |\n<!-- end -->\nafter\n'
    assert filled(page, 'z', tables) == wanted, filled(page, 'z', tables)
    assert filled(wanted, 'z', tables) == wanted
    assert filled('no table\n', 'z', tables) == 'no table\n'


def main():
    mode, *build = sys.argv[1:] or ['']
    if mode == '--self-test':
        self_test()
        return 0
    if mode not in ('--check', '--write') or len(build) > 1:
        print(__doc__, file=sys.stderr)
        return 2
    folder = pathlib.Path(build[0] if build else ROOT / 'build' / 'release').resolve()
    pages = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
    wanted = {path: filled(path.read_text(encoding='utf-8'), folder, TABLES) for path in pages}
    wanted |= {ROOT / file: csv_text(rows(folder)) for file, rows in FILES.items()}
    stale = []
    for path, current in wanted.items():
        if not path.exists() or path.read_text(encoding='utf-8') != current:
            stale.append(path.relative_to(ROOT))
            if mode == '--write':
                path.write_text(current, encoding='utf-8')
    if mode == '--write':
        return 0
    for path in stale:
        print(f'{path}: a table is not what the program prints; scripts/docs_tables.py --write mends it')
    return 1 if stale else 0


if __name__ == '__main__':
    sys.exit(main())
