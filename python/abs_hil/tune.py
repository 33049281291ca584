"""abs_tune: searches for a controller's gains in simulation and writes them as a configuration file (docs/comparison.md)."""
import argparse
import inspect
import itertools
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import differential_evolution

from . import parsers
from .core import _core
from .files import make_folder, write_text, write_whole
from .merits import OVERSHOOT
from .options import as_main, options
from .simulation import STANDARD_VARIATION, Study, controllers, simulate_many

#: the paper brakes from 1625 rpm
START_SPEED_RAD_S = 170.0
#: seed of the plants' perturbations; no evaluation uses it (`abs_hil compare` starts from 1)
PLANTS_SEED = 20_150_401
FAULT_COST = 3.0
#: three times what a locked wheel needs; a stop that takes longer is as bad as none
BRAKE_LIMIT_S = 10.0
#: neither measures slip nor has a slip reference
WITHOUT_REFERENCE = ('five-phase',)


@dataclass(frozen=True)
class Gain:
    """A configuration key that the search may set, and its range."""
    name: str
    least: float
    most: float
    logarithmic: bool

    def value_at(self, coordinate: float) -> float:
        """The value, of three digits, at a coordinate in [0, 1]."""
        value = (self.least * (self.most / self.least) ** coordinate if self.logarithmic else
                 self.least + coordinate * (self.most - self.least))
        return float(f'{value:.3g}')


def gains_of(controller: str) -> list[Gain]:
    """The gains that the search sets: the options whose rows give a search range, in their order."""
    section = _core.section_of(controller)
    return [Gain(row['name'], *row['search']) for row in _core.keys({}) if 'search' in row and row['name'].startswith(section)]


def tunable() -> list[str]:
    return [name for name in controllers() if gains_of(name)]


@dataclass
class Training:
    """The plants on which gains are judged: `cases` variations of each nominal plant."""
    plants: Sequence[str] = ('paper-table1', 'paper-timing')
    cases: int = 6
    model: str | None = None
    threads: int = 0

    def run(self, runs: list[dict[str, Any]]) -> Study:
        """Every run on every case of its plant."""
        return simulate_many(runs, vary=STANDARD_VARIATION, repeat=self.cases, vary_seed=PLANTS_SEED, threads=self.threads,
                             keep_going=True)

    def arguments(self, plant: str, controller: str, values: dict[str, float | bool]) -> dict[str, Any]:
        return {'controller': controller, 'plant': plant, 'model': self.model,
                'set': {'experiment.start_speed_rad_s': START_SPEED_RAD_S, 'experiment.brake_limit_s': BRAKE_LIMIT_S,
                        **values}}


@dataclass
class Found:
    values: list[float]
    cost: float
    start_cost: float  # of the gains that are the defaults
    evaluations: int = 0


def cost_of(study: Study, follows_slip: bool, locked_m: np.ndarray, obedient_m: np.ndarray,
            max_torque_Nm: np.ndarray) -> np.ndarray:
    """Cost of each run, to be minimised; shape (runs,).

    With the stop distance D of the run and those of two other runs on the same plant, D_locked of a locked wheel and
    D_ref of a controller that holds the wanted slip, it is

        max(D, D_ref) / D_locked + 2 slip RMS error + 0.2 slip overshoot + 0.5/s time locked
        + 1e-4 (torque variation / largest torque)

    and FAULT_COST for a run that ends by a fault or does not stop within BRAKE_LIMIT_S. Stopping shorter than the wanted
    slip allows earns nothing: a law that stays near the peak of friction disobeys. A controller without a slip reference
    has D and no slip terms.
    """
    distance = study['stop_distance_m']
    cost = 0.5 * study['time_locked_s'] + 1e-4 * study['torque_total_variation_Nm'] / max_torque_Nm
    if follows_slip:
        cost = cost + np.fmax(distance, obedient_m) / locked_m + 2.0 * study['slip_rms'] + 0.2 * study[OVERSHOOT]
        cost = np.where(np.isnan(distance), np.nan, cost)
    else:
        cost = cost + distance / locked_m
    usable = (study['fault'] == '') & (study['error'] == '') & np.isfinite(cost)
    return np.where(usable, cost, FAULT_COST)


