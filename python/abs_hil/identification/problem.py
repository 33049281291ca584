"""What a fit works on: the logs in windows, the plant's form, the present values and their normal equations.

A reading n of an encoder with N counts a turn says the angle (n + 1/2) 2 pi / N, rad, with an even error of variance
q = (2 pi / N)^2 / 12. The plant is (1), (2), (6), (7) of docs/theory.md, with factors 1 + f over friction, brake and motor and
torques f (N m) added to both bearings, each f a Gauss-Markov process of first order. Parameters move as p = nominal + scale dp;
the first values p1 are as good as a reading of each, with the precision (scale / (prior p1))^2 of dp.
"""
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np

from ..core import _core
from ..options import options
from .brake_flaws import brake_torques, with_flaws
from .encoders import Slots, jitter_of, slots_of, weighed
from .logs import Log, Motion, motion_of, segments_of
from .parameters import DELAY, FRICTION_FALL, JOINING, RATE_LIMIT, RELEASE, WHEELS, Form, Parameter, base_options, disc_of

#: an even distribution within one count, counts^2
COUNT_VARIANCE = 1 / 12
WINDOW_S = 0.05
WINDOW_DISTURBED_S = 0.02
#: of an even distribution and a normal one: standard deviation of the square, over its mean
SQUARE_EVEN, SQUARE_NORMAL = 0.894, 1.414
#: a residual so many standard deviations above what the counts' steps leave has other sources
SURELY_MORE = 4.0
DISTURBANCES = ('road', 'brake', 'motor', 'upper bearing', 'lower bearing')
#: of factors and, in N m, bearings: less is no reason to refuse a rig
LEAST_SD = np.array([1e-3, 1e-3, 1e-3, 5e-4, 5e-4])


@dataclass
class Disturbances:
    """Standard deviations (factors; the bearings' in N m) and time constants (s) of the five random factors."""
    sd: np.ndarray
    time_constant_s: np.ndarray

    @classmethod
    def of(cls, factor: float, torque_Nm: float, time_constant_s: float) -> Self:
        return cls(np.array([factor, factor, factor, torque_Nm, torque_Nm]), np.full(5, time_constant_s))

    def times(self, share: float) -> 'Disturbances':
        """A share of them, but not so little that what no rig needs to say would count."""
        return self if share == 1.0 else dataclasses.replace(self, sd=share * self.sd).at_least()

    def at_least(self) -> 'Disturbances':
        """These, or LEAST_SD."""
        return dataclasses.replace(self, sd=np.maximum(self.sd, LEAST_SD))

    def __str__(self) -> str:
        factors = ', '.join(f'{name} {100 * sd:.2g} %' for name, sd in zip(DISTURBANCES[:3], self.sd))
        bearings = ', '.join(f'{name} {1e3 * sd:.2g} mN m' for name, sd in zip(DISTURBANCES[3:], self.sd[3:]))
        return f'{factors}, {bearings}; over {self.time_constant_s[0]:.2g} s'


QUIET = Disturbances.of(0.0, 0.0, 1.0)


@dataclass
class Piece:
    """A segment of a log, its windows, and the states at their starts (windows, 5)."""
    log: int
    first: np.ndarray
    states: np.ndarray
    stands: np.ndarray
    prior_sd: np.ndarray
    linear: dict[str, Any] = field(default_factory=dict)
    columns: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))

    @property
    def rows(self) -> slice:
        return slice(int(self.first[0]), int(self.first[-1]))


