"""What the disturbances of a fit have in common: structure that the plant lacks, and its cause.

A fit to a rig that the plant does not describe follows the logs all the same: its random factors take up what the plant
lacks, and the parameters are wrong. But then the factors are not random. They follow something: the energy in the brake, the
direction of its duty, a speed, an angle. For each such cause the plant's derivatives by a factor, times what the factor would
follow, are one more column of the fit. Its coefficient c and standard deviation s come from the same filter, with the
disturbances as noise and all parameters free: |c| / s is about 1 for a rig that wanders at random, whatever the cause.
"""
import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..core import _core
from .brake_flaws import amounts, brake_torques, fallen, full_Nm, static_torques
from .linear import _relative, by_windows, keep_normals, left_out_cost, linearise, run_filter, to_rest
from .parameters import COOLING, CURVATURE, DEAD_TIME, DELAY, FADING, FRICTION_FALL, HYSTERESIS, RELEASE
from .problem import DISTURBANCES, Disturbances, Fit, inverse

#: a cause is believed if its coefficient is this many standard deviations from 0
SURE = 5.0
#: a flaw is tried in place of a surer cause if it is this share as sure, and taken if that cause is then half as sure
WORTH_A_TRY = 0.3
STILL_THERE = 0.5


@dataclass
class Signals:
    """What a cause may follow, at each row of a log."""
    torque_Nm: np.ndarray
    static_Nm: np.ndarray
    full_Nm: float
    heat_J: np.ndarray
    recovered: np.ndarray
    omega_rad_s: np.ndarray
    angle_rad: np.ndarray
    sliding_m_s: np.ndarray
    brakes_alone: np.ndarray
    time_s: np.ndarray


@dataclass(frozen=True)
class Cause:
    """words, against: what a positive and a negative coefficient mean; acts: the disturbance that it would be
    (problem.DISTURBANCES), or the parameter; follows: what that would follow, at each row, in `unit`; flaw: the parameter of
    the plant that describes it, if there is one: its value is `none` plus the coefficient."""
    words: str
    unit: str
    acts: str
    follows: Callable[[Signals], np.ndarray]
    flaw: str = ''
    against: str = ''


CAUSES = (
    Cause('the brake gets weaker with the energy put in', 'per J', 'brake', lambda s: -s.heat_J, FADING.key,
          'the brake gets stronger with the energy put in'),
    Cause('the brake recovers as it cools', 'of its heat per s', 'brake', lambda s: s.recovered, COOLING.key,
          'the brake fades more the longer it stays hot'),
    Cause('the brake holds more after its duty fell than after it rose', 'of its torque', 'brake', lambda s: fallen(s.static_Nm),
          HYSTERESIS.key, 'the brake holds less after its duty fell than after it rose'),
    Cause('the brake acts late', 's', DELAY, lambda s: s.brakes_alone, DEAD_TIME.key, 'the brake acts early'),
    Cause('the brake lets go faster than it takes hold', 'of its lag', 'c31_per_s',
          lambda s: (s.static_Nm < s.torque_Nm).astype(float), RELEASE.key, 'the brake lets go more slowly than it takes hold'),
    Cause("the brake's torque is no straight line of its duty", 'of b(u) at small torques', 'brake',
          lambda s: s.static_Nm / s.full_Nm - 1.0, CURVATURE.key),
    Cause("the brake's torque changes with the upper wheel's speed", 'per rad/s', 'brake', lambda s: s.omega_rad_s[:, 0]),
    Cause('the friction falls with the sliding speed', 'per m/s', 'road', lambda s: -s.sliding_m_s, FRICTION_FALL.key,
          'the friction rises with the sliding speed'),
    Cause("the friction changes with the lower wheel's speed", 'per rad/s', 'road', lambda s: s.omega_rad_s[:, 1]),
    Cause('the friction changes with time', 'per s', 'road', lambda s: s.time_s),
    Cause("the friction follows the lower wheel's angle", 'at the sine', 'road', lambda s: np.sin(s.angle_rad[:, 1])),
    Cause("the friction follows the lower wheel's angle", 'at the cosine', 'road', lambda s: np.cos(s.angle_rad[:, 1])),
    Cause("the friction follows the upper wheel's angle", 'at the sine', 'road', lambda s: np.sin(s.angle_rad[:, 0])),
    Cause("the friction follows the upper wheel's angle", 'at the cosine', 'road', lambda s: np.cos(s.angle_rad[:, 0])),
    Cause('the motor changes with time', 'per s', 'motor', lambda s: s.time_s),
    Cause("the upper wheel's bearing drags with the square of its speed", 'N m s^2', 'upper bearing',
          lambda s: s.omega_rad_s[:, 0]**2),
    Cause("the lower wheel's bearing drags with the square of its speed", 'N m s^2', 'lower bearing',
          lambda s: s.omega_rad_s[:, 1]**2),
)


