#!/usr/bin/env python3
"""usage: docs_tables.py --check|--write [BUILD] | --self-test

Keeps the CSV files of docs/reference that a build can print: FILES below. --write makes them, --check fails where one says
something else. BUILD is the folder of a build, by default build/release.
"""
import csv
import io
import json
import os
import pathlib
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


def python_of(build):
    return build / 'share' / 'abs_hil' / 'python'


def figure_rows(build):
    """The figures of merit, from the Python package of the build."""
    code = ('import dataclasses, json, abs_hil; '
            'print(json.dumps([dataclasses.asdict(one) for one in abs_hil.figures().values()]))')
    path = {**os.environ, 'PYTHONPATH': str(python_of(build))}
    return json.loads(subprocess.run([PYTHON, '-c', code], check=True, capture_output=True, text=True, env=path).stdout)


#: Debian's Python has the modules of the package
PYTHON = '/usr/bin/python3' if pathlib.Path('/usr/bin/python3').exists() else sys.executable
#: file -> where its rows come from; the columns are the rows' own
FILES = {f'docs/reference/{name}.csv': json_rows('abs_hil', 'list', f'--{name}', '--json')
         for name in ('keys', 'quantities', 'reasons')}
FILES['docs/reference/rooms.csv'] = tsv_rows('rooms.tsv')
FIGURES = 'docs/reference/figures.csv'
FILES[FIGURES] = figure_rows


def csv_text(rows):
    """CSV of rows; the columns of all of them, empty where a row has none."""
    text = io.StringIO()
    writer = csv.DictWriter(text, dict.fromkeys(name for row in rows for name in row), lineterminator='\n')
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def self_test():
    assert csv_text([{'a': 1, 'b': 'x, y'}, {'a': 2, 'c': 3}]) == 'a,b,c\n1,"x, y",\n2,,3\n'


def main():
    mode, *build = sys.argv[1:] or ['']
    if mode == '--self-test':
        self_test()
        return 0
    if mode not in ('--check', '--write') or len(build) > 1:
        print(__doc__, file=sys.stderr)
        return 2
    folder = pathlib.Path(build[0] if build else ROOT / 'build' / 'release').resolve()
    files = dict(FILES)
    if not any((python_of(folder) / 'abs_hil').glob('_core*.so')):
        del files[FIGURES]  # a build with sanitizers has no Python package
    wanted = {ROOT / file: csv_text(rows(folder)) for file, rows in files.items()}
    stale = []
    for path, current in wanted.items():
        if not path.exists() or path.read_text(encoding='utf-8') != current:
            stale.append(path.relative_to(ROOT))
            if mode == '--write':
                path.write_text(current, encoding='utf-8')
    if mode == '--write':
        return 0
    for path in stale:
        print(f'{path}: this is not what the build prints; scripts/docs_tables.py --write mends it')
    return 1 if stale else 0


if __name__ == '__main__':
    sys.exit(main())
