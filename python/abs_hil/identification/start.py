"""First values from the equations of motion themselves, linear in most parameters: no start values are needed for them.

With F eliminated from (1) and (2), over an interval of time,

    (J1/r1) dw1 + (J2/r2) dw2 = int [ Tm/r2 - (d1 w1 + M10 s1 + Tb)/r1 - (d2 w2 + M20)/r2 ] dt

with inertias J (kg m^2), radii r (m), speeds w (rad/s), bearings d (N m s/rad) and M (N m), s = 0 where a wheel stands, motor and
brake torques Tm and Tb (N m). It is linear but for u0, c31 and the brake's dead time. While the wheels are apart, each has an
equation of its own. The stages follow each other, and each begins with what the last one knows and how well: bearings from
wheels that turn freely, the motor, and the brake, whose u0, c31 and dead time are scanned. The tyre's parameters then fit the
force that the lower wheel felt. What no log tells keeps the start's value.
"""
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize
import scipy.signal

from ..core import _core
from .brake_flaws import brake_torques, with_flaws
from .logs import Log
from .parameters import DEAD_TIME
from .problem import Problem

INTERVAL_S = 0.04
COARSE_S = 0.004
#: of the brake's line, as a share of the start's: a brake with less did not act
LEAST_SLOPE = 0.05
#: a dead time is believed at first if it takes this share off the cost without one; less is found later
WORTH_DEAD = 0.3
LARGEST_DEAD_S = 0.04
#: of the start's values, over their size
START_SD = 0.5
#: the speeds' errors stand in the columns, too, and draw towards 0 what little else tells: the rows count for less by this factor
DOUBT = 10.0
#: after a braking, so long a wheel rolls freely, s
RESTS_S = 0.3
#: radii are measured to this share
RADIUS = 0.02
#: the tyre's parameters are within a factor of exp of this
FARTHEST = 4.6


@dataclass
class _Pieces:
    """Intervals of all logs: speeds at their ends, integrals over them."""
    parts: list[tuple[int, np.ndarray, np.ndarray]]  # log, first row, last row
    apart: np.ndarray
    dw: np.ndarray  # (intervals, 2)
    angle: np.ndarray  # (intervals, 2)
    duration: np.ndarray
    turning: np.ndarray  # share of time that each wheel turns (intervals, 2)
    motor: np.ndarray  # int u dt
    motor_speed: np.ndarray  # int u w2 dt


def _integral(log: Log, values: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(values[:-1] * np.diff(log.time_s))])


def _pieces(problem: Problem) -> _Pieces:
    columns = []
    parts = []
    for number, (log, motion, pieces) in enumerate(zip(problem.logs, problem.motions, problem.segments)):
        step = max(2, round(INTERVAL_S / log.period_s))
        first = np.concatenate([np.arange(a + step, b - 2 * step, step) for a, b in pieces] or [np.empty(0, dtype=int)])
        first = first.astype(int)
        last = first + step
        w = motion.speed_rad_s
        motor, speed = _integral(log, log.motor_pwm), _integral(log, log.motor_pwm * w[:, 1])
        turning = np.stack([_integral(log, (~motion.stands[:, i]).astype(float)) for i in range(2)], axis=1)
        columns.append((log.wheels_apart[first] != 0, *(along[last] - along[first] for along in (
            w, motion.smooth_rad, log.time_s, turning, motor, speed))))
        parts.append((number, first, last))
    return _Pieces(parts, *(np.concatenate(column) for column in zip(*columns)))


def first_values(problem: Problem, start: Mapping[str, float], other_form: Mapping[str, float] | None = None,
                 worth_dead: float = WORTH_DEAD) -> dict[str, float]:
    """First values of the form's parameters, and of the brake's dead time if it takes the share `worth_dead` off the cost. `start`
    fills what the logs do not tell; `other_form`: first values of another form, from the same logs: all but the tyre's hold
    here, too."""
    pieces = _pieces(problem)
    value = {p.key: float(start[p.key]) for p in problem.form.parameters} | problem.fixed
    rolls = ~pieces.apart & (pieces.motor == 0) & (pieces.turning.min(axis=1) > 0.99 * pieces.duration)
    # After a locked wheel, rolling takes its time.
    free = [rolls & ~_braked(pieces, problem.logs, rest_s) for rest_s in (1.0, RESTS_S)]
    rolling = free[0] if free[0].sum() > 3 else free[1]
    unrolled = rolling.sum() <= 3
    if other_form is None:
        if not unrolled and 'r1_m' not in problem.fixed:
            value['r1_m'] = problem.given['r2_m'] * float(np.median(pieces.angle[rolling, 1] / pieces.angle[rolling, 0]))
        value.update(_scanned_brake(value, pieces, problem, worth_dead))
        value.update({p.key: float(np.clip(value[p.key], p.least, p.most)) for p in problem.form.parameters} | problem.fixed)
    else:
        value.update({key: number for key, number in other_form.items() if key in value or key == DEAD_TIME.key})
    _tyre(value, pieces, problem, unrolled)
    return value


