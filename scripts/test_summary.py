#!/usr/bin/python3
"""test_summary.py RESULTS [LIST...]: what ctest says too briefly: what was shown, how many tests passed, failed and were
skipped, and why.
test_summary.py --key: a pattern of the tests of level key. test_summary.py --passed RESULTS: the names of those that passed.
test_summary.py --check < NAMES: whether each test has a claim.

RESULTS is the file of ctest --output-junit; the LISTs are the lists of packages that could not be installed. Status 1 if
the environment has ABS_HIL_MAY_SKIP, a pattern, and a test of another name was skipped or a list is lacking. ABS_HIL_TEST_LEVEL
(key, all, rest) is what of tests/claims.txt was run.
"""
import os
import pathlib
import re
import sys
from xml.etree import ElementTree

#: how our own tests, pytest -rs and unittest -v say why they skip
REASONS = re.compile(r"^SKIPPED(?: \[\d+\] \S+?)?:? +(.+)$|\.\.\. skipped ['\"](.+)['\"]$", re.MULTILINE)


CLAIMS = pathlib.Path(__file__).resolve().parents[1] / 'tests/claims.txt'


def claims() -> list[tuple[str, str, str]]:
    """(level, pattern of whole names, claim) of each line."""
    rows = [line.split(' | ') for line in CLAIMS.read_text(encoding='utf-8').splitlines() if line and line[0] != '#']
    return [(level, '|'.join(names.split()), claim) for level, names, claim in rows]


def claim_of(name: str) -> str:
    return next((claim for _, pattern, claim in claims() if re.fullmatch(pattern, name)), '')


def table(named: dict[str, list[ElementTree.Element]]) -> list[str]:
    """A line for each claim that this level tries, or leaves out: whether the tests that ran show it."""
    ran = os.environ.get('ABS_HIL_TEST_LEVEL', '')
    of = {kind: [claim_of(test.get('name', '')) for test in tests] for kind, tests in named.items()}
    lines = []
    for level, _, claim in claims():
        if not ran or (ran, level) == ('rest', 'key'):
            continue
        passed, failed, skipped = (of[kind].count(claim) for kind in ('passed', 'failed', 'skipped'))
        whole = not skipped and (ran, level) != ('key', 'all')
        word = 'WRONG' if failed else 'not tried' if not passed else 'shown' if whole else 'in part'
        count = f' ({failed} of {passed + failed + skipped} tests)' if failed else ''
        lines.append(f'{word:<9}  {claim}{count}')
    return lines


def check(names: list[str]) -> int:
    without = [name for name in names if not claim_of(name)]
    empty = [claim for _, pattern, claim in claims() if not any(re.fullmatch(pattern, name) for name in names)]
    for name in without:
        print(f'tests/claims.txt: no claim names the test {name}', file=sys.stderr)
    for claim in empty:
        print(f'tests/claims.txt: no test of "{claim}" exists', file=sys.stderr)
    return int(bool(without or empty))


def reasons_of(test: ElementTree.Element) -> list[str]:
    text = re.sub(r'\x1b\[[0-9;]*m', '', test.findtext('system-out') or '')
    return list(dict.fromkeys(found[1] or found[2] for found in REASONS.finditer(text)))


def tests_of(path: str) -> list[ElementTree.Element]:
    try:
        return ElementTree.parse(path).getroot().findall('testcase')
    except (OSError, ElementTree.ParseError) as error:
        sys.exit(f'test: ctest has left no results: {error}')


def main(path: str, lacking: list[str]) -> int:
    tests = tests_of(path)
    named = {kind: [test for test in tests if test.get('status') in of]
             for kind, of in (('passed', ('run',)), ('failed', ('fail',)), ('skipped', ('notrun', 'disabled')))}
    print('\n'.join(['', *table(named)]))
    print('test: ' + ', '.join(f'{len(these)} {kind}' for kind, these in named.items()))
    for test in named['failed']:
        print(f'test: failed: {test.get("name")}')
    for test in named['skipped']:
        print(f'test: skipped: {test.get("name")}: {"; ".join(reasons_of(test)) or "the test gives no reason"}')
    for test in named['passed']:
        for reason in reasons_of(test):
            print(f'test: skipped in part: {test.get("name")}: {reason}')
    for name in lacking:
        print(f'test: not installed, see above: scripts/{name}')
    allowed = os.environ.get('ABS_HIL_MAY_SKIP')
    if allowed is None:
        return 0
    refused = [name for test in named['skipped'] if not re.search(allowed, name := test.get('name', ''))] + lacking
    if refused:
        print(f'test: ABS_HIL_MAY_SKIP={allowed} does not allow what was left out: {", ".join(refused)}', file=sys.stderr)
    return int(bool(refused))


if __name__ == '__main__':
    if sys.argv[1] == '--key':
        print('^(' + '|'.join(pattern for level, pattern, _ in claims() if level == 'key') + ')$')
    elif sys.argv[1] == '--passed':
        print('\n'.join(test.get('name', '') for test in tests_of(sys.argv[2]) if test.get('status') == 'run'))
    else:
        sys.exit(check(sys.stdin.read().split()) if sys.argv[1] == '--check' else main(sys.argv[1], sys.argv[2:]))
