"""What the disturbances of a fit have in common: structure that the plant lacks, and its cause.

A fit to a rig that the plant does not describe follows the logs all the same: its random factors take up what the plant
lacks, and the parameters are wrong. But then the factors are not random. They follow something: the energy in the brake, the
direction of its duty, a speed, an angle. For each such cause the plant's derivatives by a factor, times what the factor would
follow, are one more column of the fit. Its coefficient c and standard deviation s come from the same filter, with the
disturbances as noise and all parameters free: |c| / s is about 1 for a rig that wanders at random, whatever the cause.
"""
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..core import _core
from .brake_flaws import amounts, brake_torques, fallen, full_Nm, leaky, static_torques
from .linear import _relative, by_windows, keep_normals, left_out_cost, linearise, run_filter, solved, to_rest
from .logs import Log
from .parameters import COOLING, CURVATURE, DEAD_TIME, DELAY, FADING, FLAWS, FRICTION_FALL, HYSTERESIS, RELEASE, WHEELS
from .problem import DISTURBANCES, Disturbances, Fit, inverse

#: a cause is believed if its coefficient is this many standard deviations from 0
SURE = 5.0
#: a cause that there is may be this sure
MOST_SURE = 10.0
#: a flaw is tried in place of a surer cause if it is this share as sure, and taken if that cause is then half as sure
WORTH_A_TRY = 0.3
STILL_THERE = 0.5
#: a cause may be what the disturbances stand for: it is tried with these shares of them, too
SHARES = (1.0, 0.1)


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
    log: Log


@dataclass(frozen=True)
class Cause:
    """words, against: what a positive and a negative coefficient mean; acts: the disturbance that it would be
    (problem.DISTURBANCES), or the parameter; follows: what that would follow, at each row, in `unit`; flaw: the parameter of
    the plant that describes it, if there is one: its value is `none` plus the coefficient. What follows an angle, by its sine
    and cosine, has a phase of its own in each log: counters may begin anew."""
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
    Cause('the friction is no straight line of the sliding speed', 'per (m/s)^2', 'road', lambda s: s.sliding_m_s**2),
    Cause("the friction changes with the lower wheel's speed", 'per rad/s', 'road', lambda s: s.omega_rad_s[:, 1]),
    Cause('the friction changes with time', 'per s', 'road', lambda s: s.log.time_s - s.log.time_s[0]),
    *(Cause(words.format(wheel), 'of itself', acts,
            lambda s, at=at: np.stack([np.sin(s.angle_rad[:, at]), np.cos(s.angle_rad[:, at])], axis=1))  # type: ignore[misc]
      for words, acts, wheels in (("the friction follows the {} wheel's angle", 'road', WHEELS),
                                  ('the {} wheel is not round', 'r1_m', WHEELS),
                                  ("the brake's torque follows the {} wheel's angle", 'brake', WHEELS[:1]))
      for at, wheel in enumerate(wheels)),
    Cause('the motor changes with time', 'per s', 'motor', lambda s: s.log.time_s - s.log.time_s[0]),
    *(Cause('the motor gets weaker with its use', f'per s of full duty, over {recovers_s:g} s', 'motor',
            lambda s, leaves=1.0 / recovers_s: -leaky(s.log, leaves, s.log.motor_pwm), '',  # type: ignore[misc]
            'the motor gets stronger with its use') for recovers_s in (3.0, 10.0, 30.0)),
    Cause("the motor's torque is no straight line of its speed", 'per (rad/s)^2', 'motor', lambda s: s.omega_rad_s[:, 1]**2),
    Cause("the motor's torque is no straight line of its duty", 'per duty', 'motor', lambda s: s.log.motor_pwm - 1.0),
    *(Cause(f"the {wheel} wheel's bearing drags more as time goes", 'N m per s', f'{wheel} bearing',
            lambda s: s.log.time_s - s.log.time_s[0], '', f"the {wheel} wheel's bearing drags less as time goes")
      for wheel in WHEELS),
    *(Cause(f"the {wheel} wheel's bearing drags with the square of its speed", 'N m s^2', f'{wheel} bearing',
            lambda s, at=at: s.omega_rad_s[:, at]**2) for at, wheel in enumerate(WHEELS)),  # type: ignore[misc]
)


