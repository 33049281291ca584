"""The figures of merit of a braking run, the program's own table (src/analysis/braking_figures.hpp), and their means over runs
with 95 % confidence intervals by Student's t."""
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from .core import _core

#: the largest excess of slip over its reference; for formulas that use this figure
OVERSHOOT = 'slip_overshoot'
#: what holds for a run whose configuration is unknown
PAPER_R2_M, DEFAULT_END_SPEED_M_S = 0.099, 0.3
_COLUMNS = ('time_s', 'omega1_rad_s', 'omega2_rad_s', 'omega1_est_rad_s', 'omega2_est_rad_s', 'slip', 'slip_est', 'slip_ref',
            'brake_torque_ref_Nm', 'theta_N', 'theta_est_N', 'distance_m')
#: endings of names, and their units
_UNITS = {'_rad_s': 'rad/s', '_m_s': 'm/s', '_Nm': 'N m', '_N': 'N', '_m': 'm', '_s': 's', '': ''}


def with_unit(title: str, unit: str) -> str:
    """A heading: "distance / m", "torque variation / (N m)"."""
    return f'{title} / ({unit})' if ' ' in unit or '/' in unit else f'{title} / {unit}' if unit else title


@dataclass(frozen=True)
class FigureOfMerit:
    """One figure. better: 'less', 'nearer zero' or 'neither'; compared: `abs_hil compare` shows it."""
    name: str
    title: str
    unit: str
    decimals: int
    better: str
    compared: bool
    in_summary: bool
    meaning: str

    @property
    def heading(self) -> str:
        """Title and unit, for the head of a column: "torque variation / (N m)"."""
        return with_unit(self.title, self.unit)


@cache
def figures() -> dict[str, FigureOfMerit]:
    """The figures by their names in summary and results, in the order of a study's results."""
    return {row['name']: FigureOfMerit(**row) for row in _core.figures()}


def number_in(config: Mapping[str, Any], key: str, otherwise: float) -> float:
    """A number of a configuration by dotted key."""
    try:
        return float(config[key])
    except (KeyError, TypeError, ValueError):
        return otherwise


def r2_m(config: Mapping[str, Any]) -> float:
    """The lower wheel's radius by a configuration; without one that of the paper's rig."""
    return number_in(config, 'plant.r2_m', number_in(config, 'model.r2_m', PAPER_R2_M))


def figures_of(columns: Mapping[str, np.ndarray], config: Mapping[str, Any], first: int = 0,
               last: int | None = None) -> dict[str, float]:
    """The figures of merit of rows [first, last), as a run's summary has them; NaN for one that they do not give."""
    kept = {name: columns[name][first:last] for name in _COLUMNS}
    kept['distance_m'] = kept['distance_m'] - (kept['distance_m'][0] if first else 0.0)
    braking = (columns['phase'][first:last] == 'brake').astype(np.float64)
    end_speed_m_s = number_in(config, 'experiment.end_speed_m_s', DEFAULT_END_SPEED_M_S)
    return dict(_core.metrics_of({**kept, 'braking': braking}, r2_m(config), end_speed_m_s))


def heading_of(name: str) -> str:
    """A figure's heading; of a name that the table lacks, as of a study's own metric, its words and unit."""
    if name in figures():
        return figures()[name].heading
    ending = next(ending for ending in _UNITS if name.endswith(ending))
    return with_unit(name.removesuffix(ending).replace('_', ' '), _UNITS[ending])


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
