"""The map of the claim: adaptive against the first-order sliding-mode law over K and gamma of the latter, by the studies of
docs/studies.md."""
from __future__ import annotations

import csv
import pathlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from abs_hil.files import write_whole
from abs_hil.simulation import STANDARD_VARIATION
from abs_hil.studies import study
from abs_hil.tune import START_SPEED_RAD_S

from .criteria import ACTUATORS, PLANTS, judge, slip_velocity_gain
from .laws import LAWS, MAP_KEYS, Settings

#: seed of the map's varied plants: neither the search nor an evaluation uses it
MAP_SEED = 24
#: figures whose ratios the page gives, and their names there
FIGURES = {'stop_time_s': 'stop time', 'stop_distance_m': 'stop distance',
           'torque_total_variation_Nm': 'torque variation', 'slip_rms': 'slip RMS error'}
#: the paper's "approximately 6.7 % less"
PAPER_RATIO = 0.933
#: of the map's file; error: the mean slip RMS error of the sliding-mode law
COLUMNS = ('plant', 'actuator', 'gain_m_s2', 'gamma', *FIGURES, 'error', 'share', 'admissible')


def axes(size: int) -> tuple[np.ndarray, np.ndarray]:
    """K in m/s^2 and gamma in kg^2 m/s^3 of the map, each of shape (size,)."""
    digits = np.vectorize(lambda value: float(f'{value:.4g}'))
    return digits(np.geomspace(5.0, 150.0, size)), digits(np.geomspace(1.0, 1000.0, size))


@dataclass(frozen=True)
class Map:
    """Arrays of shape (K, gamma)."""
    plant: str
    actuator: str
    gain_m_s2: np.ndarray
    gamma: np.ndarray
    ratio: Mapping[str, np.ndarray]  #: geometric mean over the plants of adaptive / sliding-mode, by figure
    slip_rms: np.ndarray  #: mean of the sliding-mode law
    share: np.ndarray  #: share of the varied plants on which the sliding-mode law meets all criteria
    admissible: np.ndarray

    def best(self) -> tuple[int, int] | None:
        """Indices of the admissible baseline with the least slip error; None if there is none."""
        return _least(np.where(self.admissible, self.slip_rms, np.nan))

    def median(self) -> tuple[int, int] | None:
        """Indices of the admissible baseline whose slip error is the median of all admissible ones."""
        error = np.where(self.admissible, self.slip_rms, np.nan)
        return _least(np.abs(error - np.nanmedian(error))) if self.admissible.any() else None

    def least_favourable(self) -> tuple[int, int] | None:
        """Indices of the admissible baseline against which the adaptive law gains least time."""
        return _least(np.where(self.admissible, -self.ratio['stop_time_s'], np.nan))

    def span(self, name: str) -> tuple[float, float, float]:
        """Least, median and largest ratio of a figure over the admissible baselines; NaN if there is none."""
        held = self.ratio[name][self.admissible]
        held = held[np.isfinite(held)]
        return (float(held.min()), float(np.median(held)), float(held.max())) if held.size else (np.nan, np.nan, np.nan)


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


Progress = Callable[[int, int], None]


def _runs(plants: Sequence[str], actuator: str, controller: str, factors: Mapping[str, np.ndarray], cases: int,
          threads: int, progress: bool | Progress, settings: Settings) -> dict[str, np.ndarray]:
    """Figures of shape (plants, each factor's values, 1 + cases): the nominal plant, then varied ones."""
    law: dict[str, Any] = {'plants': list(plants), 'controllers': [controller],
                           'settings': {'experiment.start_speed_rad_s': START_SPEED_RAD_S, **ACTUATORS[actuator],
                                        **LAWS[controller].fixed(), **settings}}
    if factors:
        law['factors'] = {name: [float(value) for value in values] for name, values in factors.items()}
    shape = (len(plants), *(len(values) for values in factors.values()))
    parts = []
    for repeat in ({'runs': 1, 'vary': 'none'}, {'runs': cases, 'vary': STANDARD_VARIATION, 'seed': MAP_SEED}):
        data = study({**law, 'repeat': repeat}, threads=threads, progress=progress).data
        figures = {name: data[name].to_numpy(dtype=float) for name in
                   (*FIGURES, 'slip_reached_s', 'theta_error_final', 'theta_error_max_N')}
        figures['fault'] = np.where(data['result'] == 'completed', '', 'fault')
        parts.append({name: np.reshape(values, (*shape, -1)) for name, values in figures.items()})
    return {name: np.concatenate([part[name] for part in parts], axis=-1) for name in parts[0]}


def draw_maps(actuator: str, gain: np.ndarray, gamma: np.ndarray, cases: int = 50, threads: int = 0,
              progress: bool | Progress = False, plants: Sequence[str] = PLANTS,
              settings: Settings = MappingProxyType({})) -> list[Map]:
    """One map for each plant: the sliding-mode law at all pairs of gains, and the adaptive law in the paper's gains, on the
    same `cases` varied plants. settings: others of the sliding-mode law."""
    theirs = _runs(plants, actuator, 'sliding-mode', dict(zip(MAP_KEYS, (gain, gamma))), cases, threads, progress, settings)
    ours = _runs(plants, actuator, 'adaptive', {}, cases, threads, False, {})
    K = np.reshape(gain, (-1, 1, 1))
    maps = []
    for index, plant in enumerate(plants):
        found = {name: values[index] for name, values in theirs.items()}
        verdict = judge(found, K, slip_velocity_gain(plant))
        with np.errstate(invalid='ignore'):
            error = found['slip_rms'][..., 1:].mean(axis=-1)
        ratios = {name: ratio_of(ours[name][index, 1:], found[name][..., 1:]) for name in FIGURES}
        maps.append(Map(plant, actuator, gain, gamma, ratios, error,
                        verdict.share(), verdict.admissible()))
    return maps


def write_maps(maps: Sequence[Map], path: pathlib.Path) -> None:
    """One row for each plant, actuator, K and gamma; numbers of four digits."""
    def write(name: str) -> None:
        with open(name, 'w', newline='', encoding='utf-8') as file:
            table = csv.writer(file, lineterminator='\n')
            table.writerow(COLUMNS)
            for one in maps:
                for i, K in enumerate(one.gain_m_s2):
                    for j, gamma in enumerate(one.gamma):
                        numbers = [K, gamma, *(one.ratio[name][i, j] for name in FIGURES), one.slip_rms[i, j], one.share[i, j]]
                        table.writerow([one.plant, one.actuator, *(f'{number:.4g}' for number in numbers),
                                        int(one.admissible[i, j])])
    write_whole(path, write)


def read_maps(path: pathlib.Path) -> list[Map]:
    """The maps of a file of write_maps, in its order."""
    with path.open(newline='', encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    maps = []
    for plant, actuator in dict.fromkeys((row['plant'], row['actuator']) for row in rows):
        own = [row for row in rows if (row['plant'], row['actuator']) == (plant, actuator)]
        column = {name: np.array([float(row[name]) for row in own]) for name in COLUMNS[2:]}
        gain, gamma = (np.unique(column[name]) for name in ('gain_m_s2', 'gamma'))
        grid = {name: values.reshape(len(gain), len(gamma)) for name, values in column.items()}
        maps.append(Map(plant, actuator, gain, gamma, {name: grid[name] for name in FIGURES}, grid['error'], grid['share'],
                        grid['admissible'] > 0))
    return maps
