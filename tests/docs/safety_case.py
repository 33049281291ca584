#!/usr/bin/env python3
"""usage: safety_case.py BUILD PAGE | --self-test

Every layer of docs/safety.md names tests, all of which exist, and at least one of which CI runs without being asked
(not of the label on-demand).
"""
import json
import pathlib
import re
import subprocess
import sys

COLUMNS = 6


def layers(text):
    """(name, [tests]) of each row of the section "Layers"."""
    section = text.split('\n## Layers\n', 1)[1].split('\n## ', 1)[0]
    rows = [[cell.strip() for cell in line.strip().strip('|').split(' | ')] for line in section.splitlines()
            if line.startswith('| ')]
    return [(row[0], re.findall(r'`(\w+)`', row[-1]), len(row)) for row in rows[1:]]


def known_tests(build):
    """Name -> labels."""
    shown = subprocess.run(['ctest', '--test-dir', build, '--show-only=json-v1'], capture_output=True, text=True,
                           check=True).stdout
    # Before a test program is built, ctest lists only that it is missing, as NAME_NOT_BUILT or NAME.
    return {re.sub(r'_NOT_BUILT.*', '', test['name']):
            next((p['value'] for p in test.get('properties', []) if p['name'] == 'LABELS'), [])
            for test in json.loads(shown)['tests']}


def problems(rows, known):
    found = [] if rows else ['no layers found']
    for name, tests, cells in rows:
        if cells != COLUMNS:
            found.append(f'{name}: {cells} cells')
        if not tests:
            found.append(f'{name}: no test')
        found += [f'{name}: no test {test}' for test in tests if test not in known]
        if tests and not any('on-demand' not in known.get(test, ['on-demand']) for test in tests):
            found.append(f'{name}: all of its tests run on demand only')
    return found


def self_test():
    page = ('# x\n\n## Layers\n\n| layer | a | b | c | d | tests |\n|---|---|---|---|---|---|\n'
            '| Gate | a | b | c | d | `gate`, `long` |\n{}\n## Next\n\n| no | row |\n')
    known = {'gate': [], 'long': ['on-demand']}
    assert problems(layers(page.format('')), known) == []
    for row, words in (('| New | a | b | c | d | `gone` |', 'no test gone'), ('| New | a | b | c | d | none |', 'no test'),
                       ('| New | a | b | c | d | `long` |', 'on demand only'), ('| New | a | `gate` |', 'cells')):
        found = problems(layers(page.format(row + '\n')), known)
        assert any(words in problem for problem in found), (row, found)


def main():
    if sys.argv[1:] == ['--self-test']:
        self_test()
        return 0
    build, page = sys.argv[1:]
    found = problems(layers(pathlib.Path(page).read_text()), known_tests(build))
    print('\n'.join(found) or 'every layer names tests that CI runs')
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