@dataclass
class Found:
    """A cause with its coefficient; sure: what it takes off -2 log likelihood, as a number of standard deviations; that with
    the share of the disturbances that is likeliest with it; moves: how it would move the free parameters' scaled values, with
    the disturbances as they are, and their errors (see _moves); beside: of the surest one, the surest of the others with it."""
    cause: Cause
    coefficient: float
    sure: float
    share: float
    beside: 'Found | None' = None
    moves: np.ndarray = field(default_factory=lambda: np.zeros((0, 1)))

    @property
    def rest(self) -> float:
        """How sure the surest of the others is beside it."""
        return self.beside.sure if self.beside else 0.0

    @property
    def words(self) -> str:
        return self.cause.against if self.coefficient < 0.0 and self.cause.against else self.cause.words

    @property
    def flaw(self) -> str:
        """The plant's parameter that may describe it, with this sign."""
        return next((one.key for one in FLAWS if one.key == self.cause.flaw and one.least < one.none + self.coefficient), '')


def causes_of(fit: Fit, disturbances: Disturbances) -> list[Found]:
    """Each cause that the problem has no parameter for, alone, surest first. Linearises a copy of the fit."""
    wide = fit.changed({}, with_delay=True)
    if not fit.problem.with_delay:
        wide.values[DELAY], wide.free[-1] = 0.0, False
    wide.scale = linearise(wide.problem, wide.values, wide.pieces)
    causes = [one for one in CAUSES if one.flaw not in wide.problem.flaws]
    precision, towards = wide.prior()
    size, equations, bases = len(precision), [], []
    for share in SHARES:
        N, n, cost, places = _normals(wide, disturbances.times(share), causes)
        N[np.arange(size), np.arange(size)] += precision
        n[:size] += towards
        equations.append((N, n))
        bases.append(cost - float(n[:size] @ solved(wide, N[:size, :size] - np.diag(precision), n[:size] - towards)))
    more = [base - min(bases) for base in bases]
    free = np.flatnonzero(wide.free)
    shown = [(cause, at[np.diag(N)[at] > 0.0]) for cause, at in zip(causes, places)]  # by these logs

    def found(cause: Cause, at: np.ndarray, beside: np.ndarray, costs: Sequence[float]) -> Found:
        gain, x, share = max((gain - cost, x, share) for one, share, cost in zip(equations, SHARES, costs)
                             for x, gain in (_gain(*one, beside, at),))
        return Found(cause, x, float(np.sqrt(max(gain, 0.0))), share, moves=_moves(*equations[0], free, at))
    of = [(found(cause, at, free, more), at) for cause, at in shown if at.size]
    of.sort(key=lambda one: -one[0].sure)
    for surest, beside in of[:1]:
        with_it = [cost - _gain(*one, free, beside)[1] for one, cost in zip(equations, more)]
        beside, more = np.append(free, beside), [cost - min(with_it) for cost in with_it]
        surest.beside = max((found(one.cause, at, beside, more) for one, at in of[1:]), key=lambda one: one.sure, default=None)
    return [one for one, _ in of]


def _gain(N: np.ndarray, n: np.ndarray, beside: np.ndarray, at: np.ndarray) -> tuple[float, float]:
    """Of the columns `at`, alone but for what is `beside` them: the coefficient, or the largest of an angle's, and what they
    take off -2 log likelihood, less what nothing would take off with more columns than one."""
    chosen = np.append(beside, at)
    some = N[np.ix_(chosen, chosen)]
    some[np.arange(len(beside), len(chosen)), np.arange(len(beside), len(chosen))] *= 1.0 + 1e-9  # two may be one
    covariance = inverse(some)
    x, own = (covariance @ n[chosen])[-at.size:], covariance[-at.size:, -at.size:]
    size = x[0] if at.size == 1 else np.hypot(x[::2], x[1::2]).max()
    return float(size), float(x @ np.linalg.solve(own, x)) - 2.0 * (at.size - 1)


def _moves(N: np.ndarray, n: np.ndarray, free: np.ndarray, at: np.ndarray) -> np.ndarray:
    """M, (parameters at `free`, 1 + columns at `at`): M M' is how far the solution for those parameters moves when these
    columns join it, squared, and what their errors add to its covariance."""
    towards = inverse(N[np.ix_(free, free)]) @ np.column_stack([n[free], N[np.ix_(free, at)]])
    covariance = inverse(N[np.ix_(at, at)] - N[np.ix_(at, free)] @ towards[:, 1:])
    coefficients = covariance @ (n[at] - N[np.ix_(at, free)] @ towards[:, 0])
    return np.asarray(towards[:, 1:] @ np.column_stack([coefficients, np.linalg.cholesky(covariance)]))


