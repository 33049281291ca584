#!/usr/bin/env python3
"""usage: benchmark_bounds.py [--check N]

Computes the optima of every case of the benchmark that has none yet and stores them in
python/abs_hil/benchmark/bounds-2.json; it goes on where it was interrupted. --check computes the first N again and
compares. Needs the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python) and casadi.
"""
import os
import sys

os.environ.setdefault('OMP_NUM_THREADS', '1')

from abs_hil.benchmark import bounds, cases  # noqa: E402


def store(known):
    new = bounds.STORED.with_suffix('.new')
    new.write_text(bounds.text_of(known), encoding='utf-8')
    new.replace(bounds.STORED)


def main():
    every = cases.whole_set()
    if sys.argv[1:2] == ['--check'] and len(sys.argv) == 3:
        known = bounds.stored()
        for case in bounds.missing(every, {})[:int(sys.argv[2])]:
            found, stored = bounds.compute(case)['distance_m'], known[bounds.identity(case)]['distance_m']
            if abs(found - stored) > 1e-3 * stored:
                print(f'{case.key}: {found} m, stored {stored} m', file=sys.stderr)
                return 1
        return 0
    if len(sys.argv) > 1:
        print(__doc__, file=sys.stderr)
        return 2
    wanted = {bounds.identity(case) for case in every}
    known = {key: value for key, value in (bounds.stored() if bounds.STORED.exists() else {}).items() if key in wanted}
    # The even roads first: they take least.
    for case in sorted(bounds.missing(every, known), key=lambda case: len(case.profile)):
        found = bounds.compute(case)
        off = abs(found['distance_on_plant_m'] / found['distance_m'] - 1.0)
        print(f'{case.key}: {found["distance_m"]:.3f} m, the plant {1e6 * off:.0f} ppm from it', flush=True)
        known[bounds.identity(case)] = found
        store(known)
    store(known)
    return 0


if __name__ == '__main__':
    sys.exit(main())