@dataclass
class Problem:
    """All logs, and the plant's form with what is fixed. `discs` names the wheels whose encoders may be eccentric, `flaws` the
    keys of JOINING that are fitted; `slots` has the wheels whose discs have unequal ones; `jitter_s` is the
    standard deviation of the readings' instants, `jitter_doubt` that of its square, over its square (encoders.py);
    `pwm_steps` those of the board, if the logs' own duties were finer; `causes` are columns that structure.py fills; `say` takes
    what is done in words, `check` is called often, and may raise to stop."""
    form: Form
    base: Any
    logs: Sequence[Log]
    motions: Sequence[Motion]
    segments: Sequence[Sequence[tuple[int, int]]]
    given: dict[str, float]
    fixed: dict[str, float]
    counts_per_rev: int
    drifts: tuple[str, ...] = ()
    discs: tuple[str, ...] = ()
    flaws: tuple[str, ...] = ()
    slots: Mapping[str, Slots] = field(default_factory=dict)
    jitter_s: float = 0.0
    jitter_doubt: float = 0.0
    pwm_steps: int = 0
    causes: tuple[Parameter, ...] = ()
    say: Callable[[str], None] = lambda _: None
    check: Callable[[], None] = lambda: None

    @classmethod
    def of(cls, form: Form, start: Any, logs: Sequence[Log], fixed: Mapping[str, float | None],
           drifts: Sequence[str] = (), discs: Sequence[str] = ()) -> Self:
        base = base_options(form, start)
        values = _core.PlantOptions(options(plant=start)).values()
        counts_per_rev = int(values['encoder_counts_per_rev'])
        motions = [motion_of(log, counts_per_rev) for log in logs]
        segments = [segments_of(log, motion) for log, motion in zip(logs, motions)]
        slots = slots_of(logs, motions, counts_per_rev)
        known = {key: float(values[key] if value is None else value) for key, value in fixed.items() if key in values}
        given = {key: known.pop(key, float(values[key])) for key in ('J2_kg_m2', 'r2_m')}
        own = {key: known[key] for key in (*(p.key for p in form.parameters), RATE_LIMIT.key) if key in known}
        jitter_s, doubt = jitter_of(logs, motions, counts_per_rev)
        return cls(form, base, logs, [*weighed(logs, motions, slots)], segments, given, own, counts_per_rev, tuple(drifts),
                   discs=tuple(discs), slots=slots, jitter_s=jitter_s, jitter_doubt=doubt)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        factors = tuple(Parameter(key, '1', 'brake', '') for key in self.factors) if self.drifts else ()
        discs = tuple(p for log in range(len(self.logs)) for wheel in self.discs for p in disc_of(wheel, log))
        return (*self.form.parameters, *factors, *discs, *(one for key, one in JOINING.items() if key in self.flaws), *self.causes)

    @property
    def keys(self) -> list[str]:
        return [p.key for p in self.parameters]

    @cached_property
    def duties(self) -> np.ndarray:
        """Those of the brake that occur in the logs, in order."""
        return np.unique(np.concatenate([log.brake_pwm for log in self.logs]))

    def columns(self, log: int) -> np.ndarray:
        """Places of the parameters that act in one log."""
        others = {p.key for other in range(len(self.logs)) if other != log for wheel in self.discs
                  for p in disc_of(wheel, other)} | ({*self.factors} - {f'brake_factor_{log + 1}'})
        others |= {p.key for p in self.causes if '_of_log_' in p.key and not p.key.endswith(f'_of_log_{log}')}
        return np.array([i for i, p in enumerate(self.parameters) if p.key not in others])

    @property
    def factors(self) -> tuple[str, ...]:
        """Names of the brake's factors of each log but the first, over that of the first."""
        return tuple(f'brake_factor_{number}' for number in range(2, len(self.logs) + 1))

    def plant_values(self, values: Mapping[str, float], log: int,
                     asks: tuple[Log, Mapping[str, float]]) -> list[tuple[str, float]]:
        """The plant of one log, as `_core` takes it, under the duties of `flawed`."""
        factor = values[self.factors[log - 1]] if self.drifts and log > 0 else 1.0
        scaled = [(p.key, values[p.key] * (factor if p.key in ('b1_Nm', 'b2_Nm') else 1.0))
                  for p in self.form.parameters if p.key != 'u0']
        late_s = values.get(DELAY, 0.0) if asks[0].brake_before is None else asks[0].late_s
        return [*self.given.items(), *scaled, ('u0', asks[1]['u0']), (DELAY, late_s),
                *((flaw.key, values.get(flaw.key, flaw.none)) for flaw in (RATE_LIMIT, RELEASE, FRICTION_FALL))]

    def simulated(self, log: int, values: Mapping[str, float]) -> tuple[list[tuple[str, float]], dict[str, np.ndarray]]:
        """The plant of one log and what acts on it."""
        asks = self.flawed(log, values)
        return self.plant_values(values, log, asks), asks[0].inputs()

    def flawed(self, log: int, values: Mapping[str, float]) -> tuple[Log, Mapping[str, float]]:
        """A log with the duties that a brake without flaws would need, and the values of that (brake_flaws.py)."""
        return with_flaws(self.logs[log], self.motions[log], values, values.get(DELAY, 0.0))

    def disc_angles_rad(self, log: int, angles_rad: np.ndarray) -> np.ndarray:
        """Angles of the discs from their counters' zeros, shape (rows, 2)."""
        return angles_rad + (self.logs[log].first_counts % self.counts_per_rev) * self.radians_per_count

    @property
    def radians_per_count(self) -> float:
        return 2 * np.pi / self.counts_per_rev

    def common_sd(self, piece: Piece) -> np.ndarray:
        """Standard deviation of the error by jitter, which both readings of a row share, over that of the counts' steps; shape
        (rows, 2)."""
        return np.asarray(self.jitter_s / np.sqrt(self.variance_rad2) * self.motions[piece.log].speed_rad_s[piece.rows])

    @property
    def variance_rad2(self) -> float:
        """Of a reading, by the counts' steps."""
        return COUNT_VARIANCE * self.radians_per_count**2


