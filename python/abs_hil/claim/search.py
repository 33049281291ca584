"""The search for a baseline's gains: the least slip error on training plants among gains that meet the criteria."""
from __future__ import annotations

import pathlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..files import write_whole
from ..simulation import STANDARD_VARIATION, Study, simulate_many
from ..tune import PLANTS_SEED, START_SPEED_RAD_S, Found, Gain, gains_of, search
from .criteria import ACTUATORS, PLANTS, judge, slip_velocity_gain
from .laws import LAWS, gains_file

#: added to the cost for the share of runs that break a criterion: more than any slip error
PENALTY = 10.0


@dataclass
class TrackingJudge:
    """Cost of gains: the mean slip RMS error over all training plants, plus a penalty where the criteria do not hold.

    Torque variation, time and distance have no part in it: a law that brakes short of the wanted slip gains nothing.
    """
    controller: str
    actuator: str
    cases: int = 8
    threads: int = 0
    evaluations: int = 0
    gains: list[Gain] = field(init=False)

    def __post_init__(self) -> None:
        law = LAWS[self.controller]
        self.gains = [gain for gain in gains_of(self.controller) if gain.name != law.theta0]
        self._k = np.repeat([slip_velocity_gain(plant) for plant in PLANTS], self.cases)

    def values(self, point: np.ndarray) -> list[float]:
        return [gain.value_at(float(coordinate)) for gain, coordinate in zip(self.gains, point)]

    def settings(self, values: list[float] | None) -> dict[str, float | bool]:
        named = {} if values is None else {gain.name: value for gain, value in zip(self.gains, values)}
        return {'experiment.start_speed_rad_s': START_SPEED_RAD_S, **ACTUATORS[self.actuator],
                **LAWS[self.controller].fixed(), **named}

    def study(self, candidates: list[list[float] | None]) -> Study:
        runs = [{'controller': self.controller, 'plant': plant, 'set': self.settings(values)}
                for values in candidates for plant in PLANTS]
        return simulate_many(runs, vary=STANDARD_VARIATION, repeat=self.cases, vary_seed=PLANTS_SEED,
                             threads=self.threads, keep_going=True)

    def costs(self, candidates: list[list[float] | None]) -> np.ndarray:
        """Cost of each candidate; None stands for the defaults."""
        study = self.study(candidates)
        key = LAWS[self.controller].gain
        names = [gain.name for gain in self.gains]
        each = len(PLANTS) * self.cases
        gain = None
        if key is not None:
            gain = np.repeat([np.inf if values is None else values[names.index(key)] for values in candidates], each)
        held = judge(study, gain, np.tile(self._k, len(candidates))).all
        error = np.where(np.isfinite(study['slip_rms']), study['slip_rms'], 1.0)
        self.evaluations += len(candidates)
        return (error + PENALTY * ~held).reshape(len(candidates), each).mean(axis=1)


def find_gains(controller: str, actuator: str, folder: pathlib.Path, generations: int = 30, cases: int = 8, seed: int = 1,
               threads: int = 0, progress: Callable[[int, float], None] = lambda generation, cost: None) -> Found:
    """Searches and writes folder/ACTUATOR/CONTROLLER.toml, a configuration file for --config."""
    judge_ = TrackingJudge(controller, actuator, cases, threads)
    found = search(judge_, generations, seed, progress)
    law = LAWS[controller]
    tables: dict[str, list[str]] = {}
    values = {**law.fixed(), **{gain.name: value for gain, value in zip(judge_.gains, found.values)}}
    for key, value in values.items():
        table, _, name = key.rpartition('.')
        tables.setdefault(table, []).append(f'{name} = {value!r}')
    text = (f'# Least slip error with the {actuator} actuator among gains that meet the criteria (docs/paper.md).\n'
            f'# Cost {found.cost:.5f} after {found.evaluations} candidates, {cases} cases of each plant, seed {seed}.\n'
            f'[control]\ncontroller = "{controller}"\n' +
            ''.join(f'\n[{table}]\n' + '\n'.join(lines) + '\n' for table, lines in tables.items()))
    path = gains_file(folder, actuator, controller)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, lambda name: pathlib.Path(name).write_text(text, encoding='utf-8'))
    return found
