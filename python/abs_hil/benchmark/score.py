"""Runs the cases of the benchmark and scores a controller (docs/benchmark.md)."""
import functools
import importlib.util
import math
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from ..core import _core
from ..interchange.host import made
from ..merits import OVERSHOOT
from ..options import Value, options
from ..simulation import Study, keys, simulate, simulate_many
from .bounds import coasted, identity
from .cases import COAST_S, END_SPEED_M_S, SEEDS, Case

EXPERIMENT = 'coast-and-brake'
_SLIPS = np.linspace(0.002, 1.0, 500)
#: of the braking before those that count, in a warm entry
FIRST_SEED = 101


@dataclass(frozen=True)
class Entry:
    """A controller that takes part: a name of the program, a shared library, an FMU, or MODULE:CLASS in Python.

    warm: each case is braked once before, and the counted brakings begin with what the law has kept of that.
    Raises ValueError for a setting of anything but the controller.
    """
    name: str
    settings: Mapping[str, Value]
    warm: bool = False

    def __post_init__(self) -> None:
        for key in self.settings:
            if not key.startswith('control.'):
                raise ValueError(f'{self.name}: setting "{key}": give keys under control. alone; plants and experiment are the '
                                 'benchmark\'s own')

    @property
    def label(self) -> str:
        return f'{self.name}, warm' if self.warm else self.name

    @property
    def without_host(self) -> bool:
        """Whether it is a class in Python that runs in this process: a wheel has no program that would run it in its own."""
        return (':' in self.name and not self.name.endswith(('.so', '.fmu'))
                and importlib.util.find_spec('abs_hil._network') is None)

    def made(self) -> Any:
        """The controller of a run in this process. research/nmpc_table.py has objects of its own."""
        return made(self.name)


def _runs(entry: Entry, cases: Sequence[Case], seeds: Sequence[int]) -> Iterator[dict[str, Any]]:
    nominal = {plant: {name: row['value'] for name, row in keys(plant=plant).items()} for plant in {case.plant for case in cases}}
    for case in cases:
        values: dict[str, Value] = {
            **case.values(nominal[case.plant]), 'experiment.start_speed_rad_s': coasted(case)[0],
                  'experiment.coast_s': COAST_S, 'experiment.end_speed_m_s': END_SPEED_M_S, **entry.settings}
        run = {'controller': entry.name, 'plant': case.plant, 'experiment': EXPERIMENT, 'set': values}
        if entry.warm:
            run['set'] = values | kept(run)
        yield from ({**run, 'seed': seed} for seed in seeds)


def kept(run: Mapping[str, Any]) -> dict[str, Value]:
    """What a law keeps of a braking for the next one on the same rig; nothing of one that did not stop."""
    return dict(simulate(**{**run, 'seed': FIRST_SEED}).summary.get('learnt', {}))


def keeps(entry: Entry, case: Case) -> bool:
    """Whether a law keeps anything, so that a warm entry of it makes sense."""
    return not entry.without_host and bool(kept(next(_runs(entry, [case], [FIRST_SEED]))))


FIGURES = ('stop_distance_m', 'stop_time_s', 'torque_total_variation_Nm', OVERSHOOT, 'slip_largest', 'time_locked_s')


def _in_this_process(entry: Entry, run: dict[str, Any]) -> Study:
    """What the law raises is the fault that it is in a process of its own."""
    law = entry.made()
    try:
        study = simulate_many([{**run, 'controller': law}], keep_going=True)
    except Exception as error:
        print(f'{entry.name}: {"".join(traceback.format_exception_only(error)).strip()}', file=sys.stderr)
        return Study({**dict.fromkeys(FIGURES, np.array([math.nan])), 'fault': np.array(['controller_not_finite'], dtype=object)})
    if study['error'][0]:
        raise ValueError(study['error'][0])
    return study


def _results(entry: Entry, runs: Iterator[dict[str, Any]], threads: int) -> Study:
    if not entry.without_host:
        return simulate_many(runs, threads=threads)
    studies = [_in_this_process(entry, run) for run in runs]
    return Study({name: np.concatenate([study[name] for study in studies]) for name in (*FIGURES, 'fault')})


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


