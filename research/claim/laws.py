"""The laws of the comparison, their gains as configuration files, and their runs on nominal and varied plants."""
from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from abs_hil.core import _core
from abs_hil.options import options
from abs_hil.simulation import STANDARD_VARIATION, simulate_many
from abs_hil.tune import START_SPEED_RAD_S, gains_of

from .criteria import ACTUATORS, THETA0_N, Verdict, judge, slip_velocity_gain

Settings = Mapping[str, 'float | bool']


@dataclass(frozen=True)
class Law:
    """A law that the comparison searches gains for."""
    controller: str
    theta0: str  #: key of its first estimate
    gain: str | None = None  #: key of its switching gain K, m/s^2

    def fixed(self) -> dict[str, float]:
        """What is the same for every law."""
        return {self.theta0: THETA0_N}


LAWS: Mapping[str, Law] = {law.controller: law for law in (
    Law('adaptive', 'control.adaptive.zeta0'),
    Law('sliding-mode', 'control.sliding_mode.theta0_N', 'control.sliding_mode.gain_m_s2'),
    Law('sliding-mode-smooth', 'control.sliding_mode_smooth.theta0_N', 'control.sliding_mode_smooth.gain_m_s2'),
    Law('super-twisting', 'control.super_twisting.theta0_N'),
    Law('sliding-mode-actuator', 'control.sliding_mode_actuator.theta0_N', 'control.sliding_mode_actuator.gain_m_s2'),
)}
BASELINES = tuple(name for name in LAWS if name != 'adaptive')

#: K and gamma of the first-order law, over which the map is drawn
MAP_KEYS = ('control.sliding_mode.gain_m_s2', 'control.sliding_mode.gamma')
#: the adaptive law in the paper's own gains
PAPER_GAINS = "adaptive, paper's gains"


@dataclass(frozen=True)
class Entry:
    """A law with gains, as the page lists it."""
    name: str
    controller: str
    gains: Settings = field(default_factory=dict)  #: configuration keys; those not given have their defaults

    @property
    def gain_m_s2(self) -> float | None:
        """Its K, None for a law without."""
        key = LAWS[self.controller].gain
        return None if key is None else float(self.gains[key])

    def settings(self, actuator: str) -> dict[str, float | bool]:
        fixed = LAWS[self.controller].fixed() if self.controller in LAWS else {}  # `locked` estimates nothing
        return {'experiment.start_speed_rad_s': START_SPEED_RAD_S, **ACTUATORS[actuator], **fixed, **self.gains}


def gains_file(folder: pathlib.Path, actuator: str, controller: str) -> pathlib.Path:
    """real/sliding-mode.toml and so on below config/paper."""
    return folder / actuator / f'{controller}.toml'


def shipped(folder: pathlib.Path, actuator: str, controller: str) -> Entry:
    """A law with the gains of its file. Raises ValueError without a usable file."""
    values = {row['name']: row['value'] for row in _core.keys(options(config=gains_file(folder, actuator, controller)))}
    gains = {gain.name: values[gain.name] for gain in gains_of(controller)}
    return Entry('adaptive, searched' if controller == 'adaptive' else controller, controller, gains)


def entries(folder: pathlib.Path, actuator: str) -> list[Entry]:
    """The rows of the page: the adaptive law in the paper's gains, and every law in its shipped ones."""
    return [Entry(PAPER_GAINS, 'adaptive'), *(shipped(folder, actuator, name) for name in LAWS)]


def run_entries(all_: Sequence[Entry], plants: Sequence[str], actuator: str, cases: int, seed: int,
                threads: int = 0) -> dict[str, np.ndarray]:
    """Figures of every entry on every plant, shape (entries, plants, 1 + cases): the nominal plant, then varied ones.
    Gains that a controller refuses count as runs with a fault."""
    runs = [{'controller': entry.controller, 'plant': plant, 'set': entry.settings(actuator)}
            for entry in all_ for plant in plants]
    nominal = simulate_many(runs, threads=threads, keep_going=True)
    varied = simulate_many(runs, vary=STANDARD_VARIATION, repeat=cases, vary_seed=seed, threads=threads, keep_going=True)
    shape = (len(all_), len(plants))
    found = {}
    for name in nominal.columns:
        if name in varied.columns and len(nominal[name]) == len(runs) and len(varied[name]) == len(runs) * cases:
            found[name] = np.concatenate([np.reshape(nominal[name], (*shape, 1)),
                                          np.reshape(varied[name], (*shape, cases))], axis=-1)
    found['fault'] = np.where(found['error'] == '', found['fault'], found['error'])
    return found


def judge_entries(figures: Mapping[str, np.ndarray], all_: Sequence[Entry], plants: Sequence[str]) -> Verdict:
    """Judges what run_entries found. All entries have a switching gain, or none has."""
    gains = [entry.gain_m_s2 for entry in all_]
    k = np.reshape([slip_velocity_gain(plant) for plant in plants], (1, -1, 1))
    return judge(figures, None if gains[0] is None else np.reshape(np.array(gains, dtype=float), (-1, 1, 1)), k)