def unsettled(fit: Fit, disturbances: Disturbances) -> np.ndarray:
    """What the causes that nobody can be sure of add to the covariance of the free parameters' scaled changes.

    The estimates are those without any cause. Averaged over "no cause" and each of the K causes alone, their second moment
    grows by the sum of w_k M_k M_k' (see _moves), w_k the cause's probability: odds of 1 / K before the logs, times the Bayes
    factor exp(z^2 t^2 / (2 (1 + t^2))) / sqrt(1 + t^2) of a cause that is sure by z standard deviations and may be by t = 10
    (Hoeting et al. 1999, Bayesian model averaging)."""
    causes, free = causes_of(fit, disturbances), np.ix_(fit.free, fit.free)
    out, total = np.zeros((len(fit.scale),) * 2), 1.0
    for one in causes:
        odds = np.exp(0.5 * one.sure**2 * MOST_SURE**2 / (1.0 + MOST_SURE**2)) / np.sqrt(1.0 + MOST_SURE**2) / len(causes)
        out[free] += odds * (one.moves @ one.moves.T)
        total += odds
    return out / total


def _signals(fit: Fit) -> list[Signals]:
    problem, values = fit.problem, fit.values
    out = []
    for number, motion in enumerate(problem.motions):
        log, brake = problem.flawed(number, values)
        torque, static = brake_torques(log, brake), static_torques(log, brake)
        omega = np.where(motion.stands, 0.0, motion.speed_rad_s)
        sliding = np.abs(problem.given['r2_m'] * omega[:, 1] - values['r1_m'] * omega[:, 0])
        flaws = amounts(log, motion, brake, (FADING.key, COOLING.key, DEAD_TIME.key))
        out.append(Signals(torque, static, full_Nm(brake), -flaws[FADING.key], flaws[COOLING.key], omega, motion.smooth_rad,
                           sliding, flaws[DEAD_TIME.key], log))
    return out


def _normals(fit: Fit, disturbances: Disturbances,
             causes: Sequence[Cause]) -> tuple[np.ndarray, np.ndarray, float, list[np.ndarray]]:
    """The normal equations with columns for the causes behind the parameters', their constant, and each cause's places."""
    problem, keys = fit.problem, fit.keys
    way = _relative(problem, fit.values, fit.scale)
    follows = [[cause.follows(one).reshape(len(one.log), -1) for cause in causes] for one in _signals(fit)]
    widths = [one.shape[1] for one in follows[0]]
    logs, size = len(follows), len(keys)
    ends = size + np.cumsum([width * (logs if width > 1 else 1) for width in widths])
    places = [np.arange(begin, end) for begin, end in zip([size, *ends], ends)]
    directions = np.zeros((size, len(causes)))
    for number, cause in enumerate(causes):
        if cause.acts in DISTURBANCES:
            directions[:, number] = way[DISTURBANCES.index(cause.acts)]
        else:
            i = keys.index(cause.acts)
            directions[i, number] = 1.0 / fit.scale[i] if cause.acts == DELAY else fit.values[cause.acts] / fit.scale[i]
    directions = np.repeat(directions, widths, axis=1)
    N, n, cost = np.zeros((ends[-1],) * 2), np.zeros(ends[-1]), 0.0
    for piece in fit.pieces:
        at, linear = piece.columns, dict(piece.linear)
        per_row = np.concatenate(follows[piece.log], axis=1)
        share = np.stack([by_windows(piece, one) for one in per_row.T], axis=1)
        rows = np.repeat(share, np.diff(piece.first), axis=0)
        for name, of in (('by_parameter', rows), ('end_by_parameter', share)):
            more = linear[name] @ directions[at] * of[:, None, :]
            linear[name] = np.concatenate([linear[name], more], axis=2)
        linear.update(_core.condense(linear))
        wider = np.concatenate([way[:, at], np.zeros((len(way), sum(widths)))], axis=1)
        part, right, square, log_variance, _ = _core.filter_pieces(
            [linear], wider, disturbances.sd, disturbances.time_constant_s, problem.variance_rad2)[0]
        cost += float(square[0]) + log_variance
        own = [one[width * piece.log:][:width] if width > 1 else one for one, width in zip(places, widths)]
        place = np.concatenate([at, *own])
        N[np.ix_(place, place)] += part
        n[place] += right[:, 0]
    return N, n, cost, places


def explained(fit: Fit, disturbances: Disturbances, check: Callable[[], None],
              say: Callable[[str], None]) -> tuple[Fit, list[Found]]:
    """The fit with those flaws that explain what the disturbances have in common, and the causes that are left,
    surest first: none of them is in the plant."""
    while True:
        check()
        causes = causes_of(fit, disturbances)
        left = [one for one in causes if one.sure > SURE]
        if causes and not left and causes[0].beside and causes[0].rest > SURE:
            left = [causes[0], causes[0].beside]  # each alone hides the other
        better = _with_a_flaw(fit, left, disturbances, check) if left else None
        if better is None:
            return fit, left
        fit, taken = better
        say(f'{taken.words}: fitted as {taken.flaw} = {fit.values[taken.flaw]:.3g}')


