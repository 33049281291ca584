"""Runs the cases of the benchmark and scores a controller (docs/benchmark.md)."""
from __future__ import annotations

import math
import sys
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..figures import OVERSHOOT
from ..interchange.host import made
from ..options import Value
from ..simulation import Study, keys, simulate, simulate_many
from .adhesion import least_time_s
from .bounds import coasted, identity
from .cases import COAST_S, END_SPEED_M_S, SEEDS, Case

EXPERIMENT = 'coast-and-brake'
#: of the braking before those that count, in a warm entry
FIRST_SEED = 101


@dataclass(frozen=True)
class Entry:
    """A controller that takes part: a name of the program, a shared library, an FMU, or MODULE:CLASS in Python.

    warm: each case is braked once before, and the counted brakings begin with what the law has kept of that.
    """
    name: str
    settings: Mapping[str, Value]
    warm: bool = False

    @property
    def label(self) -> str:
        return f'{self.name}, warm' if self.warm else self.name

    @property
    def in_python(self) -> bool:
        return ':' in self.name and not self.name.endswith(('.so', '.fmu'))

    def made(self) -> Any:
        """A new object of the class. Raises ValueError."""
        return made(self.name)


def _runs(entry: Entry, cases: Sequence[Case], seeds: Sequence[int]) -> list[dict[str, Any]]:
    nominal: dict[str, dict[str, Value]] = {}
    runs = []
    for case in cases:
        if case.plant not in nominal:
            nominal[case.plant] = {name: row['value'] for name, row in keys(plant=case.plant).items()}
        values: dict[str, Value] = {
            **case.values(nominal[case.plant]), 'experiment.start_speed_rad_s': coasted(case)[0],
                  'experiment.coast_s': COAST_S, 'experiment.end_speed_m_s': END_SPEED_M_S, **entry.settings}
        run = {'controller': entry.name, 'plant': case.plant, 'experiment': EXPERIMENT, 'set': values}
        if entry.warm:
            run['set'] = values | kept(run)
        runs += [{**run, 'seed': seed} for seed in seeds]
    return runs


def kept(run: Mapping[str, Any]) -> dict[str, Value]:
    """What a law keeps of a braking for the next one on the same rig; nothing of one that did not stop."""
    return dict(simulate(**{**run, 'seed': FIRST_SEED}).summary.get('learnt', {}))


def keeps(entry: Entry, case: Case) -> bool:
    """Whether a law keeps anything, so that a warm entry of it makes sense."""
    return not entry.in_python and bool(kept(_runs(entry, [case], [FIRST_SEED])[0]))


FIGURES = ('stop_distance_m', 'stop_time_s', 'torque_total_variation_Nm', OVERSHOOT, 'slip_largest', 'time_locked_s')


def _figures(entry: Entry, runs: list[dict[str, Any]], threads: int) -> tuple[dict[str, np.ndarray], list[str]]:
    """Each figure, shape (runs,), and the reason of each run's early end."""
    studies = [_in_python(entry, run) for run in runs] if entry.in_python else [simulate_many(runs, threads=threads)]
    return ({name: np.concatenate([study[name] for study in studies]) for name in FIGURES},
            [str(fault) for study in studies for fault in study['fault']])


def _in_python(entry: Entry, run: dict[str, Any]) -> Study:
    """One run of a class in Python. What the law raises is the fault that it is in a process of its own."""
    law = entry.made()
    try:
        study = simulate_many([{**run, 'controller': law}], keep_going=True)
    except Exception as error:
        print(f'{entry.name}: {"".join(traceback.format_exception_only(error)).strip()}', file=sys.stderr)
        return Study({**dict.fromkeys(FIGURES, np.array([math.nan])), 'fault': np.array(['controller_not_finite'], dtype=object)})
    if study['error'][0]:
        raise ValueError(study['error'][0])
    return study


def _column(heading: str, decimals: int = 0, scale: float = 1.0) -> dict[str, Any]:
    """For a field of Score that the result's tables show, times `scale`."""
    return {'heading': heading, 'decimals': decimals, 'scale': scale}


