"""The causal optima of the benchmark's cases: stored with the package, or computed (research/benchmark_bounds.py)."""
from __future__ import annotations

import hashlib
import json
import pathlib
from collections.abc import Iterable

from ..files import write_text
from ..nesting import parse_json
from .cases import END_SPEED_M_S, VERSION, Case

#: what the bound leaves out, which can only shorten the distance
_IGNORED = ('brake_dead_time_s', 'brake_hysteresis', 'encoder_')
STORED = pathlib.Path(__file__).with_name('bounds-1.json')


def identity(case: Case) -> str:
    """Of everything that a case's bound depends on: cases with the same physics share one."""
    values = {name: value for name, value in case.plant_values().items() if not any(part in name for part in _IGNORED)}
    text = json.dumps([case.plant, case.start_speed_rad_s, END_SPEED_M_S, sorted(values.items())])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def stored() -> dict[str, dict[str, float]]:
    """identity -> distance_m, time_s, torque_variation_Nm."""
    return dict(json.loads(STORED.read_text(encoding='utf-8'))['bounds'])


def compute(case: Case) -> dict[str, float]:
    """The causal optimum of a case. Needs casadi."""
    from ..optimum import drive, optimum
    values = {name: value for name, value in case.plant_values().items() if not any(part in name for part in _IGNORED)}
    braking = optimum(case.plant, values, start_speed_rad_s=case.start_speed_rad_s, end_speed_m_s=END_SPEED_M_S)
    on_plant = drive(braking, case.plant, values)
    return {'distance_m': round(braking.distance_m, 5), 'time_s': round(braking.stop_time_s, 5),
            'torque_variation_Nm': round(braking.variation_Nm, 2), 'distance_on_plant_m': round(on_plant.distance_m, 5)}


def found(cases: Iterable[Case], kept: pathlib.Path | None = None) -> dict[str, dict[str, float]]:
    """The bounds of all cases that have one: stored ones, those in the file `kept`, and others computed (needs casadi).

    A case for which the solver finds none has an empty one. What is computed goes into `kept` at once, so that an interrupted
    computation goes on where it was. Raises ValueError for
    a file that holds something else.
    """
    known = stored()
    own: dict[str, dict[str, float]] = {}
    if kept is not None and kept.exists():
        try:
            own = dict(parse_json(kept.read_text(encoding='utf-8'))['bounds'])
        except (KeyError, TypeError, ValueError):
            raise ValueError(f'{kept}: no file of bounds; give one that --bounds has written, or a new name') from None
    known |= own
    for case in missing(cases, known):
        try:
            from ..optimum import NoOptimum
        except ImportError:
            raise ValueError('the bounds of drawn cases are computed with casadi; pip install casadi, or give --bounds FILE '
                             'with all of them') from None
        try:
            known[identity(case)] = own[identity(case)] = compute(case)
        except NoOptimum:
            known[identity(case)] = own[identity(case)] = {}
        if kept is not None:
            _keep(kept, own)
    return known


def _keep(target: pathlib.Path, own: dict[str, dict[str, float]]) -> None:
    text = json.dumps({'version': VERSION, 'bounds': own}, indent=1) + '\n'
    write_text(target, text)


def missing(cases: Iterable[Case], known: dict[str, dict[str, float]]) -> list[Case]:
    """The first case of each identity that has no bound."""
    found: dict[str, Case] = {}
    for case in cases:
        if identity(case) not in known:
            found.setdefault(identity(case), case)
    return list(found.values())
