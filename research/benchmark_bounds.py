#!/usr/bin/env python3
"""usage: benchmark_bounds.py --write|--check [FILE]

Computes the optima of every case of the benchmark into FILE; it goes on where it was interrupted. --write then stores them as
python/abs_hil/benchmark/bounds-2.json, --check compares them with those. Without FILE, --write adds those that are missing there
to the stored ones. Needs the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python) and casadi.
"""
import os
import pathlib
import sys

os.environ.setdefault('OMP_NUM_THREADS', '1')

from abs_hil.benchmark import bounds, cases  # noqa: E402

#: of a distance: another version of the solver ends this near
TOLERANCE = 1e-3


def read(path):
    return bounds._read(path) if path.exists() else {}


def store(path, known):
    new = path.with_suffix('.new')
    new.write_text(bounds.text_of(known), encoding='utf-8')
    new.replace(path)


def computed(every, path):
    """The bounds of all cases, of which those in `path` need not be computed."""
    wanted = {bounds.identity(case) for case in every}
    known = {key: value for key, value in read(path).items() if key in wanted}
    # The even roads first: they take least.
    for case in sorted(bounds.missing(every, known), key=lambda case: len(case.profile)):
        found = bounds.compute(case)
        off = abs(found['distance_on_plant_m'] / found['distance_m'] - 1.0)
        print(f'{case.key}: {found["distance_m"]:.3f} m, the plant {1e6 * off:.0f} ppm from it', flush=True)
        known[bounds.identity(case)] = found
        store(path, known)
    return known


def differences(every, known):
    stored = bounds.stored()
    for case in bounds.missing(every, {}):
        now, before = known[bounds.identity(case)]['distance_m'], stored.get(bounds.identity(case), {}).get('distance_m', 0.0)
        if abs(now - before) > TOLERANCE * now:
            yield f'{case.key}: {now} m, stored {before} m'


def main():
    mode, *file = sys.argv[1:] or ['']
    if mode not in ('--write', '--check') or len(file) > 1 or (mode == '--check' and not file):
        print(__doc__, file=sys.stderr)
        return 2
    every = cases.whole_set()
    known = computed(every, pathlib.Path(file[0]) if file else bounds.STORED)
    found = list(differences(every, known)) if mode == '--check' else []
    if mode == '--write':
        store(bounds.STORED, known)
    for line in found:
        print(line, file=sys.stderr)
    return 1 if found else 0


if __name__ == '__main__':
    sys.exit(main())