class Judge:
    """Evaluates candidates: the mean cost over the same cases for each."""

    def __init__(self, controller: str, training: Training) -> None:
        if controller not in controllers():
            _core.Controller(options(controller=controller))  # says which names there are
        self.controller, self.training = controller, training
        self.evaluations, self.gains = 0, gains_of(controller)
        if not self.gains:
            raise ValueError(f'controller {controller} has no gains to tune; give another controller: ' + ', '.join(tunable()))
        self._locked_m = self._distances('locked', {})
        # True speeds and a brake without lag or steps: as near to the wanted slip as any law can come.
        self._obedient_m = self._distances('nominal', {'plant.ideal_sensors': True, 'plant.ideal_actuator': True})
        torques = [_core.max_brake_torque_Nm(options(plant=plant, model=training.model)) for plant in training.plants]
        self._max_torque_Nm = np.repeat(torques, training.cases)

    def _distances(self, controller: str, values: dict[str, float | bool]) -> np.ndarray:
        study = self.training.run([self.training.arguments(plant, controller, values) for plant in self.training.plants])
        if error := next(filter(None, study['error']), ''):
            raise ValueError(error)
        return study['stop_distance_m']

    def values(self, point: np.ndarray) -> list[float]:
        return [gain.value_at(float(coordinate)) for gain, coordinate in zip(self.gains, point)]

    def costs(self, candidates: list[list[float] | None]) -> np.ndarray:
        """Mean costs of the candidates, in their order; None stands for the defaults."""
        t = self.training
        runs = [t.arguments(plant, self.controller,
                            {} if values is None else {gain.name: value for gain, value in zip(self.gains, values)})
                for values in candidates for plant in t.plants]
        count = len(candidates)
        cost = cost_of(t.run(runs), self.controller not in WITHOUT_REFERENCE, np.tile(self._locked_m, count),
                       np.tile(self._obedient_m, count), np.tile(self._max_torque_Nm, count))
        self.evaluations += count
        return cost.reshape(count, -1).mean(axis=1)


def search(judge: Any, generations: int, seed: int,
           progress: Callable[[int, float], None] = lambda generation, cost: None) -> Found:
    """Differential evolution by SciPy: rand-to-best/1/bin, F 0.7, CR 0.9, 8 candidates a gain (16 to 40). judge: a Judge, or
    what has its gains, evaluations, values and costs.

    The defaults do not enter the search, so that it finds the same gains whatever they are.
    """
    start_cost = float(judge.costs([None])[0])
    judge.evaluations = 0
    dimensions = len(judge.gains)
    size = min(max(8 * dimensions, 16), 40)
    first = np.random.default_rng(seed).random((size, dimensions))
    generation, best = itertools.count(1), [math.inf]

    def callback(_: np.ndarray, convergence: float = 0.0) -> None:
        progress(next(generation), float(best[0]))

    def cost(points: np.ndarray) -> np.ndarray:
        found = judge.costs([judge.values(point) for point in np.atleast_2d(points.T)])
        best[0] = min(best[0], float(found.min()))
        return found

    # SciPy has renamed the argument of its random numbers.
    named = 'rng' if 'rng' in inspect.signature(differential_evolution).parameters else 'seed'
    random: dict[str, Any] = {named: np.random.default_rng(seed)}
    result = differential_evolution(cost, [(0.0, 1.0)] * dimensions, strategy='randtobest1bin', maxiter=generations,
                                    init=first, mutation=0.7, recombination=0.9, tol=0.0, atol=0.0, polish=False,
                                    updating='deferred', vectorized=True, callback=callback, **random)
    return Found(judge.values(result.x), float(result.fun), start_cost, judge.evaluations)


def to_toml(judge: Judge, found: Found, comment: str) -> str:
    """A configuration file (for --config) with these values."""
    table = judge.gains[0].name.rpartition('.')[0]
    lines = [f'# {comment}', f'# Mean cost {found.cost:.5f} after {found.evaluations} candidates.',
             f'description = "Gains of {judge.controller} found by abs_tune"', '', f'[{table}]']
    lines += [f'{gain.name[len(table) + 1:]} = {value!r}' for gain, value in zip(judge.gains, found.values)]
    return '\n'.join(lines) + '\n'


def _tune(controller: str, o: argparse.Namespace) -> None:
    plants = [name for name in o.plants.split(',') if name]
    judge = Judge(controller, Training(plants, o.cases, o.model, o.threads))
    make_folder(o.folder, '--out')
    path = o.folder / f'{controller}.toml'
    write_whole(path, lambda name: None, probe=True)

    def progress(generation: int, cost: float) -> None:
        print(f'{controller}: generation {generation} of {o.generations}, cost {cost:.5f}', file=sys.stderr)

    found = search(judge, o.generations, o.seed, progress)
    model = f' --model {o.model}' if o.model else ''
    comment = (f'abs_tune --controllers {controller} --plants {",".join(plants)}{model} --cases {o.cases} --generations '
               f'{o.generations} --seed {o.seed} (docs/comparison.md)')
    text = to_toml(judge, found, comment)
    write_text(path, text)
    print(f'{controller}: cost {found.cost:.5f}, with the previous gains {found.start_cost:.5f}\n{text}')


@as_main(parsers.tune)
def main(o: argparse.Namespace) -> None:
    chosen = tunable() if o.controllers is None else [name for name in o.controllers.split(',') if name]
    if not chosen or not o.plants.strip(','):
        raise ValueError('--controllers, --plants: give at least one name, or leave the option out')
    for controller in chosen:
        _tune(controller, o)
