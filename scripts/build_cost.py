#!/usr/bin/env python3
"""usage: build_cost.py [--write] REVISION...

Builds the programs (what scripts/run.sh needs) of each revision from nothing, without ccache, and prints the CPU time
of each build and its ratio to the first one. Takes some minutes for each revision; nothing else should run meanwhile.
--write puts the table into docs/reference/performance.md.
"""
import argparse
import os
import pathlib
import resource
import subprocess
import sys
import tempfile

from marked_tables import ROOT, write



def children_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def build_s(revision, folder):
    """CPU seconds of building the programs of a revision, and the number of compiled objects."""
    clone = pathlib.Path(folder, revision)
    quiet = {'check': True, 'stdout': subprocess.DEVNULL}
    subprocess.run(['git', 'clone', '--quiet', ROOT, clone], **quiet)
    subprocess.run(['git', '-C', clone, 'checkout', '--quiet', revision], **quiet)
    without_cache = dict(os.environ, CCACHE_DISABLE='1')
    # As on the computer of someone new, which has no compiler for Windows.
    subprocess.run(['cmake', '--preset', 'release', '-DABS_HIL_MINGW=OFF'], cwd=clone, env=without_cache, stderr=subprocess.DEVNULL,
                   **quiet)
    before = children_s()
    subprocess.run(['cmake', '--build', '--preset', 'release', '--target', 'abs_hil_programs'], cwd=clone,
                   env=without_cache, **quiet)
    spent = children_s() - before
    return spent, len(list(pathlib.Path(clone, 'build').rglob('*.o')))


def table(revisions):
    rows = ['| revision | CPU seconds | objects | ratio |', '|---|---|---|---|']
    first = None
    with tempfile.TemporaryDirectory() as folder:
        for revision in revisions:
            print(f'build_cost: {revision} ...', file=sys.stderr)
            seconds, objects = build_s(revision, folder)
            first = first or seconds
            rows.append(f'| {revision} | {seconds:.0f} | {objects} | {seconds / first:.2f} |')
            print(rows[-1], file=sys.stderr)
    return '\n'.join(rows) + '\n'


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[1])
    parser.add_argument('revisions', nargs='+', metavar='REVISION')
    parser.add_argument('--write', action='store_true', help='put the table into docs/reference/performance.md')
    arguments = parser.parse_args()
    text = table(arguments.revisions)
    if not arguments.write:
        print(text, end='')
        return
    write('reference/performance.md', 'build cost', text)


if __name__ == '__main__':
    main()
