#!/usr/bin/env python3
"""usage: symbols_test.py LIBRARY

The objects of the lanes that are compiled for an instruction set define no function without the set's name in it: the
linker keeps one of several equal functions, and the rest of the program must run without the set.
"""
import re
import subprocess
import sys


def functions(library):
    """(object, symbol) of each function that the library's objects define and that others may see."""
    text = subprocess.run(['nm', '--defined-only', library], capture_output=True, text=True, check=True).stdout
    member = ''
    for line in text.splitlines():
        if line.endswith(':'):
            member = line[:-1]
        elif match := re.match(r'[0-9a-f]+ ([TWV]) (\S+)', line):
            yield member, match[1], match[2]


def main():
    found = list(functions(sys.argv[1]))
    strangers, own = [], 0
    for member, kind, symbol in found:
        for source, name in (('_avx2', 'Avx2'), ('_avx512', 'Avx512')):
            if not member.split('.')[0].endswith(source):
                continue
            if name in symbol:
                own += 1
            elif not symbol.startswith('DW.ref.'):
                strangers.append(f'{member} defines {kind} {symbol}')
    print('\n'.join(strangers) or f'{own} functions, each of its own instruction set')
    return 1 if strangers or own == 0 else 0


if __name__ == '__main__':
    sys.exit(main())