@dataclass
class Found:
    """A cause with its coefficient and its standard deviation."""
    cause: Cause
    coefficient: float
    sd: float

    @property
    def sure(self) -> float:
        return abs(self.coefficient) / self.sd

    @property
    def words(self) -> str:
        return self.cause.against if self.coefficient < 0.0 and self.cause.against else self.cause.words


def causes_of(fit: Fit, disturbances: Disturbances) -> list[Found]:
    """Each cause that the problem has no parameter for, alone, surest first. Linearises a copy of the fit."""
    if fit.problem.with_delay:
        wide = fit.copy()
    else:
        wide = fit.copy(problem=dataclasses.replace(fit.problem, with_delay=True), values={**fit.values, DELAY: 0.0},
                        free=np.append(fit.free, False))
    wide.scale = linearise(wide.problem, wide.values, wide.pieces)
    causes = [one for one in CAUSES if one.flaw not in wide.problem.flaws]
    N, n = _normals(wide, disturbances, causes)
    size = len(wide.scale)
    precision, towards = wide.prior()
    N[np.arange(size), np.arange(size)] += precision
    n[:size] += towards
    free = np.flatnonzero(wide.free)
    out = []
    for number, cause in enumerate(causes):
        place = size + number
        if not N[place, place] > 0.0:
            continue  # nothing in these logs would show it
        at = np.append(free, place)
        covariance = inverse(N[np.ix_(at, at)])
        out.append(Found(cause, float(covariance[-1] @ n[at]), float(np.sqrt(covariance[-1, -1]))))
    return sorted(out, key=lambda one: -one.sure)


def _signals(fit: Fit) -> list[Signals]:
    """Of each log."""
    problem, values = fit.problem, fit.values
    out = []
    for number, motion in enumerate(problem.motions):
        log, brake = problem.flawed(number, values)
        torque, static = brake_torques(log, brake), static_torques(log, brake)
        omega = np.where(motion.stands, 0.0, motion.speed_rad_s)
        sliding = np.abs(problem.given['r2_m'] * omega[:, 1] - values['r1_m'] * omega[:, 0])
        flaws = amounts(log, motion, brake, (FADING.key, COOLING.key, DEAD_TIME.key))
        out.append(Signals(torque, static, full_Nm(brake), -flaws[FADING.key], flaws[COOLING.key], omega, motion.smooth_rad,
                           sliding, flaws[DEAD_TIME.key], log.time_s - log.time_s[0]))
    return out


def _normals(fit: Fit, disturbances: Disturbances, causes: Sequence[Cause]) -> tuple[np.ndarray, np.ndarray]:
    """The normal equations with a column for each cause behind the parameters'."""
    problem, keys = fit.problem, fit.keys
    way = _relative(problem, fit.values, fit.scale)
    follows = [[cause.follows(one) for cause in causes] for one in _signals(fit)]
    directions = np.zeros((len(keys), len(causes)))
    for number, cause in enumerate(causes):
        if cause.acts in DISTURBANCES:
            directions[:, number] = way[DISTURBANCES.index(cause.acts)]
        else:
            i = keys.index(cause.acts)
            directions[i, number] = 1.0 / fit.scale[i] if cause.acts == DELAY else fit.values[cause.acts] / fit.scale[i]
    size = len(keys)
    N, n = np.zeros((size + len(causes),) * 2), np.zeros(size + len(causes))
    for piece in fit.pieces:
        at, linear = piece.columns, dict(piece.linear)
        share = np.stack([by_windows(piece, per_row) for per_row in follows[piece.log]], axis=1)
        rows = np.repeat(share, np.diff(piece.first), axis=0)
        for name, of in (('by_parameter', rows), ('end_by_parameter', share)):
            more = linear[name] @ directions[at] * of[:, None, :]
            linear[name] = np.ascontiguousarray(np.concatenate([linear[name], more], axis=2))
        linear.update(_core.condense(linear))
        wider = np.concatenate([way[:, at], np.zeros((len(way), len(causes)))], axis=1)
        part, right, *_ = _core.filter_pieces([linear], np.ascontiguousarray(wider), disturbances.sd,
                                              disturbances.time_constant_s, problem.variance_rad2)[0]
        place = np.concatenate([at, size + np.arange(len(causes))])
        N[np.ix_(place, place)] += part
        n[place] += right[:, 0]
    return N, n


