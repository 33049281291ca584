"""The brake's torque, and flaws of the brake that the plant has (docs/plants.md) and that are fitted where the logs show them.

Dead time d, curvature c, fading k, cooling q and hysteresis h change the torque that the duty u asks for, before the lag (6):

    b(t)    static torque of u(t - d) by (7), N m
    m(t)    b (1 + c (b / b(1) - 1))
    f(t)    m exp(-k E),  E' = T w - q E the heat in the brake since the log began, J: of its torque T, N m, at the wheel's
            speed w, rad/s
    y(t)    f pulls y along only from outside of (1 - h) f ... (1 + h) f

The fit simulates a brake without flaws and without u0 on the duties that ask for y: `with_flaws`. A dead time of whole rows and
a part of one gives each row two of them, before and after that part. A derivative by whatever changes y is a difference of
simulations on their own duties. The lag itself has the rate c31, times the release ratio where the torque falls.
"""
import dataclasses
import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import scipy.signal

from .logs import Log, Motion
from .parameters import COOLING, CURVATURE, DEAD_TIME, FADING, FLAWS, HYSTERESIS, RATE_LIMIT, RELEASE


def brake_torques(log: Log, values: Mapping[str, float]) -> np.ndarray:
    """The brake's torque at each row by (6) and (7), from 0, N m."""
    static = static_torques(log, values)
    keeps = float(np.exp(-values['c31_per_s'] * log.period_s))
    limit = values.get(RATE_LIMIT.key, 0.0) * log.period_s
    release = values.get(RELEASE.key, RELEASE.none)
    if limit == 0.0 and release == 1.0:
        return np.asarray(scipy.signal.lfilter([0.0, 1.0 - keeps], [1.0, -keeps], static))
    limit, grips, lets_go = limit or np.inf, 1.0 - keeps, 1.0 - keeps**release
    torque = [0.0]
    for target in static[:-1].tolist():
        gap = target - torque[-1]
        torque.append(torque[-1] + min(max((grips if gap > 0.0 else lets_go) * gap, -limit), limit))
    return np.array(torque)


def static_torques(log: Log, values: Mapping[str, float]) -> np.ndarray:
    """(7) at each row, N m; the mean over a row in which the duty changes."""
    now = _static(log.brake_pwm, values)
    return now if log.brake_before is None else now + log.late_s / log.period_s * (_static(log.brake_before, values) - now)


def _static(duty: np.ndarray, values: Mapping[str, float]) -> np.ndarray:
    return np.where(duty >= values['u0'], np.maximum(0.0, values['b1_Nm'] * duty + values['b2_Nm']), 0.0)


def act(values: Mapping[str, float]) -> bool:
    """Whether there are flaws, on a map that has a duty for each torque from 0 up."""
    flawed = any(values.get(flaw.key, 0.0) for flaw in FLAWS if flaw.acts == 'flaw')
    return flawed and values['b1_Nm'] > 0.0 and values['b2_Nm'] < 0.0


def with_flaws(log: Log, motion: Motion, values: Mapping[str, float], delay_s: float = 0.0) -> tuple[Log, Mapping[str, float]]:
    """The log with the brake's duties as a brake without flaws would need them, and the values of that brake: without u0,
    below which a brake with flaws may well hold. delay_s: of all inputs, beside the brake's dead time."""
    if not act(values):
        return log, values
    target = _static(log.brake_pwm, values)
    target = target * (1.0 + values.get(CURVATURE.key, 0.0) * (target / full_Nm(values) - 1.0))
    whole, part = divmod((values.get(DEAD_TIME.key, 0.0) + delay_s) / log.period_s, 1.0)
    rows = np.arange(len(log)) - int(whole)
    targets = [target[np.maximum(rows - 1, 0)], target[np.maximum(rows, 0)]]  # before and after the part of a row
    motor = log.motor_pwm  # has no lag: the mean over a row will do
    asks = dataclasses.replace(log, late_s=part * log.period_s,
                               motor_pwm=motor + delay_s / log.period_s * (np.append(motor[:1], motor[:-1]) - motor))
    if fading := values.get(FADING.key, 0.0):
        asked = targets
        for _ in range(3):  # the heat depends on the fading, weakly
            keeps = np.exp(-fading * heat_J(_asking(asks, targets, values), motion, {**values, 'u0': 0.0}))
            targets = [one * keeps for one in asked]
    if hysteresis := values.get(HYSTERESIS.key, 0.0):
        pulls = np.stack(targets, axis=1).ravel()
        ends = zip(((1.0 - hysteresis) * pulls).tolist(), ((1.0 + hysteresis) * pulls).tolist())
        hanging = np.array([*itertools.accumulate(ends, lambda held, end: min(max(held, end[0]), end[1]), initial=0.0)][1:])
        targets = [hanging[::2], hanging[1::2]]
    return _asking(asks, targets, values), {**values, 'u0': 0.0}


def full_Nm(values: Mapping[str, float]) -> float:
    """b(1)."""
    return max(values['b1_Nm'] + values['b2_Nm'], 1e-9)


def heat_J(log: Log, motion: Motion, values: Mapping[str, float]) -> np.ndarray:
    """E at each row."""
    power = brake_torques(log, values) * np.where(motion.stands[:, 0], 0.0, np.maximum(motion.speed_rad_s[:, 0], 0.0))
    return leaky(log, values.get(COOLING.key, 0.0), power)


def leaky(log: Log, leaves_per_s: float, comes: np.ndarray) -> np.ndarray:
    """x of x' = comes - leaves x, from 0, at each row. What comes between two rows comes in the middle."""
    keeps = float(np.exp(-leaves_per_s * log.period_s))
    comes = np.concatenate([[0.0], 0.5 * (comes[1:] + comes[:-1]) * np.diff(log.time_s)])
    return np.asarray(scipy.signal.lfilter([np.sqrt(keeps)], [1.0, -keeps], comes))


def _asking(log: Log, targets_Nm: Sequence[np.ndarray], values: Mapping[str, float]) -> Log:
    before, duty = (np.where(one > 0.0, (one - values['b2_Nm']) / values['b1_Nm'], 0.0) for one in targets_Nm)
    return dataclasses.replace(log, brake_pwm=duty, brake_before=before)
