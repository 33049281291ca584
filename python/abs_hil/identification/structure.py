"""What the disturbances of a fit have in common: structure that the plant lacks, and its cause.

A fit to a rig that the plant does not describe follows the logs all the same: its random factors take up what the plant
lacks, and the parameters are wrong. But then the factors are not random. They follow something: the energy in the brake, the
direction of its duty, a speed, an angle. For each such cause the plant's derivatives by a factor, times what the factor would
follow, are one more column of the fit, with those by the flaws that the plant has. With N x = n the normal equations by the same
filter, of the free parameters and a cause's column,

    c    the column's part of x = N^-1 n, and s^2 its variance, of N^-1
    z    c / s: about 1 for a rig that wanders at random, whatever the cause
    z^2  what the column takes off -2 log likelihood: its gain

z says that a column takes something off, never that it explains: beside the optimum every column does. So a fit is asked only
where it rests, and a cause is named only if it suffices (90 % of the gain of all columns together), no other one has half of its
gain, and logs that are left out say the same.
"""
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from .brake_flaws import brake_torques, leaky
from .linear import _relative, by_windows, keep_normals, left_out_cost, linearise, run_filter, solved, to_rest
from .logs import Log
from .parameters import FLAWS, JOINING, WHEELS, Parameter
from .problem import DISTURBANCES, Disturbances, Fit, Piece, inverse

#: a cause is believed if its coefficient is this many standard deviations from 0
SURE = 5.0
#: a cause that there is may be this sure
MOST_SURE = 10.0
#: a flaw is tried in place of a surer cause if it is this share as sure, and taken if that cause is then half as sure
WORTH_A_TRY = 0.3
STILL_THERE = 0.5
#: a cause may be what the disturbances stand for: it is tried with these shares of them, too
SHARES = (1.0, 0.1)
#: of the gain of all columns together, what a cause must have to be named; and of its gain, what no other may
SUFFICES = 0.9
RIVAL = 0.5
#: a log shows a cause if it alone is this sure of its sign
SHOWS = 3.0


@dataclass
class Signals:
    """What a cause may follow, at each row of a log."""
    torque_Nm: np.ndarray
    omega_rad_s: np.ndarray
    angle_rad: np.ndarray
    sliding_m_s: np.ndarray
    log: Log


@dataclass(frozen=True)
class Cause:
    """words, against: what a positive and a negative coefficient mean; acts: the disturbance that it would be
    (problem.DISTURBANCES), or the parameter; follows: what that would follow, at each row, in `unit`; flaw: the plant's parameter
    that describes it, if there is one: its value is `none` plus the coefficient, and its own derivative is the column. What
    follows an angle, by its sine and cosine, has a phase of its own in each log: counters may begin anew."""
    words: str
    unit: str
    acts: str
    follows: Callable[[Signals], np.ndarray] = lambda s: np.ones(len(s.log))
    flaw: str = ''
    against: str = ''


