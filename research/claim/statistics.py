"""Intervals and quantiles of the page's tables."""
from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

#: two errors with a ratio above it are not worth comparing
LARGE = 100


@dataclass(frozen=True)
class Interval:
    mean: float
    low: float  #: of 95 % confidence
    high: float

    def text(self, digits: int = 3) -> str:
        if self.mean > LARGE:
            return f'above {LARGE}'
        return f'{self.mean:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]'


def mean_interval(values: np.ndarray) -> Interval:
    """Mean of the finite values and its 95 % interval by Student's t; NaN for fewer than two."""
    from scipy import stats
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return Interval(math.nan, math.nan, math.nan)
    mean = float(values.mean())
    half = float(stats.t.ppf(0.975, len(values) - 1) * values.std(ddof=1) / math.sqrt(len(values)))
    return Interval(mean, mean - half, mean + half)


def ratio_interval(ours: np.ndarray, theirs: np.ndarray) -> Interval:
    """Geometric mean of ours/theirs run by run, and its 95 % interval, from the logarithms."""
    with np.errstate(invalid='ignore', divide='ignore'):
        found = mean_interval(np.log(ours) - np.log(theirs))
    return Interval(*(math.exp(value) for value in (found.mean, found.low, found.high)))