@dataclass(frozen=True)
class Score:
    """Of one group of cases, or of all.

    excess: braking distance over the causal optimum, less 1. slip_overshoot: the largest slip beyond the one that the
    controller itself wanted, slip_largest: the largest slip, both above 3 m/s. adhesion: mean utilisation on even roads.
    failed: runs that a fault ended or that never stopped; no other figure has them.
    """
    group: str
    runs: int = field(metadata=_column('runs'))
    failed: int = field(metadata=_column('failed'))
    locked: int = field(metadata=_column('locked'))
    excess_mean: float = field(metadata=_column('excess mean %', 1, 100.0))
    excess_p90: float = field(metadata=_column('90 % %', 1, 100.0))
    excess_p95: float = field(metadata=_column('95 % %', 1, 100.0))
    excess_worst: float = field(metadata=_column('worst %', 1, 100.0))
    worst_case: str
    variation_median_Nm: float = field(metadata=_column('variation median N m'))
    variation_worst_Nm: float = field(metadata=_column('worst N m'))
    slip_overshoot: float = field(metadata=_column('slip overshoot', 2))
    slip_largest: float = field(metadata=_column('peak slip', 2))
    adhesion: float = field(metadata=_column('ε', 3))

    def as_row(self) -> dict[str, Any]:
        return dict(self.__dict__)


@dataclass(frozen=True)
class Result:
    entry: Entry
    scores: list[Score]
    rows: list[dict[str, Any]]

    @property
    def total(self) -> Score:
        return self.scores[-1]


def _score(group: str, rows: Sequence[Mapping[str, Any]]) -> Score:
    excess = np.array([row['excess'] for row in rows])
    sound = np.isfinite(excess)
    worst = int(np.argmax(np.where(np.isnan(excess), np.inf, excess)))
    variation = np.array([row['torque_total_variation_Nm'] for row in rows])[sound]

    adhesion = np.array([row['adhesion'] for row in rows])
    adhesion = adhesion[np.isfinite(adhesion)]

    def of(values: np.ndarray, function: Any) -> float:
        return float(function(values)) if len(values) else math.nan

    return Score(group, len(rows), int((~sound).sum()), sum(row['time_locked_s'] > 0 for row in rows),
                 of(excess[sound], np.mean), of(excess[sound], lambda e: np.percentile(e, 90)),
                 of(excess[sound], lambda e: np.percentile(e, 95)), of(excess[sound], np.max),
                 str(rows[worst]['case']), of(variation, np.median), of(variation, np.max),
                 of(np.array([row[OVERSHOOT] for row in rows])[sound], np.max),
                 of(np.array([row['slip_largest'] for row in rows])[sound], np.max), of(adhesion, np.mean))


def run(entry: Entry, cases: Sequence[Case], bounds: Mapping[str, Mapping[str, float]], seeds: Sequence[int] = SEEDS,
        threads: int = 0) -> Result:
    """Scores a controller. Raises ValueError if it cannot run, or a case has no bound."""
    for case in cases:
        if identity(case) not in bounds:
            raise ValueError(f'case {case.key} has no bound; research/benchmark_bounds.py computes it')
    found, faults = _figures(entry, _runs(entry, cases, seeds), threads)
    rows = []
    for number, (case, seed) in enumerate((case, seed) for case in cases for seed in seeds):
        bound = bounds[identity(case)]
        row: dict[str, Any] = {'case': case.key, 'group': case.group, 'seed': seed, 'fault': faults[number],
                               'bound_m': bound['distance_m'], **{name: float(found[name][number]) for name in FIGURES}}
        # A fault's distance is no braking distance of the controller.
        row['excess'] = math.nan if row['fault'] else row['stop_distance_m'] / bound['distance_m'] - 1.0
        row['adhesion'] = math.nan if row['fault'] else least_time_s(case) / row['stop_time_s']
        rows.append(row)
    groups = list(dict.fromkeys(case.group for case in cases))
    scores = [_score(group, [row for row in rows if row['group'] == group]) for group in groups]
    return Result(entry, [*scores, _score('all', rows)], rows)