CAUSES = (
    Cause('the brake gets weaker with the energy put in', 'per J', 'brake', flaw='brake_fading_per_J',
          against='the brake gets stronger with the energy put in'),
    Cause('the brake recovers as it cools', 'of its heat per s', 'brake', flaw='brake_cooling_per_s',
          against='the brake fades more the longer it stays hot'),
    Cause('the brake holds more after its duty fell than after it rose', 'of its torque', 'brake', flaw='brake_hysteresis',
          against='the brake holds less after its duty fell than after it rose'),
    Cause('the brake acts late', 's', 'brake', flaw='brake_dead_time_s', against='the brake acts early'),
    Cause('the brake lets go faster than it takes hold', 'of its lag', 'brake', flaw='brake_release_ratio',
          against='the brake lets go more slowly than it takes hold'),
    Cause("the brake's torque is no straight line of its duty", 'of b(u) at small torques', 'brake', flaw='brake_curvature'),
    Cause("the brake's torque changes with the upper wheel's speed", 'per rad/s', 'brake', lambda s: s.omega_rad_s[:, 0]),
    Cause('the friction falls with the sliding speed', 'per m/s', 'road', flaw='friction_fall_s_m',
          against='the friction rises with the sliding speed'),
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
    the disturbances as they are, and their errors (see _moves); beside: of the surest one, the surest of the others with it;
    together: the gain of all causes; foretold: of the surest one, whether logs that are left out say the same."""
    cause: Cause
    coefficient: float
    sure: float
    share: float
    beside: 'Found | None' = None
    moves: np.ndarray = field(default_factory=lambda: np.zeros((0, 1)))
    together: float = np.inf
    foretold: bool = False

    @property
    def words(self) -> str:
        return self.cause.against if self.coefficient < 0.0 and self.cause.against else self.cause.words

    @property
    def flaw(self) -> str:
        """The plant's parameter that may describe it, with this sign."""
        return next((one.key for one in FLAWS if one.key == self.cause.flaw and one.least < one.none + self.coefficient), '')


def causes_of(fit: Fit, disturbances: Disturbances) -> list[Found]:
    """Each cause that the problem has no parameter for, alone, surest first. Linearises a copy of the fit."""
    wide, shown = _widened(fit)
    free, systems = np.flatnonzero(wide.free), []
    for share in SHARES[::-1]:  # _foretold needs the normal equations that the last one leaves
        cost, filtered = run_filter(wide, disturbances.times(share))
        N, n = keep_normals(wide, filtered)
        precision, towards = wide.prior()
        systems.append((share, cost, (N + np.diag(precision), n + towards)))
        shown = [(cause, at[np.diag(N)[at] > 0.0]) for cause, at in shown]  # by these logs

    def found(cause: Cause, at: np.ndarray, beside: np.ndarray = free[:0]) -> Found:
        costs = [cost - (_gain(*one, free, beside)[1] if beside.size else 0.0) for _, cost, one in systems]
        taken, x, share = max((gain - cost, x, share) for (share, _, one), cost in zip(systems, costs)
                              for x, gain in (_gain(*one, np.append(free, beside), at),))
        return Found(cause, x * (wide.scale[at[0]] if cause.flaw else 1.0), float(np.sqrt(max(taken + min(costs), 0.0))), share,
                     moves=_moves(*systems[-1][2], free, at))
    of = sorted(((found(cause, at), at) for cause, at in shown if at.size), key=lambda one: -one[0].sure)
    for surest, at in of[:1]:
        surest.beside = max((found(one.cause, other, at) for one, other in of[1:]), key=lambda one: one.sure, default=None)
        every = np.concatenate([other for _, other in of])
        least = min(cost for _, cost, _ in systems)
        surest.together = max(_together(*one, free, every) - cost + least for _, cost, one in systems)
        surest.foretold = _foretold(wide, at)
    return [one for one, _ in of]


def _widened(fit: Fit) -> tuple[Fit, list[tuple[Cause, np.ndarray]]]:
    """A copy with a column for every cause, linearised, and each cause's places among the parameters."""
    missing = [flaw for flaw in FLAWS if flaw.key not in fit.problem.flaws]
    causes = [one for one in CAUSES if not one.flaw or any(flaw.key == one.flaw for flaw in missing)]
    follows = [[cause.follows(one).reshape(len(one.log), -1) for cause in causes] for one in _signals(fit)]
    keys = {number: [f'cause_{number}_{i}' if of.shape[1] == 1 else f'cause_{number}_{i}_of_log_{log}'
                     for log in range(1 if of.shape[1] == 1 else len(follows)) for i in range(of.shape[1])]
            for number, of in enumerate(follows[0]) if not causes[number].flaw}
    columns = tuple(Parameter(key, '', 'cause', '', floor=1.0, prior=1e9) for some in keys.values() for key in some)
    wide = fit.changed({flaw.key: flaw.none for flaw in missing} | {p.key: 0.0 for p in columns},
                       flaws=(*fit.problem.flaws, *(flaw.key for flaw in missing)), causes=columns)
    wide.free &= np.isin(wide.keys, fit.keys)

    def fill(piece: Piece, scale: np.ndarray) -> None:
        way = _relative(wide.problem, wide.values, scale)
        for number, some in keys.items():
            cause, of = causes[number], follows[piece.log][number]
            along = way[DISTURBANCES.index(cause.acts)] if cause.acts in DISTURBANCES else (
                (np.array(wide.keys) == cause.acts) * wide.values[cause.acts] / scale)
            share = np.stack([by_windows(piece, one) for one in np.transpose(of)], axis=1)
            at = np.flatnonzero(np.isin(piece.columns, [wide.keys.index(key) for key in some]))
            for name, by in (('by_parameter', np.repeat(share, np.diff(piece.first), axis=0)), ('end_by_parameter', share)):
                piece.linear[name][..., at] = (piece.linear[name] @ along[piece.columns])[..., None] * by[:, None, :]
    wide.scale = linearise(wide.problem, wide.values, wide.pieces, fill=fill)
    return wide, [(cause, np.array([wide.keys.index(key) for key in keys.get(number, [cause.flaw])]))
                  for number, cause in enumerate(causes)]


def _foretold(wide: Fit, at: np.ndarray) -> bool:
    """Whether each log that shows the cause shows the same sign of it, and all of them are likelier by what the others say of it
    and the parameters. What follows an angle has another phase in each log: at least two must show it."""
    logs, free = len(wide.normal), np.flatnonzero(wide.free)
    x = solved(wide, wide.normal.sum(axis=0), wide.right.sum(axis=0))
    score = np.array([right[at] - normal[at][:, free] @ x[free] for right, normal in zip(wide.right, wide.normal)])
    size = np.sqrt(np.stack([np.diag(normal)[at] for normal in wide.normal]))
    shows = np.abs(score) > SHOWS * np.maximum(size, 1e-300)
    if at.size > 1:
        return bool(shows.any(axis=1).sum() >= min(2, logs) and logs > 1)
    without = left_out_cost(wide)
    wide.free[at] = True
    better = left_out_cost(wide) < without
    wide.free[at] = False
    return logs > 1 and better and len(set(np.sign(score[shows]))) == 1


def _reduced(N: np.ndarray, n: np.ndarray, beside: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The normal equations of the columns `at` where those `beside` them follow: matrix and right side. The last one says how
    these follow, (beside, 1 + at): their solution without any of `at`, less the columns times what `at` is."""
    follow = inverse(N[np.ix_(beside, beside)]) @ np.column_stack([n[beside], N[np.ix_(beside, at)]])
    left = np.column_stack([n[at], N[np.ix_(at, at)]]) - N[np.ix_(at, beside)] @ follow
    return left[:, 1:], left[:, 0], follow


def _gain(N: np.ndarray, n: np.ndarray, beside: np.ndarray, at: np.ndarray) -> tuple[float, float]:
    """Of the columns `at`, alone but for what is `beside` them: the coefficient, or the largest of an angle's, and what they
    take off -2 log likelihood, less what nothing would take off with more columns than one."""
    left, right, _ = _reduced(N, n, beside, at)
    x = np.linalg.solve(left + 1e-9 * np.diag(np.diag(N)[at]), right)  # two columns may be one
    return float(x[0] if at.size == 1 else np.hypot(x[::2], x[1::2]).max()), float(x @ right) - 2.0 * (at.size - 1)


def _together(N: np.ndarray, n: np.ndarray, beside: np.ndarray, at: np.ndarray) -> float:
    """What all columns `at` together take off -2 log likelihood, less what nothing would. Some may be sums of others."""
    left, right, _ = _reduced(N, n, beside, at)
    d = 1.0 / np.sqrt(np.diag(N)[at])
    values, vectors = np.linalg.eigh(left * np.outer(d, d))
    kept = values > 1e-7
    return float(np.sum((vectors.T @ (d * right))[kept]**2 / values[kept]) - kept.sum())


def _moves(N: np.ndarray, n: np.ndarray, free: np.ndarray, at: np.ndarray) -> np.ndarray:
    """M, (parameters at `free`, 1 + columns at `at`): M M' is how far the solution for those parameters moves when these
    columns join it, squared, and what their errors add to its covariance."""
    left, right, follow = _reduced(N, n, free, at)
    covariance = inverse(left)
    return np.asarray(follow[:, 1:] @ np.column_stack([covariance @ right, np.linalg.cholesky(covariance)]))


def unsettled(fit: Fit, disturbances: Disturbances) -> np.ndarray:
    """What the causes that nobody can be sure of add to the covariance of the free parameters' scaled changes.

    The estimates are those without any cause. Averaged over "no cause" and each of the K causes alone, their second moment
    grows by the sum of w_k M_k M_k' (see _moves), w_k the cause's probability: odds of 1 / K before the logs, times the Bayes
    factor exp(z^2 t^2 / (2 (1 + t^2))) / sqrt(1 + t^2) of a cause that is sure by z standard deviations and may be by t = 10
    (Hoeting et al. 1999, Bayesian model averaging)."""
    causes, free = causes_of(fit, disturbances), np.ix_(fit.free, fit.free)
    out = np.zeros((len(fit.scale),) * 2)
    log_odds = np.array([0.5 * one.sure**2 * MOST_SURE**2 / (1.0 + MOST_SURE**2) for one in causes])
    log_odds -= 0.5 * np.log(1.0 + MOST_SURE**2) + np.log(max(len(causes), 1))
    for one, probable in zip(causes, np.exp(log_odds - np.logaddexp.reduce([0.0, *log_odds]))):
        out[free] += probable * (one.moves @ one.moves.T)
    return out


def _signals(fit: Fit) -> Iterator[Signals]:
    problem, values = fit.problem, fit.values
    for number, motion in enumerate(problem.motions):
        omega = np.where(motion.stands, 0.0, motion.speed_rad_s)
        sliding = np.abs(problem.given['r2_m'] * omega[:, 1] - values['r1_m'] * omega[:, 0])
        torque = brake_torques(*problem.flawed(number, values))
        yield Signals(torque, omega, motion.smooth_rad, sliding, problem.logs[number])


def explained(fit: Fit, disturbances: Disturbances) -> tuple[Fit, list[Found]]:
    """The fit with those flaws that explain what the disturbances have in common, and the causes that are left,
    surest first: none of them is in the plant."""
    causes = causes_of(fit, disturbances)
    while True:
        left = [one for one in causes if one.sure > SURE]
        if causes and not left and causes[0].beside and causes[0].beside.sure > SURE:
            left = [causes[0], causes[0].beside]  # each alone hides the other
        for one in left:
            flawed = _with_flaw(fit, one, disturbances) if one.flaw and one.sure >= WORTH_A_TRY * left[0].sure else None
            then = [] if flawed is None else causes_of(flawed, disturbances)
            still = max((other.sure for other in then if other.cause is left[0].cause), default=0.0)
            if flawed is not None and (one is left[0] or still < STILL_THERE * left[0].sure):
                fit, causes = flawed, then
                fit.problem.say(f'{one.cause.words}: fitted as {one.flaw} = {fit.values[one.flaw]:.3g}')
                break
        else:
            return fit, left


def _with_flaw(fit: Fit, found: Found, disturbances: Disturbances) -> Fit | None:
    """The fit with one more flaw; None if it is not there after all: not sure by the likelihood, or against what logs that
    are left out say."""
    key, flaw = found.flaw, JOINING[found.flaw]
    flawed = fit.changed({key: min(flaw.none + found.coefficient, 0.9 * flaw.most)}, flaws=(*fit.problem.flaws, key))
    less = disturbances.times(found.share)
    to_rest(flawed, less, 6)
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


def named(causes: Sequence[Found]) -> bool:
    """Whether the surest cause suffices, has no rival, and holds in logs that are left out."""
    surest, *others = causes
    gain = surest.sure**2
    return surest.foretold and gain >= SUFFICES * surest.together and not surest.flaw and all(
        one.sure**2 < RIVAL * gain for one in others if one.words != surest.words)


def sentence(causes: Sequence[Found], fit: Fit) -> str:
    """What does not fit, and where it shows most: of a cause that may be named."""
    surest = causes[0]
    log, phase = _where(surest.cause, fit)
    return (f'the logs do not fit this plant: {surest.words} ({surest.coefficient:.3g} {surest.cause.unit}, {surest.sure:.0f} '
            f'standard deviations from none), most in {log}{f", phase {phase}" if phase else ""}. The plant has no parameter '
            'for it')


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
        if cause.acts == 'brake':
            there *= signals.torque_Nm
            phases = phases[np.maximum.accumulate(np.where(log.brake_pwm > 0.0, np.arange(len(log)), 0))]  # that it is of
        for phase in dict.fromkeys(phases):
            weight[log.name, str(phase)] = float(np.sum((follows * there[:, None])[phases == phase]**2) * log.period_s)
    return max(weight, key=lambda place: weight[place])