@dataclass
class Move:
    """The last step of a fit: values, states and -2 log likelihood before, and how often it was halved."""
    before: dict[str, float]
    states: list[np.ndarray]
    cost: float
    shorter: int = 0


@dataclass
class Fit:
    """values: of all parameters; first: those that the prior holds to. normal: (logs, n, n), right: (logs, n), cost: (logs,)
    of the last linearisation, in the scaled changes x of `scale`: value = nominal + scale x. `free` marks the estimated ones.
    last_step: how far it went, in standard deviations of the direction that the logs know best; halvings: of the one before it,
    because it made things worse; least_rms: see may_follow."""
    problem: Problem
    values: dict[str, float]
    pieces: list[Piece]
    disturbances: Disturbances
    window_s: float
    free: np.ndarray
    first: dict[str, float] = field(default_factory=dict)
    scale: np.ndarray = field(default_factory=lambda: np.empty(0))
    normal: np.ndarray = field(default_factory=lambda: np.empty(0))
    right: np.ndarray = field(default_factory=lambda: np.empty(0))
    cost: np.ndarray = field(default_factory=lambda: np.empty(0))
    rms_counts: float = np.nan
    least_rms: float = np.inf
    moved: Move | None = None
    last_step: float = np.inf
    halvings: int = 0

    def copy(self, **changes: Any) -> Self:
        """A fit that can go on without this one."""
        pieces = [dataclasses.replace(piece) for piece in self.pieces]
        return dataclasses.replace(self, **{'pieces': pieces, 'moved': None, **changes})

    def changed(self, values: Mapping[str, float], **problem: Any) -> Self:
        """A copy for a problem that is changed: with `values` of its new parameters, which are free, and without old ones."""
        changed, before = dataclasses.replace(self.problem, **problem), dict(zip(self.keys, self.free))
        free = np.array([before.get(key, True) for key in changed.keys])
        return self.copy(problem=changed, values={**self.values, **values}, free=free)

    def without(self, keys: Sequence[str]) -> Self:
        """A copy that fits none of these keys of JOINING."""
        fewer = self.changed({}, flaws=tuple(key for key in self.problem.flaws if key not in keys))
        fewer.values = {key: value for key, value in fewer.values.items() if key in fewer.keys or key not in keys}
        return fewer

    @property
    def keys(self) -> list[str]:
        return self.problem.keys

    @property
    def bound_rms(self) -> float:
        """The largest residual that the counts' steps leave, with jitter and unequal slots as the logs show them, counts RMS:
        E (1 + 4 sd) / 12 is its square, of n readings (by weight) sd = 0.894 / sqrt(n)."""
        problem, weights = self.problem, sum(piece.linear['weight'].sum(axis=0) for piece in self.pieces)
        n = max(float(np.sum(weights)), 1.0)
        expected, sd = 1.0, (SQUARE_NORMAL if problem.jitter_s else SQUARE_EVEN) / np.sqrt(n)
        for share, wheel in zip(weights / n, WHEELS):
            if slots := problem.slots.get(wheel):  # encoders.py: weights and variances
                expected -= share * slots.error_counts**2
                sd = np.hypot(sd, 2.0 * share * slots.sd_counts)
        sd = np.hypot(sd, 0.5 * problem.jitter_doubt)  # of each two readings, one says what the jitter is
        return float(np.sqrt(COUNT_VARIANCE * expected * (1.0 + SURELY_MORE * sd)))

    @property
    def follows(self) -> bool:
        """Whether nothing but the counts' steps is left between the logs and the plant."""
        return not self.disturbances.sd.any() and self.rms_counts <= self.bound_rms

    @property
    def may_follow(self) -> bool:
        """Whether it may follow the logs once nothing disturbs it. The filter's squared innovations are the least sum of squared
        residuals and squared factors over their variances; so they only grow as the disturbances fall. `least_rms` is that sum
        of the last step, as counts RMS: where it is above the bound, no smaller disturbance leads below."""
        return self.least_rms <= self.bound_rms

    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the scaled changes: the precision (n,), and its product with the way to the first values (n,)."""
        parameters = self.problem.parameters
        size = np.array([p.prior * max(abs(self.first.get(p.key, self.values[p.key])), p.floor) for p in parameters])
        precision = (self.scale / size)**2
        way = np.array([self.first.get(p.key, self.values[p.key]) - self.values[p.key] for p in parameters])
        return precision, precision * way / self.scale

    def covariance(self) -> np.ndarray:
        """Of the parameters' scaled changes, (n, n), with the prior; zeros for those that are not free."""
        free = np.ix_(self.free, self.free)
        out = np.zeros((len(self.free), len(self.free)))
        out[free] = inverse((self.normal.sum(axis=0) + np.diag(self.prior()[0]))[free])
        return out


