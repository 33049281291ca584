#!/usr/bin/env python3
"""usage: training_bounds.py BUILD

Computes the causal optimum (python -m abs_hil.optimum) of each run of the training study, config/training/braking.toml, and of
the draws of combined cases, and keeps them in config/training/bounds.json and combined-bounds.json:
research/search_braking_gains.py measures distances against these. Goes on where it was interrupted, and takes some seconds
a run. Needs casadi and the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).
"""
import json
import os
import pathlib
import sys
import tempfile

os.environ.setdefault('OMP_NUM_THREADS', '1')

from benchmark_bounds import computed  # noqa: E402
from search_braking_gains import (  # noqa: E402
    BOUNDS,
    COMBINED_BOUNDS,
    PROFILE,
    ROOT,
    bound_key,
    combined_cases,
    stored_bounds,
    study_rows,
)

from abs_hil import Plant  # noqa: E402
from abs_hil.optimum import NoOptimum, optimum  # noqa: E402

#: the bound leaves it out, which can only shorten the distance
IGNORED = 'plant.brake_dead_time_s'
SAVE_EVERY = 10


def bound_m(row):
    """Distance of the optimum from the speed at which the run began to brake; None if the solver finds none."""
    values = {name: text if name == PROFILE else float(text)
              for name, text in row.items() if name.startswith('plant.') and name != IGNORED}
    plant = Plant(row['plant'], values)
    speed_rad_s = float(row['experiment.start_speed_rad_s'])
    plant.reset(omega1_rad_s=speed_rad_s, omega2_rad_s=speed_rad_s)
    plant.advance(float(row['brake_start_s']))
    try:
        return round(optimum(row['plant'], values, start_speed_rad_s=plant.state.omega2_rad_s).distance_m, 4)
    except NoOptimum:
        return None


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    program = (pathlib.Path(sys.argv[1]) / 'bin' / 'abs_hil').resolve()
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory() as folder:
        rows = study_rows(program, pathlib.Path(folder), 'adaptive-optimal', {})
    known = stored_bounds() if BOUNDS.exists() else {}
    bounds = {}
    for number, row in enumerate(rows):
        key = bound_key(row)
        bounds[key] = known[key] if key in known else bound_m(row)
        if number % SAVE_EVERY == 0 or number + 1 == len(rows):
            print(f'{number + 1} of {len(rows)}', file=sys.stderr, flush=True)
            kept = bounds if number + 1 == len(rows) else {**known, **bounds}
            BOUNDS.write_text(json.dumps(kept, indent=0) + '\n', encoding='utf-8')
    computed(combined_cases(), COMBINED_BOUNDS)
    return 0


if __name__ == '__main__':
    sys.exit(main())
