"""What a law must show to count in the comparison (docs/paper.md). These criteria were fixed before any search for gains.

They follow from what the paper's text says of its figures: the sliding-mode law reaches the wanted slip and estimates
theta, and it chatters because its switching gain dominates what the estimate leaves over.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from abs_hil.core import _core
from abs_hil.options import options

#: first estimate of theta of every law, N: theta of Table 1
THETA0_N = 23.0
SLIP_REF = 0.15
#: largest relative error of the estimate at 3 m/s
THETA_ERROR = 0.2
#: share of the varied plants on which all criteria must hold. theta_hat also takes up the errors of the brake's gain and of
#: the tyre's shape: +-10 % of each leave even an exact law outside THETA_ERROR on about a tenth of the plants.
SHARE = 0.8

PLANTS = ('inteco-manual', 'paper-table1', 'paper-timing')
ACTUATORS: Mapping[str, Mapping[str, bool]] = {
    'real': {}, 'ideal': {'plant.ideal_actuator': True, 'plant.ideal_sensors': True}}


def slip_velocity_gain(plant: str) -> float:
    """k(slip_ref) of (15), 1/kg, of the nominal plant: the effect of a newton of tyre force on e_v'."""
    keys = {row['name']: row['value'] for row in _core.keys(options(plant=plant))}
    r1, r2 = keys['plant.r1_m'], keys['plant.r2_m']
    return float(r1 * r1 / keys['plant.J1_kg_m2'] + (1.0 - SLIP_REF) * r2 * r2 / keys['plant.J2_kg_m2'])


@dataclass(frozen=True)
class Verdict:
    """Which runs meet which criterion: arrays of bool of one shape. The first run along the last axis is on the nominal
    plant, the others are on varied ones."""
    stops: np.ndarray  #: the run ends in standstill, without a fault
    reaches: np.ndarray  #: slip comes within 0.02 of the wanted one above 3 m/s
    estimates: np.ndarray  #: the estimate of theta is within 20 % at 3 m/s
    slides: np.ndarray  #: K > k |theta - theta_hat| later than 0.3 s and above 3 m/s; True for a law without K

    @property
    def all(self) -> np.ndarray:
        return self.stops & self.reaches & self.estimates & self.slides

    def share(self) -> np.ndarray:
        """Share of the varied plants on which all criteria hold, over the last axis."""
        return np.asarray(self.all[..., 1:].mean(axis=-1))

    def admissible(self, share: float = SHARE) -> np.ndarray:
        """All criteria hold on the nominal plant and on `share` of the varied ones; on every one the car stops and the
        wanted slip is reached."""
        return np.asarray(self.all[..., 0] & (self.stops & self.reaches).all(axis=-1) & (self.share() >= share))

    def shares(self) -> dict[str, float]:
        """Share of the varied plants that meet each criterion, and all of them."""
        named = {'stops': self.stops, 'reaches': self.reaches, 'slides': self.slides, 'estimates': self.estimates,
                 'all': self.all}
        return {name: float(np.mean(held[..., 1:])) for name, held in named.items()}


def judge(figures: Mapping[str, np.ndarray], gain_m_s2: np.ndarray | float | None, k_per_kg: np.ndarray | float) -> Verdict:
    """Judges runs by their figures, arrays of one shape with the runs of one law on one kind of plant along the last axis.

    gain_m_s2: K of the law, a number or of a shape that fits; None for a law without a switching gain.
    k_per_kg:  k of (15) of the nominal plant, likewise.
    phi <= 1, so K > k |theta - theta_hat| is sufficient for the reaching condition K > k phi |theta - theta_hat|.
    """
    stops = (figures['fault'] == '') & np.isfinite(figures['stop_time_s'])
    with np.errstate(invalid='ignore'):
        estimates = np.abs(figures['theta_error_final']) <= THETA_ERROR
        slides = np.ones(stops.shape, dtype=bool) if gain_m_s2 is None else \
            gain_m_s2 > k_per_kg * figures['theta_error_max_N']
    return Verdict(stops, np.isfinite(figures['slip_reached_s']), estimates, slides)
