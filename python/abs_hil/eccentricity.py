"""The encoders' eccentricity from the counts of wheels that coast, as keys of the model (docs/plants.md).

    python -m abs_hil.eccentricity RUN --out model.toml

`abs_hil identify` fits them beside the rig's other parameters, from any logs. This needs one run alone.
"""
import argparse
import math
import pathlib
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .files import write_text
from .run import Run, load, stretches

#: a cubic follows a coasting wheel over this time to far below a count
WINDOW_S = 1.0
#: The slip that the motor or the start leaves fades within this time; no cubic follows that.
SETTLES_S = 0.05
#: below, eccentricity and cubic cannot be told apart
LEAST_TURNS = 3.0


@dataclass(frozen=True)
class Eccentricity:
    """A disc reads angle + eccentricity_rad sin(angle + phase_rad). `sd_rad`: standard deviation of the former."""
    eccentricity_rad: float
    phase_rad: float
    sd_rad: float


def fit(time_s: np.ndarray, counts: np.ndarray, counts_per_rev: int) -> Eccentricity:
    """Least squares of a cubic in each window and A cos + B sin of the reading in all.

    time_s, counts: shapes (rows,), of one stretch of coasting; the counts as the register had them, wrapped or not.
    Raises ValueError if the wheel turns less than LEAST_TURNS times.
    """
    per_count = 2.0 * math.pi / counts_per_rev
    steps = (np.diff(np.asarray(counts, dtype=float)) + 2.0**31) % 2.0**32 - 2.0**31
    travel = np.concatenate([[0.0], np.cumsum(steps)])
    if abs(travel[-1]) < LEAST_TURNS * counts_per_rev:
        raise ValueError(f'the wheel turns {abs(travel[-1]) / counts_per_rev:.2g} times while it coasts; at least '
                         f'{LEAST_TURNS:g} turns are needed')
    place_rad = (counts[0] % counts_per_rev + travel + 0.5) * per_count
    windows = max(1, round((time_s[-1] - time_s[0]) / WINDOW_S))
    window = np.minimum((windows * np.arange(len(time_s))) // len(time_s), windows - 1)
    columns = [np.cos(place_rad), np.sin(place_rad)]
    for number in range(windows):
        inside = window == number
        middle, half = time_s[inside].mean(), max(np.ptp(time_s[inside]) / 2.0, 1e-9)
        columns += [np.where(inside, ((time_s - middle) / half) ** power, 0.0) for power in range(4)]
    matrix = np.stack(columns, axis=1)
    answer, *_ = np.linalg.lstsq(matrix, travel * per_count, rcond=None)
    rest = travel * per_count - matrix @ answer
    sd_rad = math.sqrt(float(rest @ rest) / max(1, len(rest) - len(answer)) * float(np.linalg.inv(matrix.T @ matrix)[0, 0]))
    return Eccentricity(float(np.hypot(answer[0], answer[1])), float(np.arctan2(answer[0], answer[1])), sd_rad)


def of_run(run: Run, counts_per_rev: int = 4096) -> dict[str, Eccentricity]:
    """Upper and lower encoder, from the run's longest stretch of phase coast. Raises ValueError without one."""
    coasting = stretches(np.asarray(run.columns['phase'] == 'coast'))
    if not coasting:
        raise ValueError('no phase coast in the run; let the wheels coast, as with --set experiment.coast_s=0.5')
    first, last = max(coasting, key=lambda part: part[1] - part[0])
    time_s = np.asarray(run.columns['time_s'], dtype=float)
    first += int(np.searchsorted(time_s[first:last], time_s[first] + SETTLES_S))
    rows = slice(first, last)
    time_s = time_s[rows]
    return {wheel: fit(time_s, np.asarray(run.columns[f'{wheel}_counts'][rows]), counts_per_rev) for wheel in ('upper', 'lower')}


def as_toml(found: dict[str, Eccentricity]) -> str:
    lines = ['[model]']
    for wheel, disc in found.items():
        lines += [f'{wheel}_encoder_eccentricity_rad = {disc.eccentricity_rad:.7g}  # standard deviation {disc.sd_rad:.1g}',
                  f'{wheel}_encoder_phase_rad = {disc.phase_rad:.6g}']
    return '\n'.join(lines) + '\n'


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog='python -m abs_hil.eccentricity', allow_abbrev=False,
                                     description='Fits the encoders\' eccentricity to a run in which the wheels coast.')
    parser.add_argument('run', metavar='RUN', type=pathlib.Path, help='run folder, or its CSV or event log')
    parser.add_argument('--counts-per-rev', metavar='N', type=int, default=4096, help='encoder counts per revolution (4096)')
    parser.add_argument('--out', metavar='FILE', type=pathlib.Path, help='writes the keys of the model, for --config')
    given = parser.parse_args(arguments)
    try:
        if given.counts_per_rev < 4:
            raise ValueError(f'--counts-per-rev {given.counts_per_rev}: give at least 4')
        text = as_toml(of_run(load(given.run), given.counts_per_rev))
        if given.out is None:
            print(text, end='')
        else:
            write_text(given.out, text)
    except (OSError, KeyError, ValueError) as error:
        print(f'abs_hil.eccentricity: {error}', file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())