def _braked(pieces: _Pieces, logs: Sequence[Log], rest_s: float) -> np.ndarray:
    """Intervals in which the brake acts, or acted less than `rest_s` before."""
    acts = []
    for number, first, last in pieces.parts:
        log = logs[number]
        memory = max(1, round(rest_s / log.period_s))
        recent = _integral(log, (log.brake_pwm > 0).astype(float))
        acts.append(recent[last] - recent[np.maximum(first - memory, 0)] > 0)
    return np.concatenate(acts)


#: columns of the linear fit
_LINEAR = ('J1_kg_m2', 'd1_Nms_rad', 'M10_Nm', 'd2_Nms_rad', 'M20_Nm', 'motor_stall_torque_Nm', 'back_emf', 'b1_Nm', 'b2_Nm')
#: cost, linear values, u0, c31, dead time
_Scanned = tuple[float, np.ndarray, float, float, float]
#: the least sizes of those that may be 0
_FLOORS = {'d1_Nms_rad': 1e-4, 'd2_Nms_rad': 1e-4, 'M10_Nm': 5e-3, 'M20_Nm': 2e-2}


def _scanned_brake(value: Mapping[str, float], pieces: _Pieces, problem: Problem, worth_dead: float) -> dict[str, float]:
    """Bearings, motor and brake: the linear ones at the likeliest u0, c31 and dead time."""
    logs, fixed = problem.logs, problem.fixed
    r1, r2, J2 = value['r1_m'], problem.given['r2_m'], problem.given['J2_kg_m2']
    zero = np.zeros(len(pieces.duration))
    turning1, turning2 = pieces.turning.T
    motor = {'motor_stall_torque_Nm': pieces.motor, 'back_emf': -pieces.motor_speed}
    contact, apart = ~pieces.apart, pieces.apart
    duties = problem.duties[problem.duties > 0.0]

    # The scan needs no more than every fourth millisecond.
    thin = [max(1, round(COARSE_S / log.period_s)) for log in logs]
    coarse = [(0.5 * np.diff(log.time_s[::k]), log.brake_pwm[::k], (~motion.stands[::k, 0]).astype(float), k)
              for log, motion, k in zip(logs, problem.motions, thin)]

    def brake_columns(u0: float, c31: float, dead_s: float) -> tuple[np.ndarray, np.ndarray]:
        slopes: list[np.ndarray] = []
        offsets: list[np.ndarray] = []
        for number, first, last in pieces.parts:
            half_s, duty, turning, k = coarse[number]
            if late := round(dead_s / (k * logs[number].period_s)):
                duty = np.concatenate([np.zeros(late), duty[:-late]])
            active = (duty >= u0) & (duty > 0)
            keeps = float(np.exp(-c31 * k * logs[number].period_s))
            for into, static in ((slopes, np.where(active, duty, 0.0)), (offsets, active.astype(float))):
                acts = scipy.signal.lfilter([0.0, 1.0 - keeps], [1.0, -keeps], static) * turning
                whole = np.concatenate([[0.0], np.cumsum((acts[:-1] + acts[1:]) * half_s)])
                whole = np.interp(np.concatenate([first, last]), k * np.arange(len(whole)), whole)
                into.append(whole[len(first):] - whole[:len(first)])
        return np.concatenate(slopes), np.concatenate(offsets)

    # A wheel that stands transmits what the brake holds, unknown: such intervals tell nothing of the sum.
    usable = contact & (turning1 > 0.999 * pieces.duration)
    upper = apart & (turning1 > 0.999 * pieces.duration)
    lower = apart & (turning2 > 0.999 * pieces.duration)

    friction1 = {'d1_Nms_rad': pieces.angle[:, 0], 'M10_Nm': turning1, 'J1_kg_m2': pieces.dw[:, 0]}
    friction2 = {'d2_Nms_rad': pieces.angle[:, 1], 'M20_Nm': turning2, **{k: -v for k, v in motor.items()}}
    parts = ((usable, r2 / r1, 1.0), (upper, 1.0, 0.0), (lower, 0.0, 1.0))
    of_row = np.concatenate([np.flatnonzero(rows) for rows, _, _ in parts])
    unbraked = np.concatenate([np.stack([upper_by * friction1.get(key, zero) + lower_by * friction2.get(key, zero)
                                         for key in _LINEAR], axis=1)[rows] for rows, upper_by, lower_by in parts])
    target = np.concatenate([-lower_by * J2 * pieces.dw[rows, 1] for rows, _, lower_by in parts])
    brakes = np.concatenate([upper_by * np.ones(rows.sum()) for rows, upper_by, _ in parts])
    driven, braked = pieces.motor[of_row] > 0.0, _braked(pieces, logs, RESTS_S)[of_row]

    # What the logs do not tell stays near the start: that is as good as a reading of each parameter.
    emf = value['motor_stall_torque_Nm'] / value['motor_no_load_speed_rad_s']
    guess = np.array([{**value, 'back_emf': emf}[key] for key in _LINEAR])
    free = [i for i, key in enumerate(_LINEAR) if key not in fixed]
    sizes = np.maximum(np.abs(guess), [_FLOORS.get(key, 1e-6) for key in _LINEAR])[free]
    pull = np.diag(1.0 / (START_SD * sizes))
    pulls_to = pull @ guess[free]
    target = target - np.delete(unbraked, free, axis=1) @ np.delete(guess, free)  # the brake's columns are still 0
    for rows in (~driven & ~braked, driven & ~braked):
        if rows.any():
            pull, pulls_to = _robust(unbraked[rows][:, free], target[rows], pull, pulls_to)[2:]

    def fit(u0: float, c31: float, dead_s: float) -> tuple[float, np.ndarray]:
        A, y = unbraked[braked], target[braked]
        for key, column in zip(('b1_Nm', 'b2_Nm'), brake_columns(u0, c31, dead_s)):
            A[:, _LINEAR.index(key)] = (brakes * column[of_row])[braked]
            y = y - A[:, _LINEAR.index(key)] * fixed.get(key, 0.0)
        full = guess.copy()
        full[free], cost, *_ = _robust(A[:, free], y, pull, pulls_to)
        return cost, full

    def scan(best: _Scanned, u0s: Iterable[float], c31s: Iterable[float], deads_s: Iterable[float] = (0.0,)) -> _Scanned:
        u0s, c31s = ([value[key]] if key in fixed else some for key, some in (('u0', u0s), ('c31_per_s', c31s)))
        return min([best, *((*fit(*one), *one) for one in itertools.product(u0s, c31s, deads_s))], key=lambda one: one[0])

    def near(u0: float, width: float) -> list[float]:
        some = duties[np.abs(duties - u0) < width]
        return sorted({*np.quantile(some, np.linspace(0, 1, 6)).tolist(), u0}) if some.size else [u0]

    best = *fit(value['u0'], value['c31_per_s'], 0.0), value['u0'], value['c31_per_s'], 0.0
    if duties.size:
        span = float(np.ptp(duties)) / 24
        best = scan(best, sorted({*np.quantile(duties, np.linspace(0, 1, 24)).tolist()}), np.geomspace(4.0, 400.0, 16))
        for width, factor in ((span, 1.25), (span / 4, 1.08)):
            best = scan(best, near(best[2], width), best[3] * np.geomspace(1.0 / factor, factor, 5))
        late = scan(best, [best[2]], np.geomspace(8.0, 600.0, 8), np.arange(COARSE_S, LARGEST_DEAD_S, COARSE_S))
        if late[0] < (1.0 - worth_dead) * best[0]:
            best = scan(late, near(late[2], span), late[3] * np.geomspace(0.7, 1.4, 5), late[4] + COARSE_S * np.arange(-1, 2))
    linear = dict(zip(_LINEAR, best[1].tolist()))
    found = {key: linear[key] for key in _LINEAR if key in value}
    for key, floor in _FLOORS.items():
        found[key] = max(found[key], 0.1 * max(abs(found[key]), floor))
    if pieces.motor.max(initial=0.0) > 0 and linear['back_emf'] > 0:
        stall = problem.fixed.get('motor_stall_torque_Nm', found['motor_stall_torque_Nm'])
        found['motor_no_load_speed_rad_s'] = float(np.clip(stall / linear['back_emf'], 20, 2000))
    found.update(u0=float(best[2]), c31_per_s=float(best[3]))
    if best[4] > 0.0 > linear['b2_Nm']:
        found[DEAD_TIME.key] = float(best[4])
    if linear['b1_Nm'] > LEAST_SLOPE * value['b1_Nm']:
        return found
    # Duties inside the dead zone alone brake nothing: then the brake keeps the start's values.
    return {key: number for key, number in found.items() if key not in ('b1_Nm', 'b2_Nm', 'u0', 'c31_per_s')}


