"""What a law must show to count in the comparison. These criteria were fixed before any search for gains.

They follow from what the paper's text says of its figures: the sliding-mode law reaches the wanted slip and estimates
theta, and it chatters because its switching gain dominates what the estimate leaves over.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..core import _core
from ..options import options
from ..simulation import Study

#: first estimate of theta of every law, N: theta of Table 1
THETA0_N = 23.0
#: share of the varied plants of each kind on which all criteria must hold
SHARE = 0.9
#: largest relative error of the estimate at 3 m/s
THETA_ERROR = 0.2

PLANTS = ('inteco-manual', 'paper-table1', 'paper-timing')
ACTUATORS: Mapping[str, Mapping[str, bool]] = {
    'real': {}, 'ideal': {'plant.ideal_actuator': True, 'plant.ideal_sensors': True}}


def slip_velocity_gain(plant: str, slip_ref: float = 0.15) -> float:
    """k of (15), 1/kg: the effect of a newton of tyre force on e_v'."""
    keys = {row['name']: row['value'] for row in _core.keys(options(plant=plant))}
    r1, r2 = keys['plant.r1_m'], keys['plant.r2_m']
    return r1 * r1 / keys['plant.J1_kg_m2'] + (1.0 - slip_ref) * r2 * r2 / keys['plant.J2_kg_m2']


@dataclass(frozen=True)
class Verdict:
    """Which runs meet which criterion; arrays of bool, shape (runs,)."""
    stops: np.ndarray  #: the run ends in standstill, without a fault
    reaches: np.ndarray  #: slip has been within 0.02 of the wanted one
    estimates: np.ndarray  #: the estimate of theta is within 20 % at 3 m/s
    slides: np.ndarray  #: K > k |theta - theta_hat| from 0.3 s on, above 3 m/s; True for a law without K

    @property
    def all(self) -> np.ndarray:
        return self.stops & self.reaches & self.estimates & self.slides

    def shares(self) -> dict[str, float]:
        """Share of the runs that meet each criterion, and all of them."""
        named = {'stops': self.stops, 'reaches': self.reaches, 'estimates': self.estimates, 'slides': self.slides,
                 'all': self.all}
        return {name: float(np.mean(held)) for name, held in named.items()}

    def admissible(self) -> bool:
        return bool(np.mean(self.all) >= SHARE)


def judge(study: Study, gain_m_s2: np.ndarray | float | None, k_per_kg: np.ndarray | float) -> Verdict:
    """Judges each run of a study.

    gain_m_s2: K of the law, one number or shape (runs,); None for a law without a switching gain.
    k_per_kg:  k of (15) of each run's nominal plant.
    phi <= 1, so K > k |theta - theta_hat| is sufficient for the reaching condition K > k phi |theta - theta_hat|.
    """
    stops = (study['fault'] == '') & np.isfinite(study['stop_time_s'])
    with np.errstate(invalid='ignore'):
        estimates = np.abs(study['theta_error_final']) <= THETA_ERROR
        slides = np.ones(len(study), dtype=bool) if gain_m_s2 is None else \
            gain_m_s2 > k_per_kg * study['theta_error_max_N']
    return Verdict(stops, np.isfinite(study['slip_reached_s']), estimates, slides)
