"""Why (17) swings behind the brake's lag, and what run 22 of `adaptive` on `paper-timing` shows."""
from __future__ import annotations

import csv
import pathlib
import subprocess
import tempfile

import numpy as np

from abs_hil.merits import OVERSHOOT

from .criteria import SLIP_REF

PLANT = 'paper-timing'
RUNS = 200
#: the run that nearly locks
RUN = 22
LAWS = ('adaptive', 'adaptive-actuator')


def swing_speed_m_s(columns: dict[str, np.ndarray]) -> np.ndarray:
    """Car speed below which (17) swings, k theta |phi'(slip_ref)| / c31, for each drawn plant. columns: those of
    `abs_hil compare --runs`."""
    B, C = columns['plant.B'], columns['plant.C']
    slope = B * C * np.cos(C * np.arctan(B * SLIP_REF)) / (1.0 + (B * SLIP_REF) ** 2)
    # compare varies no radii: those of Table 1.
    r1, r2 = 0.0995, 0.0990
    k = r1 ** 2 / columns['plant.J1_kg_m2'] + (1.0 - SLIP_REF) * r2 ** 2 / columns['plant.J2_kg_m2']
    return np.asarray(k * columns['plant.theta_N'] * np.abs(slope) / columns['plant.c31_per_s'])


def phrases(program: pathlib.Path) -> list[str]:
    """Sentences of docs/paper.md with fresh numbers."""
    from scipy import stats
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / 'runs.csv'
        subprocess.run([program, 'compare', '--plant', PLANT, '--controllers', ','.join(LAWS), '--repeat', str(RUNS),
                        '--seed', '1', '--runs', path], check=True, capture_output=True)
        with path.open(newline='', encoding='utf-8') as file:
            rows = list(csv.DictReader(file))
    ours, mended = ([row for row in rows if row['controller'] == law] for law in LAWS)
    numbers = {name: np.array([float(row[name]) for row in ours]) for name in ours[0]
               if name.startswith('plant.') or name == OVERSHOOT}
    speed = swing_speed_m_s(numbers)
    over = numbers[OVERSHOOT]
    other = np.array([float(row[OVERSHOOT]) for row in mended])
    rank = float(stats.spearmanr(speed, over).statistic)
    return [
        f'the swing speed of run {RUN} is {speed[RUN]:.1f} m/s and its overshoot {over[RUN]:.3f}',
        f'Over the {RUNS} runs the rank correlation (Spearman) of swing speed and overshoot is {rank:.2f}',
        f'`adaptive-actuator` overshoots by {other[RUN]:.3f} in run {RUN}, and by at most {other.max():.3f} in all {RUNS}',
        f'the overshoot of `adaptive` has the median {np.median(over):.3f}, the 90th percentile {np.quantile(over, 0.9):.3f} '
        f'and the largest value {over.max():.3f}']
