#!/usr/bin/env python3
"""usage: benchmark_bounds.py [--check N]

Computes the causal optimum of every case of the benchmark, and of the cases beside its set, that has none yet and stores it in
python/abs_hil/benchmark/bounds-1.json; it goes on where it was interrupted. --check computes the first N again and
compares. Needs the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python) and casadi.
"""
import json
import os
import sys

os.environ.setdefault('OMP_NUM_THREADS', '1')

from abs_hil.benchmark import bounds, cases  # noqa: E402


def store(known):
    text = json.dumps({'version': cases.VERSION, 'bounds': known}, indent=1) + '\n'
    bounds.STORED.with_suffix('.new').write_text(text, encoding='utf-8')
    bounds.STORED.with_suffix('.new').replace(bounds.STORED)


def main():
    every = [*cases.whole_set(), *cases.beside_the_set()]
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
    for case in bounds.missing(every, known):
        found = bounds.compute(case)
        off = abs(found['distance_on_plant_m'] / found['distance_m'] - 1.0)
        print(f'{case.key}: {found["distance_m"]:.3f} m, the plant {1e6 * off:.0f} ppm from it', flush=True)
        known[bounds.identity(case)] = found
        store(known)
    store(known)
    return 0


if __name__ == '__main__':
    sys.exit(main())
