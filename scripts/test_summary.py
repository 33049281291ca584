#!/usr/bin/python3
"""test_summary.py RESULTS [LIST...]: what ctest says too briefly: how many tests passed, failed and were skipped, and why.

RESULTS is the file of ctest --output-junit; the LISTs are the lists of packages that could not be installed. Status 1 if
the environment has ABS_HIL_MAY_SKIP, a pattern, and a test of another name was skipped or a list is lacking.
"""
import os
import re
import sys
from xml.etree import ElementTree

#: how our own tests, pytest -rs and unittest -v say why they skip
REASONS = re.compile(r"^SKIPPED(?: \[\d+\] \S+?)?:? +(.+)$|\.\.\. skipped ['\"](.+)['\"]$", re.MULTILINE)


def reasons_of(test: ElementTree.Element) -> list[str]:
    text = re.sub(r'\x1b\[[0-9;]*m', '', test.findtext('system-out') or '')
    return list(dict.fromkeys(found[1] or found[2] for found in REASONS.finditer(text)))


def main(path: str, lacking: list[str]) -> int:
    try:
        tests = ElementTree.parse(path).getroot().findall('testcase')
    except (OSError, ElementTree.ParseError) as error:
        print(f'test: ctest has left no results: {error}', file=sys.stderr)
        return 1
    named = {kind: [test for test in tests if test.get('status') in of]
             for kind, of in (('passed', ('run',)), ('failed', ('fail',)), ('skipped', ('notrun', 'disabled')))}
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
    sys.exit(main(sys.argv[1], sys.argv[2:]))
