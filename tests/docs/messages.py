#!/usr/bin/env python3
"""usage: messages.py ROOT | --self-test

Checks that each message that docs/troubleshooting.md quotes, in backticks in the first column of a table, occurs in the
sources. … stands for what differs: each text between two of them must occur. Texts of Python and pip stand in ELSEWHERE.
"""
import pathlib
import re
import sys
import tempfile

ELSEWHERE = {"No module named 'abs_hil'", 'externally-managed-environment'}
LEAST_MESSAGES = 20
QUOTED = re.compile(r'^\| `([^`]+)`', re.MULTILINE)


def texts(root):
    """All sources; literals that the compiler or Python joins are joined."""
    files = [file for folder in ('src', 'extras', 'include', 'python/abs_hil', 'apps') for file in sorted((root / folder).rglob('*'))
             if file.suffix in ('.cpp', '.hpp', '.py')]
    whole = '\n'.join(file.read_text(encoding='utf-8') for file in files)
    whole = re.sub(r'"\s*\\?\n\s*"', '', whole)
    return re.sub(r"'\s*\n\s*f?'", '', whole).replace('\\"', '"')


def wrong(page, sources):
    faults = []
    for message in QUOTED.findall(page):
        parts = [part.strip() for part in message.split('…')]
        for part in [] if message in ELSEWHERE else filter(None, parts):
            if part.rstrip(': ') not in sources:
                faults.append(f'no source has "{part}" of the message "{message}"')
    return faults


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / 'src').mkdir()
        (pathlib.Path(folder) / 'src' / 'a.cpp').write_text('fail("no plate in the "\n     "kitchen; take " + x + " \\"now\\"");')
        sources = texts(pathlib.Path(folder))
    assert wrong('| `no plate in the kitchen; take … "now"` | do |', sources) == []
    assert wrong('| `no plate in the cellar; take …` | do |', sources) == [
        'no source has "no plate in the cellar; take" of the message "no plate in the cellar; take …"']


def main():
    if sys.argv[1:] == ['--self-test']:
        self_test()
        return 0
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    root = pathlib.Path(sys.argv[1])
    page = (root / 'docs' / 'troubleshooting.md').read_text(encoding='utf-8')
    faults = wrong(page, texts(root))
    if len(QUOTED.findall(page)) < LEAST_MESSAGES:
        faults.append(f'docs/troubleshooting.md has fewer than {LEAST_MESSAGES} messages')
    print('\n'.join(faults), file=sys.stderr)
    return 1 if faults else 0


if __name__ == '__main__':
    sys.exit(main())
