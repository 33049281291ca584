"""The map of the claim: adaptive against the first-order sliding-mode law over K and gamma of the latter."""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..simulation import STANDARD_VARIATION, Study, simulate_many
from ..tune import START_SPEED_RAD_S
from .criteria import ACTUATORS, SHARE, judge, slip_velocity_gain
from .laws import LAWS, MAP_KEYS

#: seed of the map's varied plants: neither training nor evaluation uses it
MAP_SEED = 24
FIGURES = ('stop_time_s', 'stop_distance_m', 'torque_total_variation_Nm', 'slip_rms')
#: the paper's "approximately 6.7 % less"
PAPER_RATIO = 0.933


def axes(size: int) -> tuple[np.ndarray, np.ndarray]:
    """K in m/s^2 and gamma in kg^2 m/s^3 of the map, each of shape (size,)."""
    return np.geomspace(5.0, 150.0, size), np.geomspace(1.0, 1000.0, size)


@dataclass(frozen=True)
class Map:
    """Arrays of shape (K, gamma)."""
    plant: str
    actuator: str
    gain_m_s2: np.ndarray
    gamma: np.ndarray
    ratio: Mapping[str, np.ndarray]  #: geometric mean over the plants of adaptive / sliding-mode, by figure
    slip_rms: np.ndarray  #: mean of the sliding-mode law
    share: np.ndarray  #: share of the plants on which the sliding-mode law meets all criteria
    admissible: np.ndarray

    def best(self) -> tuple[int, int] | None:
        """Indices of the admissible baseline with the least slip error; None if there is none."""
        return _least(np.where(self.admissible, self.slip_rms, np.nan))

    def median(self) -> tuple[int, int] | None:
        """Indices of the admissible baseline whose slip error is the median of all admissible ones."""
        error = np.where(self.admissible, self.slip_rms, np.nan)
        if not self.admissible.any():
            return None
        return _least(np.abs(error - np.nanmedian(error)))


def _least(values: np.ndarray) -> tuple[int, int] | None:
    if np.isnan(values).all():
        return None
    k, g = np.unravel_index(np.nanargmin(values), values.shape)
    return int(k), int(g)


def ratio_of(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Geometric mean over the last axis of ours/theirs, without runs that lack a figure."""
    with np.errstate(invalid='ignore', divide='ignore'):
        logarithm = np.log(ours) - np.log(theirs)
    logarithm = np.where(np.isfinite(logarithm), logarithm, np.nan)
    counts = np.isfinite(logarithm).sum(axis=-1)
    return np.exp(np.divide(np.nansum(logarithm, axis=-1), counts, out=np.full(counts.shape, np.nan), where=counts > 0))


def _run(plant: str, actuator: str, controller: str, sets: Sequence[Mapping[str, float]], cases: int, threads: int,
         progress: bool | Callable[[int, int], None]) -> Study:
    common = {'experiment.start_speed_rad_s': START_SPEED_RAD_S, **ACTUATORS[actuator], **LAWS[controller].fixed()}
    runs = [{'controller': controller, 'plant': plant, 'set': {**common, **values}} for values in sets]
    return simulate_many(runs, vary=STANDARD_VARIATION, repeat=cases, vary_seed=MAP_SEED, threads=threads,
                         progress=progress)


def draw_map(plant: str, actuator: str, size: int = 24, cases: int = 50, threads: int = 0,
             progress: bool | Callable[[int, int], None] = False) -> Map:
    """Runs the sliding-mode law at size x size gains and the adaptive law with the paper's, on the same `cases` plants."""
    gain, gamma = axes(size)
    sets = [dict(zip(MAP_KEYS, (float(K), float(g)))) for K in gain for g in gamma]
    theirs = _run(plant, actuator, 'sliding-mode', sets, cases, threads, progress)
    ours = _run(plant, actuator, 'adaptive', [{}], cases, threads, False)
    shape = (size, size, cases)
    verdict = judge(theirs, np.repeat(gain, size * cases), slip_velocity_gain(plant))
    share = np.reshape(verdict.all, shape).mean(axis=-1)
    with np.errstate(invalid='ignore'):
        slip_rms = np.reshape(theirs['slip_rms'], shape).mean(axis=-1)
    return Map(plant, actuator, gain, gamma,
               {name: ratio_of(ours[name], np.reshape(theirs[name], shape)) for name in FIGURES}, slip_rms, share,
               share >= SHARE)