def explained(fit: Fit, disturbances: Disturbances, check: Callable[[], None],
              say: Callable[[str], None]) -> tuple[Fit, list[Found]]:
    """The fit with those flaws that explain what the disturbances have in common, and the causes that are left,
    surest first: none of them is in the plant."""
    while True:
        check()
        causes = causes_of(fit, disturbances)
        left = [one for one in causes if one.sure > SURE]
        better = _with_a_flaw(fit, causes, disturbances, check) if left else None
        if better is None:
            return fit, left
        fit, taken = better
        say(f'{taken.words}: fitted as {taken.flaw} = {fit.values[taken.flaw]:.3g}')


def _with_a_flaw(fit: Fit, causes: Sequence[Found], disturbances: Disturbances,
                 check: Callable[[], None]) -> tuple[Fit, Cause] | None:
    surest = causes[0]
    for one in causes:
        if not one.cause.flaw or one.sure < max(SURE, WORTH_A_TRY * surest.sure):
            continue
        flawed = _with_flaw(fit, one, disturbances, check)
        if flawed is None:
            continue
        if one is surest or all(other.cause is not surest.cause or other.sure < STILL_THERE * surest.sure
                                for other in causes_of(flawed, disturbances)):
            return flawed, one.cause
    return None


def _with_flaw(fit: Fit, found: Found, disturbances: Disturbances, check: Callable[[], None]) -> Fit | None:
    """The fit with one more flaw; None if it is not there after all: of another sign, not sure by the likelihood, or against
    what logs that are left out say."""
    key = found.cause.flaw
    problem = dataclasses.replace(fit.problem, flaws=(*fit.problem.flaws, key))
    at = [p.key for p in problem.parameters].index(key)
    flaw = problem.parameters[at]
    value = flaw.none + found.coefficient
    if not flaw.least < value:
        return None
    value = min(value, 0.9 * flaw.most)
    flawed = fit.copy(problem=problem, values={**fit.values, key: value}, free=np.insert(fit.free, at, True), moved=None)
    to_rest(flawed, disturbances, 6, check)
    with_it, without = _against(flawed, disturbances, key), _against(fit, disturbances)
    return flawed if with_it[0] < without[0] - SURE**2 and sum(with_it) < sum(without) else None


def _against(fit: Fit, disturbances: Disturbances, doubted: str = '') -> tuple[float, float]:
    """-2 log likelihood of all logs, and of each by what the others tell. The first one decides, with the second, about a flaw
    that one log alone shows."""
    cost, found = run_filter(fit, disturbances)
    keep_normals(fit, found)
    return cost, left_out_cost(fit, doubted)


def sentence(causes: Sequence[Found], fit: Fit) -> str:
    """What does not fit, where it shows most, and what that means."""
    surest = causes[0]
    log, phase = _where(surest.cause, fit)
    also = ', '.join(dict.fromkeys(one.words for one in causes[1:3] if one.words != surest.words))
    flaw = surest.cause.flaw
    why = f'The parameter plant.{flaw} does not explain it' if flaw else 'The plant has no parameter for it'
    return (f'the logs do not fit this plant: {surest.words} ({surest.coefficient:.3g} {surest.cause.unit}, '
            f'{surest.sure:.0f} standard deviations from none), most in {log}{f", phase {phase}" if phase else ""}. '
            f'{why}{f"; {also} would show so as well" if also else ""}')


def _where(cause: Cause, fit: Fit) -> tuple[str, str]:
    """The log and its phase that say most of a cause."""
    weight: dict[tuple[str, str], float] = {}
    turning = [np.zeros(len(log), dtype=bool) for log in fit.problem.logs]
    for piece in fit.pieces:
        turning[piece.log][piece.rows] = True
    for log, signals, turns in zip(fit.problem.logs, _signals(fit), turning):
        follows = cause.follows(signals) * turns
        if cause.acts in ('brake', 'c31_per_s', DELAY):
            follows = follows * (signals.torque_Nm > 0.0)
        if cause.acts == 'road':
            follows = follows * (log.wheels_apart == 0.0)
        for phase in dict.fromkeys(log.phase):
            weight[log.name, str(phase)] = float(np.sum(follows[log.phase == phase]**2) * log.period_s)
    return max(weight, key=lambda place: weight[place])
