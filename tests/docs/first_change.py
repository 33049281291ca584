#!/usr/bin/env python3
"""usage: first_change.py ROOT [--write]

Holds the lines of each path of docs/first-change.md against its files; --write renews them. No path may have more than 900.
"""
import pathlib
import re
import sys

MOST = 900


def main(root, write):
    page = root / 'docs/first-change.md'
    text = page.read_text(encoding='utf-8')
    problems = []
    for row in re.findall(r'^\| (?!path|-).*$', text, flags=re.MULTILINE):
        _, name, files, told, *_ = row.split('|')
        lines = sum(len((root / file).read_text(encoding='utf-8').splitlines()) for file in re.findall(r'`([^`]+)`', files))
        if lines > MOST:
            problems.append(f'{name.strip()}: {lines} lines are no reading for an hour; at most {MOST}')
        if lines != int(told):
            problems.append(f'{name.strip()}: {int(told)} lines, its files have {lines}: first_change.py ROOT --write')
            text = text.replace(row, row.replace(f'|{told}|', f'| {lines} |'))
    if write:
        page.write_text(text, encoding='utf-8')
        return 0
    print('\n'.join(problems))
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main(pathlib.Path(sys.argv[1]), '--write' in sys.argv))