def _robust(A: np.ndarray, y: np.ndarray, pull: np.ndarray,
            pulls_to: np.ndarray) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    """Least squares that forgives outliers (Huber's weights), with rows of unit variance that others left, pull x = pulls_to; the
    cost is robust too. The last two are such rows for the next."""
    found = np.linalg.solve(pull, pulls_to)
    for number in range(5):
        residual = np.abs(y - A @ found)
        scale = 1.0
        if len(y):
            scale = 1e-12 + float(1.4826 * np.median(residual) if number else np.sqrt(np.mean(residual**2)))
        root = np.sqrt(np.minimum(1.0, 2.0 * scale / np.maximum(residual, 1e-15))) / (DOUBT * scale)
        stacked, target = np.concatenate([A * root[:, None], pull]), np.concatenate([y * root, pulls_to])
        size = np.linalg.norm(stacked, axis=0)
        size[size == 0] = 1.0
        found = np.linalg.lstsq(stacked / size, target, rcond=None)[0] / size
    residual, limit = np.abs(y - A @ found), 0.02
    left, triangle = np.linalg.qr(stacked)
    return found, float(np.sum(np.minimum(residual**2, limit * residual))), triangle, left.T @ target


def _tyre(value: dict[str, float], pieces: _Pieces, problem: Problem, unrolled: bool) -> None:
    """Fits the tyre's parameters to the mean force of each interval, as the lower wheel felt it; the upper wheel's radius, too,
    if the wheels never rolled freely: it shifts every slip."""
    form, base, r2, J2 = problem.form, problem.base, problem.given['r2_m'], problem.given['J2_kg_m2']
    tyre = [p for p in form.parameters if p.acts == 'contact' and (unrolled or p.key != 'r1_m') and p.key not in problem.fixed]
    contact = ~pieces.apart
    if not tyre or contact.sum() < 10:
        return
    force = (value['motor_stall_torque_Nm'] * (pieces.motor - pieces.motor_speed / value['motor_no_load_speed_rad_s'])
             - J2 * pieces.dw[:, 1] - value['d2_Nms_rad'] * pieces.angle[:, 1]
             - value['M20_Nm'] * pieces.turning[:, 1]) / (r2 * pieces.duration)
    middles = []
    for number, first, last in pieces.parts:
        log, motion = problem.logs[number], problem.motions[number]
        torque = brake_torques(*with_flaws(log, motion, value))
        middles.append(np.column_stack([np.where(motion.stands, 0.0, motion.speed_rad_s), torque])[(first + last) // 2])
    w1, w2, Tb = np.concatenate(middles)[contact].T
    force = force[contact]
    shared = [(p.key, value[p.key]) for p in form.parameters if p not in tyre] + [('r2_m', r2), ('J2_kg_m2', J2)]
    keys, least, most = zip(*((p.key, p.least, p.most) for p in tyre))
    begun = np.array([value[key] for key in keys])
    size = np.where(np.equal(keys, 'r1_m'), RADIUS, 1.0)
    line = np.less(least, 0.0)  # those that may be negative move along a straight line, the others by factors

    def from_x(x: np.ndarray) -> list[float]:
        return np.clip(np.where(line, begun + 0.1 * x, begun * np.exp(np.where(line, 0.0, size * x))), least, most).tolist()

    def residual(x: np.ndarray) -> np.ndarray:
        try:
            modelled = _core.tyre_forces_N(base, shared + list(zip(keys, from_x(x))), w1, w2, Tb)
        except ValueError:  # this friction would wedge the lever
            return np.full(len(force) + len(x), 100.0)
        # What the force does not tell, as the peak's height in gentle braking, stays near the start.
        return np.concatenate([np.asarray(modelled) - force, 2.0 * x])
    heights = np.isin(keys, form.road) & ~line  # their starts decide the side of the peak that a fit takes
    best = min((scipy.optimize.least_squares(residual, heights * np.log(factor), bounds=(-FARTHEST, FARTHEST), loss='soft_l1',
                                             max_nfev=60) for factor in (1.0, 0.6, 1.6)), key=lambda fit: float(fit.cost))
    value.update(zip(keys, from_x(best.x)))
