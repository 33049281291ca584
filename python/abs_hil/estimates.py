"""Means with 95 % confidence intervals by Student's t."""
import math
from typing import NamedTuple

import numpy as np

from .core import _core


class Estimate(NamedTuple):
    """Of a mean. NaN if the sample is too small: the mean needs one value, everything else two.

    n: number of values; deviation: standard deviation of the sample, with n - 1; low, high: the interval,
    mean -+ t(0.975, n - 1) deviation / sqrt(n).
    """
    n: int
    mean: float
    deviation: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        return 0.5 * (self.high - self.low)


def of_mean(values: np.ndarray | list[float]) -> Estimate:
    """The mean of the values that are not NaN. They add up in their order, so that the bits depend on nothing else."""
    array = np.asarray(values, dtype=float)
    known = array[~np.isnan(array)]
    n = len(known)
    mean = float(np.cumsum(known)[-1] / n) if n else np.nan
    if n < 2:
        return Estimate(n, mean, np.nan, np.nan, np.nan)
    deviation = float(np.sqrt(np.cumsum((known - mean) ** 2)[-1] / (n - 1)))
    half = _core.student_quantile(0.975, n - 1) * deviation / float(np.sqrt(n))
    return Estimate(n, mean, deviation, mean - half, mean + half)


def of_difference(values: np.ndarray, base: np.ndarray) -> Estimate:
    """The mean of `values - base` over the pairs without NaN. What both share cancels, so that small differences show."""
    return of_mean(values - base)


def of_ratio(values: np.ndarray, base: np.ndarray) -> Estimate:
    """The geometric mean of `values / base` over the pairs in which both are > 0. The interval is that of the logarithms, so
    that the inverse ratio has the inverse interval; the deviation is that of the logarithms."""
    # NumPy's logarithm differs from processor to processor.
    logarithms = of_mean([math.log(value / one) for value, one in zip(values, base) if value > 0.0 and one > 0.0])
    mean, low, high = (math.exp(value) for value in (logarithms.mean, logarithms.low, logarithms.high))
    return logarithms._replace(mean=mean, low=low, high=high)
