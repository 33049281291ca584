#!/usr/bin/env python3
"""usage: tidy.py [SOURCE...]

Runs clang-tidy over src/, extras/ and apps/, or over the units that hold the given sources. Reads build/clang (scripts/build.sh
clang), where several sources share a unit, because headers cost most of the time. The static analyzer checks functions
of the main file only, so the script runs it on each source separately. ~/.cache/abs_hil/tidy remembers units without
warnings by the content of all their includes; the script skips these. It prints each warning and ends with status 1 if
there is one.
"""
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / 'build' / 'clang'
TIDY = 'clang-tidy-16'
CACHE = pathlib.Path(os.environ.get('XDG_CACHE_HOME', pathlib.Path.home() / '.cache')) / 'abs_hil' / 'tidy'
# A unit includes its sources on purpose.
MATCHERS = ['--checks=-clang-analyzer-*,-bugprone-suspicious-include',
            f'--header-filter=^{re.escape(str(ROOT))}/(include/abs_hil|src|extras|apps|build/clang/rooms)/']


def units():
    """{unit: (its sources, the compiler's flags, its object)}."""
    found = {}
    for entry in json.loads((BUILD / 'compile_commands.json').read_text()):
        unit = pathlib.Path(entry['file'])
        sources = [line.split('"')[1] for line in unit.read_text().splitlines() if line.startswith('#include "')]
        sources = sources if BUILD in unit.parents else [str(unit)]
        words = shlex.split(entry['command'])
        flags = [w for i, w in enumerate(words) if i > 0 and w not in ('-c', '-o') and words[i - 1] not in ('-c', '-o')]
        found[unit] = (sources, [w for w in flags if not w.endswith(('ccache', 'clang++-16'))], words[words.index('-o') + 1])
    return found


def everything_included():
    """{object: files}, as the compiler told ninja."""
    told = subprocess.run(['ninja', '-C', BUILD, '-t', 'deps'], check=True, capture_output=True, text=True).stdout
    included = {}
    for paragraph in told.split('\n\n'):
        head, *files = paragraph.strip().splitlines() or ['']
        included[head.split(': ')[0]] = [(BUILD / file.strip()).resolve() for file in files]
    return included


class Digests(dict):
    """Hash of the files' contents. Generated files name this clone's folder, which is left out."""

    def __missing__(self, file):
        self[file] = hashlib.sha256(file.read_bytes().replace(bytes(ROOT), b'.')).hexdigest()
        return self[file]


def portable(text):
    return str(text).replace(str(ROOT), '.')


def key_of(sources, flags, files, digests, fixed):
    parts = [fixed, *map(portable, sources), *map(portable, flags)]
    # The revision changes with every commit and cannot cause a warning.
    parts += sorted(f'{portable(file)} {digests[file]}' for file in files if file.name != 'abs_hil_revision.hpp')
    return hashlib.sha256('\n'.join(parts).encode()).hexdigest()


def findings(arguments):
    done = subprocess.run([TIDY, '--quiet', f'--config-file={ROOT}/.clang-tidy', *arguments], cwd=BUILD, capture_output=True,
                          text=True)
    if done.returncode and not done.stdout:  # it was killed or did not start
        return done.stderr or f'{TIDY} {" ".join(arguments[:2])} ended with status {done.returncode}\n'
    return done.stdout


def examine(unit, sources, flags):
    analyzed = '--checks=-*,' + ','.join(re.findall(r'-?clang-analyzer-[\w.*-]+', (ROOT / '.clang-tidy').read_text()))
    found = findings([*MATCHERS, str(unit), '--', *flags])
    return found + ''.join(findings([analyzed, source, '--', *flags]) for source in sources)


def main():
    wanted = {str(pathlib.Path(name).resolve()) for name in sys.argv[1:]}
    version = subprocess.run([TIDY, '--version'], check=True, capture_output=True, text=True).stdout
    fixed = version + (ROOT / '.clang-tidy').read_text() + portable(MATCHERS)
    included, digests = everything_included(), Digests()
    CACHE.mkdir(parents=True, exist_ok=True)
    start, known, jobs = time.monotonic(), 0, {}
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for unit, (sources, flags, built) in units().items():
            if wanted and not wanted & set(sources):
                continue
            mark = CACHE / key_of(sources, flags, [unit, *included[built]], digests, fixed)
            if mark.exists():
                known += 1
            else:
                jobs[pool.submit(examine, unit, sources, flags)] = mark
        bad = 0
        for job in concurrent.futures.as_completed(jobs):
            if job.result():
                bad += 1
                print(job.result(), flush=True)
            else:
                jobs[job].touch()
    print(f'tidy: {len(jobs)} units looked at, {known} as they were when nothing was found, findings in {bad}; '
          f'{time.monotonic() - start:.0f} s')
    sys.exit(1 if bad else 0)


if __name__ == '__main__':
    main()