def residuals(fit: Fit) -> list[tuple[float, str, str]]:
    """What the fit leaves, counts RMS, of each phase of each log: (residual, log, phase), the largest sum of squares first."""
    sums: dict[tuple[str, str], np.ndarray] = {}
    for piece in fit.pieces:
        log, left = fit.problem.logs[piece.log], piece.linear['residual'][:, :, 0] / fit.problem.radians_per_count
        for phase in dict.fromkeys(log.phase[piece.rows]):
            rows, place = log.phase[piece.rows] == phase, (log.name, str(phase))
            weight = piece.linear['weight'][rows]
            sums[place] = sums.get(place, np.zeros(2)) + [np.sum(weight * left[rows]**2), np.sum(weight)]
    every = sorted(sums.items(), key=lambda item: -item[1][0])
    return [(float(np.sqrt(square / weight)), *place) for place, (square, weight) in every if weight > 0.0]


def inverse(N: np.ndarray) -> np.ndarray:
    """Of a positive definite matrix whose rows may differ by many powers of ten."""
    d = 1 / np.sqrt(np.diag(N))
    return np.asarray(np.linalg.inv(N * np.outer(d, d)) * np.outer(d, d))


def pieces_of(problem: Problem, values: Mapping[str, float], window_s: float) -> list[Piece]:
    """Windows over every segment, with states from the counts and the brake's torque from the model."""
    pieces = []
    for number, (log, motion, segments) in enumerate(zip(problem.logs, problem.motions, problem.segments)):
        torque = brake_torques(*problem.flawed(number, values))
        step = max(4, round(window_s / log.period_s))
        for begin, end in segments:
            count = max(1, (end - begin - 1) // step)
            first = np.append(begin + step * np.arange(count), end - 1)
            at = first[:-1]
            stands = motion.stands[at]
            states = np.column_stack([motion.smooth_rad[at], np.where(stands, 0.0, motion.speed_rad_s[at]), torque[at]])
            prior = np.array([0.05, 0.05, 20.0, 20.0, 0.0])
            pieces.append(Piece(number, first.astype(np.int64), states, stands.astype(float), prior))
    return pieces