@functools.lru_cache(maxsize=1024)
def _least_time_s(plant: str, values: tuple[tuple[str, object], ...], start_speed_rad_s: float) -> float:
    base = _core.PlantOptions(options(plant=plant, set=dict(values)))  # type: ignore[arg-type]
    of = base.values()
    r1, r2, J1, J2 = of['r1_m'], of['r2_m'], of['J1_kg_m2'], of['J2_kg_m2']
    speeds = np.linspace(END_SPEED_M_S / r2, start_speed_rad_s, 60)
    per_rate = []
    for omega2 in speeds:
        omega1 = (1.0 - _SLIPS) * omega2 * r2 / r1
        torque = np.zeros_like(_SLIPS)
        for _ in range(30):  # with the lever the force depends on the torque that holds the slip
            force = np.asarray(_core.tyre_forces_N(base, [], omega1, np.full_like(_SLIPS, omega2), torque))
            lower = -(r2 * force + of['d2_Nms_rad'] * omega2 + of['M20_Nm']) / J2
            upper = (1.0 - _SLIPS) * lower * r2 / r1
            torque = np.clip(r1 * force - of['d1_Nms_rad'] * omega1 - of['M10_Nm'] - J1 * upper, 0.0, of['b1_Nm'] + of['b2_Nm'])
        per_rate.append(1.0 / np.max(-lower))
    return float(trapezoid(per_rate, speeds))


def least_time_s(case: Case) -> float:
    """Of UN R13-H's utilisation of adhesion, carried over to the rig: the braking time of a tyre that gives its largest force at
    each speed, without a lag: (v0 - v_end) / (k_M g). NaN on a road whose friction changes, where no single k_M exists."""
    if case.profile:
        return math.nan
    return _least_time_s(case.plant, tuple(sorted(case.plant_values().items())), case.start_speed_rad_s)


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
    variation, overshoot, largest = (np.array([row[name] for row in rows])[sound]
                                     for name in ('torque_total_variation_Nm', OVERSHOOT, 'slip_largest'))
    adhesion = np.array([row['adhesion'] for row in rows])
    adhesion = adhesion[np.isfinite(adhesion)]

    def of(values: np.ndarray, function: Any) -> float:
        return float(function(values)) if len(values) else math.nan

    return Score(group, len(rows), int((~sound).sum()), sum(row['time_locked_s'] > 0 for row in rows),
                 of(excess[sound], np.mean), of(excess[sound], lambda e: np.percentile(e, 90)),
                 of(excess[sound], lambda e: np.percentile(e, 95)), of(excess[sound], np.max),
                 str(rows[worst]['case']), of(variation, np.median), of(variation, np.max),
                 of(overshoot, np.max), of(largest, np.max), of(adhesion, np.mean))


def run(entry: Entry, cases: Sequence[Case], bounds: Mapping[str, Mapping[str, float]], seeds: Sequence[int] = SEEDS,
        threads: int = 0) -> Result:
    """Scores a controller. Raises ValueError if it cannot run, or a case has no bound."""
    for case in cases:
        if identity(case) not in bounds:
            raise ValueError(f'case {case.key} has no bound; research/benchmark_bounds.py computes it')
    found = _results(entry, _runs(entry, cases, seeds), threads)
    rows = []
    for number, (case, seed) in enumerate((case, seed) for case in cases for seed in seeds):
        bound = bounds[identity(case)]
        row: dict[str, Any] = {'case': case.key, 'group': case.group, 'seed': seed, 'fault': str(found['fault'][number]),
                               'bound_m': bound['distance_m'], **{name: float(found[name][number]) for name in FIGURES}}
        # A fault's distance is no braking distance of the controller.
        row['excess'] = math.nan if row['fault'] else row['stop_distance_m'] / bound['distance_m'] - 1.0
        row['adhesion'] = math.nan if row['fault'] else least_time_s(case) / row['stop_time_s']
        rows.append(row)
    groups = list(dict.fromkeys(case.group for case in cases))
    scores = [_score(group, [row for row in rows if row['group'] == group]) for group in groups]
    return Result(entry, [*scores, _score('all', rows)], rows)
