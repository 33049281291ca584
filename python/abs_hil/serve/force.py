"""The tyre's force over slip, estimated while the wheel brakes: cubics through both encoders' angles over 60 ms give speed
and deceleration in their middle, and the lower wheel's balance of torques gives the force (as src/analysis/friction_curve.cpp
does after a run)."""
from typing import Any

import numpy as np

from ..messages import PHASES
from .history import PLACE

HALF_WINDOW_S = 0.03
LEAST_SAMPLES = 12
SLOW_M_S = 1.0
BRAKE = PHASES.index('brake')


def point(rows: np.ndarray, config: dict[str, Any]) -> tuple[float, float] | None:
    """(slip, force in N) from the cycles of one window; None where it cannot be known.

    config: the run's effective configuration. The model's parameters count, on the real rig the only ones.
    """
    model = {**config.get('plant', {}), **config.get('model', {})}
    try:
        r1_m, r2_m, J2_kg_m2, d2_Nms_rad, M20_Nm, counts_per_rev = (
            float(model[name]) for name in ('r1_m', 'r2_m', 'J2_kg_m2', 'd2_Nms_rad', 'M20_Nm', 'encoder_counts_per_rev'))
    except (KeyError, TypeError, ValueError):
        return None
    if len(rows) < LEAST_SAMPLES or (rows[:, PLACE['phase']] != BRAKE).any() or counts_per_rev <= 0 or r2_m <= 0:
        return None
    time_s = rows[:, PLACE['sample_time_s']]
    scaled = (time_s - (time_s[0] + time_s[-1]) / 2) / HALF_WINDOW_S
    counts = rows[:, [PLACE['upper_counts'], PLACE['lower_counts']]].astype(np.int64)
    steps = (np.diff(counts, axis=0) + (1 << 31)) % (1 << 32) - (1 << 31)  # the counters wrap around at 32 bit
    angles = np.concatenate((np.zeros((1, 2)), np.cumsum(steps, axis=0))) * (2 * np.pi / counts_per_rev)
    if not np.isfinite(scaled).all():
        return None
    _, first, second, _ = np.linalg.lstsq(np.vander(scaled, 4, increasing=True), angles, rcond=None)[0]
    omega, alpha = first / HALF_WINDOW_S, 2 * second / HALF_WINDOW_S ** 2
    v_x_m_s = r2_m * omega[1]
    if v_x_m_s < SLOW_M_S:
        return None
    return 1 - r1_m * omega[0] / v_x_m_s, -(J2_kg_m2 * alpha[1] + d2_Nms_rad * omega[1] + M20_Nm) / r2_m