def _with_a_flaw(fit: Fit, causes: Sequence[Found], disturbances: Disturbances,
                 check: Callable[[], None]) -> tuple[Fit, Cause] | None:
    surest = causes[0]
    for one in causes:
        if not one.flaw or one.sure < WORTH_A_TRY * surest.sure:
            continue
        flawed = _with_flaw(fit, one, disturbances, check)
        if flawed is not None and (one is surest or all(other.cause is not surest.cause or other.sure < STILL_THERE * surest.sure
                                                        for other in causes_of(flawed, disturbances))):
            return flawed, one.cause
    return None


def _with_flaw(fit: Fit, found: Found, disturbances: Disturbances, check: Callable[[], None]) -> Fit | None:
    """The fit with one more flaw; None if it is not there after all: not sure by the likelihood, or against what logs that
    are left out say."""
    key = found.flaw
    flaw = next(flaw for flaw in FLAWS if flaw.key == key)
    value = min(flaw.none + found.coefficient, 0.9 * flaw.most)
    flawed = fit.changed({key: value}, flaws=(*fit.problem.flaws, key))
    less = disturbances.times(found.share)
    to_rest(flawed, less, 6, check)
    with_it, without = _against(flawed, less, key), min(_against(fit, disturbances.times(share)) for share in {1.0, found.share})
    least = SURE**2 if found.sure > SURE else 0.0  # one that another hides is sure with that one only
    noise = 2.0 * found.sure  # one standard deviation of what the logs left out say of a cause that is this sure
    return flawed if with_it[0] < without[0] - least and sum(with_it) < sum(without) + noise else None


def _against(fit: Fit, disturbances: Disturbances, doubted: str = '') -> tuple[float, float]:
    """-2 log likelihood of all logs, and of each by what the others tell. The first one decides, with the second, about a flaw
    that one log alone shows."""
    cost, found = run_filter(fit, disturbances)
    keep_normals(fit, found)
    return cost, left_out_cost(fit, doubted)


def sentence(causes: Sequence[Found], fit: Fit) -> str:
    """What does not fit, where it shows most, and what that means: a cause is stated only if nothing else is left beside it."""
    surest = causes[0]
    log, phase = _where(surest.cause, fit)
    seen = (f'{surest.words} ({surest.coefficient:.3g} {surest.cause.unit}, {surest.sure:.0f} standard deviations from none), '
            f'most in {log}{f", phase {phase}" if phase else ""}')
    also = ' or '.join(list(dict.fromkeys(one.words for one in causes[1:] if one.words != surest.words))[:2])
    most = max(SURE, WORTH_A_TRY * surest.sure)
    tried = ', '.join(f'plant.{one.flaw}' for one in causes if one.flaw and one.sure >= most)
    if not surest.flaw and surest.rest < most:
        return f'the logs do not fit this plant: {seen}. The plant has no parameter for it'
    return (f'the logs do not fit this plant, and the cause is none that it has: it is most as if {seen}'
            f'{f", then as if {also}" if also else ""}. '
            f'{f"{tried}: tried, and no explanation" if tried else "None of these explains it alone"}')


def _where(cause: Cause, fit: Fit) -> tuple[str, str]:
    """The log and its phase that say most of a cause: where what it acts on is there."""
    weight: dict[tuple[str, str], float] = {}
    turning = [np.zeros(len(log), dtype=bool) for log in fit.problem.logs]
    for piece in fit.pieces:
        turning[piece.log][piece.rows] = True
    for log, signals, turns in zip(fit.problem.logs, _signals(fit), turning):
        follows = cause.follows(signals).reshape(len(log), -1)
        slides, phases = signals.sliding_m_s * (log.wheels_apart == 0.0), log.phase
        there = turns * {'road': slides, 'r1_m': slides, 'motor': log.motor_pwm}.get(cause.acts, np.ones(len(log)))
        if cause.acts in ('brake', 'c31_per_s', DELAY):
            there *= signals.torque_Nm
            phases = phases[np.maximum.accumulate(np.where(log.brake_pwm > 0.0, np.arange(len(log)), 0))]  # that it is of
        for phase in dict.fromkeys(phases):
            weight[log.name, str(phase)] = float(np.sum((follows * there[:, None])[phases == phase]**2) * log.period_s)
    return max(weight, key=lambda place: weight[place])
