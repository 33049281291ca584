"""The brake's torque, and flaws of the brake that the plant has (docs/plants.md) and that are fitted where the logs show them.

Dead time d, curvature c, fading k, cooling q and hysteresis h change the torque that the duty u asks for, before the lag (6):

    b(t)    static torque of u(t - d) by (7)
    m(t)    b (1 + c (b / b(1) - 1))
    f(t)    m exp(-k E),  E' = T w - q E the heat in the brake since the log began, J: of its torque T at the wheel's speed w
    y(t)    f pulls y along only from outside of (1 - h) f ... (1 + h) f

The fit simulates a brake without flaws and without u0 on the duties that ask for y: `with_flaws`. How its readings change
with c, k, q and h follows from how they change with the torque, and with d from how they change with a delay: `amounts`. The
lag itself has the rate c31, times the release ratio where the torque falls.
"""
import dataclasses
import itertools
from collections.abc import Callable, Collection, Mapping

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
    """(7) at each row, N m."""
    return np.where(log.brake_pwm >= values['u0'],
                    np.maximum(0.0, values['b1_Nm'] * log.brake_pwm + values['b2_Nm']), 0.0)


def act(values: Mapping[str, float]) -> bool:
    """Whether there are flaws, on a map that has a duty for each torque from 0 up."""
    flawed = any(values.get(flaw.key, 0.0) for flaw in FLAWS if flaw.acts == 'flaw')
    return flawed and values['b1_Nm'] > 0.0 and values['b2_Nm'] < 0.0


def with_flaws(log: Log, motion: Motion, values: Mapping[str, float]) -> tuple[Log, Mapping[str, float]]:
    """The log with the brake's duties as a brake without flaws would need them, and the values of that brake: without u0,
    below which a brake with flaws may well hold."""
    if not act(values):
        return log, values
    target = static_torques(log, values)
    target = target * (1.0 + values.get(CURVATURE.key, 0.0) * (target / full_Nm(values) - 1.0))
    target = _late(log, target, values.get(DEAD_TIME.key, 0.0))
    if fading := values.get(FADING.key, 0.0):
        asked = target
        for _ in range(3):  # the heat depends on the fading, weakly
            target = asked * np.exp(-fading * heat_J(_asking(log, target, values), motion, {**values, 'u0': 0.0}))
    if hysteresis := values.get(HYSTERESIS.key, 0.0):
        target = _hanging(target, hysteresis)
    return _asking(log, target, values), {**values, 'u0': 0.0}


def amounts(log: Log, motion: Motion, values: Mapping[str, float], flaws: Collection[str]) -> dict[str, np.ndarray]:
    """Of log and values as `with_flaws` gives them, at each row, for those of `flaws` that act on the duties: by how much
    the torque's factor grows with c, k, q and h, and whether the brake alone acts, so that a delay of the inputs is a dead
    time."""
    static, torque = static_torques(log, values), brake_torques(log, values)
    grows: dict[str, Callable[[], np.ndarray]] = {
        FADING.key: lambda: -heat_J(log, motion, values),
        COOLING.key: lambda: values.get(FADING.key, 0.0) * leaky(log, values.get(COOLING.key, 0.0), heat_J(log, motion, values)),
        HYSTERESIS.key: lambda: fallen(static),
        CURVATURE.key: lambda: static / full_Nm(values) - 1.0,
        DEAD_TIME.key: lambda: ((log.motor_pwm == 0.0) & (static + torque > 0.0)).astype(float)}
    return {key: of() for key, of in grows.items() if key in flaws}


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


def fallen(target: np.ndarray) -> np.ndarray:
    """-1 from where the target rose last, 1 from where it fell last, 0 before either."""
    change = np.sign(np.diff(target, prepend=target[0]))
    return change[np.maximum.accumulate(np.where(change != 0, np.arange(len(change)), 0))] * -1.0


def _asking(log: Log, target_Nm: np.ndarray, values: Mapping[str, float]) -> Log:
    duty = (target_Nm - values['b2_Nm']) / values['b1_Nm']
    return dataclasses.replace(log, brake_pwm=np.where(target_Nm > 0.0, duty, 0.0))


def _late(log: Log, target: np.ndarray, dead_s: float) -> np.ndarray:
    """The target of `dead_s` before. A part of a row is averaged: the lag is far longer than a row."""
    whole, part = divmod(dead_s / log.period_s, 1.0)
    rows = np.arange(len(target)) - int(whole)
    return (1.0 - part) * target[np.maximum(rows, 0)] + part * target[np.maximum(rows - 1, 0)]


def _hanging(target: np.ndarray, hysteresis: float) -> np.ndarray:
    ends = zip(((1.0 - hysteresis) * target).tolist(), ((1.0 + hysteresis) * target).tolist())
    return np.array([*itertools.accumulate(ends, lambda held, end: min(max(held, end[0]), end[1]), initial=0.0)][1:])
