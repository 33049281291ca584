"""UN R13-H's utilisation of adhesion, carried over to the rig (docs/benchmark.md)."""
from __future__ import annotations

import functools

import numpy as np
from scipy.integrate import trapezoid

from ..core import _core
from ..options import options
from ..simulation import keys
from .cases import END_SPEED_M_S, Case

_SLIPS = np.linspace(0.002, 1.0, 500)


@functools.lru_cache(maxsize=1024)
def _least_time_s(plant: str, values: tuple[tuple[str, object], ...], start_speed_rad_s: float) -> float:
    rows = keys(plant=plant, set=dict(values))  # type: ignore[arg-type]
    base = _core.PlantOptions(options(plant=plant, set=dict(values)))  # type: ignore[arg-type]

    def of(name: str) -> float:
        return float(rows[f'plant.{name}']['value'])

    r1, r2, J1, J2 = of('r1_m'), of('r2_m'), of('J1_kg_m2'), of('J2_kg_m2')
    speeds = np.linspace(END_SPEED_M_S / r2, start_speed_rad_s, 60)
    per_rate = []
    for omega2 in speeds:
        omega1 = (1.0 - _SLIPS) * omega2 * r2 / r1
        torque = np.zeros_like(_SLIPS)
        for _ in range(30):  # with the lever the force depends on the torque that holds the slip
            force = np.asarray(_core.tyre_forces_N(base, [], omega1, np.full_like(_SLIPS, omega2), torque))
            lower = -(r2 * force + of('d2_Nms_rad') * omega2 + of('M20_Nm')) / J2
            upper = (1.0 - _SLIPS) * lower * r2 / r1
            torque = np.clip(r1 * force - of('d1_Nms_rad') * omega1 - of('M10_Nm') - J1 * upper, 0.0,
                             of('b1_Nm') + of('b2_Nm'))
        per_rate.append(1.0 / np.max(-lower))
    return float(trapezoid(per_rate, speeds))


def least_time_s(case: Case) -> float:
    """The braking time of a tyre that gives its largest force at each speed, without a lag: (v0 - v_end) / (k_M g).

    NaN on a road whose friction changes, where no single coefficient k_M exists.
    """
    if case.profile:
        return float('nan')
    return _least_time_s(case.plant, tuple(sorted(case.plant_values().items())), case.start_speed_rad_s)
