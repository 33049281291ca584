"""The fit: prediction errors of the counts over all logs, by a Kalman filter on windows.

Each window of a log starts from states of its own, which the filter ties together: so a fit neither diverges where the
plant is unstable (past the tyre's peak) nor needs good start values. The plant is linearised around the most likely
states by simulating each window with each parameter moved a little (C++, `_core.linearise`). Slow random factors over
road, brake, motor and both bearings are states of the filter: large in the first rounds, when the model is wrong;
as large as the logs say in the last.
"""
from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.optimize

from ..core import _core
from ..options import options
from .logs import Log, Motion, motion_of, segments_of
from .parameters import DELAY, RATE_LIMIT, WHEELS, Form, Parameter, base_options, disc_of
from .start import brake_torques, first_values

#: an even distribution within one count, counts^2
COUNT_VARIANCE = 1 / 12
WINDOW_S = 0.05
WINDOW_DISTURBED_S = 0.02
#: a residual above this has other sources than the counts' steps, counts RMS
LARGEST_QUIET_RMS = 0.30
DISTURBANCES = ('road', 'brake', 'motor', 'upper bearing', 'lower bearing')


@dataclass
class Disturbances:
    """Standard deviations (factors; the bearings' in N m) and time constants (s) of the five random factors."""
    sd: np.ndarray
    time_constant_s: np.ndarray

    @classmethod
    def of(cls, factor: float, torque_Nm: float, time_constant_s: float) -> Disturbances:
        return cls(np.array([factor, factor, factor, torque_Nm, torque_Nm]), np.full(5, time_constant_s))


#: rounds of the homotopy: disturbances, number of iterations
ROUNDS = ((Disturbances.of(0.10, 0.05, 0.2), 2), (Disturbances.of(0.01, 0.005, 0.5), 2),
          (Disturbances.of(1e-3, 1e-4, 1.0), 1), (Disturbances.of(1e-4, 1e-5, 1.0), 1))
#: an eccentricity below this sways no first value, rad
SMALL_DISC_RAD = 3e-4
#: an iteration that moves less, in standard deviations, is the last
CONVERGED = 0.1
#: largest change of a parameter in one iteration, over its size
LARGEST_STEP = 0.3
#: how far a piece's first state may move in one iteration: angles, speeds, brake torque
NEAR_SD = np.array([0.005, 0.005, 0.5, 0.5, 0.1])
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
    """All logs, and the plant's form with what is fixed. `discs` names the wheels whose encoders may be eccentric."""
    form: Form
    base: Any
    logs: Sequence[Log]
    motions: Sequence[Motion]
    segments: Sequence[Sequence[tuple[int, int]]]
    given: dict[str, float]
    fixed: dict[str, float]
    counts_per_rev: int
    drifts: tuple[str, ...] = ()
    with_delay: bool = False
    with_rate_limit: bool = False
    discs: tuple[str, ...] = ()

    @classmethod
    def of(cls, form: Form, start: Any, logs: Sequence[Log], fixed: Mapping[str, float | None],
           drifts: Sequence[str] = (), discs: Sequence[str] = ()) -> Problem:
        base = base_options(form, start)
        values = _core.PlantOptions(options(plant=start)).values()
        counts_per_rev = int(values['encoder_counts_per_rev'])
        motions = [motion_of(log, counts_per_rev) for log in logs]
        segments = [segments_of(log, motion) for log, motion in zip(logs, motions)]
        known = {key: float(values[key] if value is None else value) for key, value in fixed.items() if key in values}
        given = {key: known.pop(key, float(values[key])) for key in ('J2_kg_m2', 'r2_m')}
        keys = {p.key for p in form.parameters} | {RATE_LIMIT.key}
        return cls(form, base, logs, motions, segments, given, {k: v for k, v in known.items() if k in keys},
                   counts_per_rev, tuple(drifts), discs=tuple(discs))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        delay = (Parameter(DELAY, 's', 'always', '', floor=1e-3),) if self.with_delay else ()
        factors = tuple(Parameter(key, '1', 'brake', '') for key in self.factors) if self.drifts else ()
        limit = (RATE_LIMIT,) if self.with_rate_limit else ()
        discs = tuple(p for log in range(len(self.logs)) for wheel in self.discs for p in disc_of(wheel, log))
        return self.form.parameters + limit + factors + discs + delay

    def columns(self, log: int) -> np.ndarray:
        """Places of the parameters that act in one log."""
        others = {p.key for other in range(len(self.logs)) if other != log for wheel in self.discs
                  for p in disc_of(wheel, other)} | ({*self.factors} - {f'brake_factor_{log + 1}'})
        return np.array([i for i, p in enumerate(self.parameters) if p.key not in others])

    @property
    def factors(self) -> tuple[str, ...]:
        """Names of the brake's factors of each log but the first, over that of the first."""
        return tuple(f'brake_factor_{number}' for number in range(2, len(self.logs) + 1))

    def plant_values(self, values: Mapping[str, float], log: int) -> list[tuple[str, float]]:
        """The plant of one log, as `_core` takes it."""
        factor = values[self.factors[log - 1]] if self.drifts and log > 0 else 1.0
        scaled = [(p.key, values[p.key] * (factor if p.key in ('b1_Nm', 'b2_Nm') else 1.0))
                  for p in self.form.parameters]
        return [*self.given.items(), *scaled, (RATE_LIMIT.key, values.get(RATE_LIMIT.key, 0.0)),
                (DELAY, values.get(DELAY, 0.0))]

    def disc_angles_rad(self, log: int, angles_rad: np.ndarray) -> np.ndarray:
        """Angles of the discs from their counters' zeros, shape (rows, 2)."""
        return angles_rad + (self.logs[log].first_counts % self.counts_per_rev) * self.radians_per_count

    @property
    def radians_per_count(self) -> float:
        return 2 * np.pi / self.counts_per_rev


@dataclass
class Fit:
    """values: of all parameters; first: those that the prior holds to. normal: (logs, n, n), right: (logs, n), cost: (logs,)
    of the last linearisation, in the scaled changes x of `scale`: value = nominal + scale x. `free` marks the estimated
    ones."""
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
    readings: float = 0.0
    rms_counts: float = np.nan
    iterations: int = 0

    @property
    def keys(self) -> list[str]:
        return [p.key for p in self.problem.parameters]

    def information(self) -> np.ndarray:
        return np.asarray(self.normal.sum(axis=0))

    def prior(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the scaled changes: the precision (n,), and its product with the way to the first values (n,)."""
        parameters = self.problem.parameters
        size = np.array([p.prior * max(abs(self.first.get(p.key, self.values[p.key])), p.floor) for p in parameters])
        precision = (self.scale / size)**2
        way = np.array([self.first.get(p.key, self.values[p.key]) - self.values[p.key] for p in parameters])
        return precision, precision * way / self.scale

    def covariance(self) -> np.ndarray:
        """Of the free parameters' scaled changes, shape (free, free); with the prior."""
        N = (self.information() + np.diag(self.prior()[0]))[np.ix_(self.free, self.free)]
        d = 1 / np.sqrt(np.diag(N))
        return np.asarray(np.linalg.inv(N * np.outer(d, d)) * np.outer(d, d))


def pieces_of(problem: Problem, values: Mapping[str, float], window_s: float) -> list[Piece]:
    """Windows over every segment, with states from the counts and the brake's torque from the model."""
    pieces = []
    for number, (log, motion, segments) in enumerate(zip(problem.logs, problem.motions, problem.segments)):
        torque = brake_torques(log, values)
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


def _scale(problem: Problem, values: Mapping[str, float]) -> np.ndarray:
    return np.array([max(abs(values[p.key]), p.floor) for p in problem.parameters])


def linearise(problem: Problem, values: Mapping[str, float], pieces: Sequence[Piece],
              check: Callable[[], None] = lambda: None) -> np.ndarray:
    """Fills `linear` of each piece; returns the scale of the parameters' changes."""
    scale = _scale(problem, values)
    steps = []
    for i, p in enumerate(problem.parameters):
        size = 1e-5 * scale[i]
        if p.key == 'u0':
            size = _duty_step(problem, values['u0'])
        if p.key == DELAY:
            size = 1e-5
        steps.append(size if values[p.key] + size <= p.most else -size)
    for number, log in enumerate(problem.logs):
        inputs = log.inputs()
        there = problem.columns(number)
        simulated = np.array([problem.parameters[i].acts != 'reading' for i in there])
        nominal = problem.plant_values(values, number)
        moved = []
        for i in there[simulated]:
            p = problem.parameters[i]
            other = problem.plant_values({**values, p.key: values[p.key] + steps[i]}, number)
            moved.append((other, steps[i] / scale[i], p.acts))
        for piece in pieces:
            if piece.log != number:
                continue
            check()
            piece.linear = _core.linearise(problem.base, nominal, moved, inputs, piece.first, piece.states)
            piece.columns = there
            if not simulated.all():
                for name in ('by_parameter', 'end_by_parameter'):
                    few = piece.linear[name]
                    piece.linear[name] = np.zeros((*few.shape[:2], len(there)))
                    piece.linear[name][:, :, simulated] = few
                _read_by_discs(problem, scale, piece)
            _measure(problem, values, piece)
    return scale


def _read_by_discs(problem: Problem, scale: np.ndarray, piece: Piece) -> None:
    """Derivatives of the readings by what eccentric discs add. That these change the other derivatives, too, by a
    hundredth at most, is left out: it changes neither where the residuals vanish nor, visibly, an interval."""
    keys = [p.key for p in problem.parameters]
    place = problem.disc_angles_rad(piece.log, piece.linear['angles'])
    for wheel in problem.discs:
        number = WHEELS.index(wheel)
        for p, wave in zip(disc_of(wheel, piece.log), (np.sin(place[:, number]), np.cos(place[:, number]))):
            i = keys.index(p.key)
            column = int(np.flatnonzero(piece.columns == i)[0])
            piece.linear['by_parameter'][:, number, column] = scale[i] * wave


def _measure(problem: Problem, values: Mapping[str, float], piece: Piece) -> None:
    """What the filter needs beside the sensitivities: residuals, weights, gaps between windows."""
    motion, linear = problem.motions[piece.log], piece.linear
    angle = motion.angle_rad[piece.rows]
    read = linear['angles'].copy()
    read += disc_waves_rad(problem, values, piece.log, read)
    residual = np.nan_to_num(angle) - read
    weight = np.where(np.isfinite(angle), motion.weight[piece.rows], 0.0)
    gap = np.zeros_like(piece.states)
    gap[:-1] = linear['end'][:-1] - piece.states[1:]
    linear.update(read=read, residual=residual[:, :, None], weight=weight, gap=gap, stands=piece.stands, first=piece.first,
                  prior_sd=piece.prior_sd, time_s=problem.logs[piece.log].time_s)
    linear.update(_core.condense(linear))


def disc_waves_rad(problem: Problem, values: Mapping[str, float], log: int, angles_rad: np.ndarray) -> np.ndarray:
    """What the discs add to the readings at these angles, shape (rows, 2)."""
    waves = np.zeros(angles_rad.shape)
    place = problem.disc_angles_rad(log, angles_rad)
    for wheel in problem.discs:
        number, (sine, cosine) = WHEELS.index(wheel), disc_of(wheel, log)
        waves[:, number] = values[sine.key] * np.sin(place[:, number]) + values[cosine.key] * np.cos(place[:, number])
    return waves


def _duty_step(problem: Problem, u0: float) -> float:
    """A change of u0 that reaches other duties of the logs: two steps of the brake's PWM at least."""
    duties = np.unique(np.concatenate([log.brake_pwm for log in problem.logs]))
    near = np.sort(np.abs(duties - u0))
    return float(max(5e-4, min(0.02, near[min(4, len(near) - 1)])))


def directions(problem: Problem, scale: np.ndarray) -> np.ndarray:
    """What each disturbance does, as changes of the parameters: shape (5, parameters)."""
    keys = [p.key for p in problem.parameters]
    out = np.zeros((5, len(keys)))
    for row, names in ((0, problem.form.road), (1, ('b1_Nm', 'b2_Nm')), (2, ('motor_stall_torque_Nm',))):
        for name in names:
            i = keys.index(name)
            out[row, i] = 1.0
    for row, name in ((3, 'M10_Nm'), (4, 'M20_Nm')):
        i = keys.index(name)
        out[row, i] = 1.0 / scale[i]
    return out


def _relative(problem: Problem, values: Mapping[str, float], scale: np.ndarray) -> np.ndarray:
    """`directions`, where a factor moves a parameter by its own value (b2 may be smaller than its scale)."""
    out = directions(problem, scale)
    for i, p in enumerate(problem.parameters):
        for row in range(3):
            out[row, i] *= values[p.key] / scale[i]
    return out


def run_filter(fit: Fit, disturbances: Disturbances, variance: float | None = None) -> tuple[float, list[Any]]:
    """-2 log likelihood but for a constant at the best parameters, and what `_core.filter_pieces` gave."""
    problem = fit.problem
    variance = COUNT_VARIANCE * problem.radians_per_count**2 if variance is None else variance
    way = _relative(problem, fit.values, fit.scale)
    found = filtered(problem, fit.pieces, way, disturbances, variance)
    N = sum(one[0] for one in found)
    n = sum(one[1][:, 0] for one in found)
    c = sum(float(one[2][0]) for one in found)
    log_variance = sum(one[3] for one in found)
    x = solved(fit, N, n)
    return c - float(n @ x) + log_variance, found


def filtered(problem: Problem, pieces: Sequence[Piece], way: np.ndarray, disturbances: Disturbances,
             variance: float) -> list[Any]:
    """What `_core.filter_pieces` gives of each piece, with a row and a column for every parameter."""
    out = []
    size = len(problem.parameters)
    for piece in pieces:
        at = piece.columns
        N, n, square, log_variance, readings = _core.filter_pieces(
            [piece.linear], np.ascontiguousarray(way[:, at]), disturbances.sd, disturbances.time_constant_s, variance)[0]
        whole, right = np.zeros((size, size)), np.zeros((size, n.shape[1]))
        whole[np.ix_(at, at)], right[at] = N, n
        out.append((whole, right, square, log_variance, readings))
    return out


def solved(fit: Fit, N: np.ndarray, n: np.ndarray, low: np.ndarray | None = None,
           high: np.ndarray | None = None) -> np.ndarray:
    """The likeliest change of the parameters, 0 for those that are not free. The prior decides what the logs do not. A
    parameter that would leave its range stops at the range's end, and the others follow: they may depend on it."""
    x = np.zeros(len(n))
    precision, towards = fit.prior()
    A, n = N + np.diag(precision), n + towards
    d = 1 / np.sqrt(np.diag(A))
    A, n = A * np.outer(d, d), d * n
    moving = fit.free.copy()
    for _ in range(len(n)):
        stopped = fit.free & ~moving
        rest = n - A[:, stopped] @ (x[stopped] / d[stopped])
        x[moving] = d[moving] * np.linalg.solve(A[np.ix_(moving, moving)], rest[moving])
        if low is None or high is None:
            break
        beyond = moving & ((x < low) | (x > high))
        if not beyond.any():
            break
        x[beyond] = np.clip(x, low, high)[beyond]
        moving &= ~beyond
    return x


def step(fit: Fit, disturbances: Disturbances, check: Callable[[], None] = lambda: None) -> float:
    """One iteration: linearise, estimate, move parameters and states. Returns how far they moved, in standard deviations:
    of the direction that the logs know best, not of each parameter alone."""
    problem = fit.problem
    fit.disturbances = disturbances
    fit.scale = linearise(problem, fit.values, fit.pieces, check)
    _, found = run_filter(fit, disturbances)
    N, n = _keep_normals(fit, found)
    values = np.array([fit.values[p.key] for p in problem.parameters])
    # Sizes that cannot vanish move by factors: where the logs know only a product, its factors move along straight lines.
    sizes = np.array([not p.floor and p.key != DELAY for p in problem.parameters])
    least = np.array([p.least for p in problem.parameters])
    most = np.array([p.most for p in problem.parameters])
    with np.errstate(divide='ignore', invalid='ignore'):
        low = np.where(sizes, np.log(np.maximum(least, 1e-12) / values), (least - values) / fit.scale)
        high = np.where(sizes, np.log(most / values), (most - values) / fit.scale)
    x = solved(fit, N, n, np.maximum(low, -LARGEST_STEP), np.minimum(high, LARGEST_STEP))
    _move_states(fit, disturbances, x)
    with np.errstate(over='ignore'):
        moved = np.where(sizes, values * np.exp(x), values + fit.scale * x)
    fit.values = {**fit.values, **{p.key: float(v) for p, v in zip(problem.parameters, moved)}}
    fit.iterations += 1
    return float(np.sqrt(x @ (N + np.diag(fit.prior()[0])) @ x))


def _keep_normals(fit: Fit, found: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    logs, n = len(fit.problem.logs), len(fit.scale)
    fit.normal, fit.right, fit.cost = np.zeros((logs, n, n)), np.zeros((logs, n)), np.zeros(logs)
    fit.readings = 0.0
    for piece, (N, right, square, log_variance, readings) in zip(fit.pieces, found):
        fit.normal[piece.log] += N
        fit.right[piece.log] += right[:, 0]
        fit.cost[piece.log] += square[0] + log_variance
        fit.readings += readings
    return fit.normal.sum(axis=0), fit.right.sum(axis=0)


def _move_states(fit: Fit, disturbances: Disturbances, x: np.ndarray) -> None:
    problem = fit.problem
    way = _relative(problem, fit.values, fit.scale)
    variance = COUNT_VARIANCE * problem.radians_per_count**2
    square = weights = 0.0
    for piece in fit.pieces:
        linear = dict(piece.linear)
        # The states are near already. A wide prior would only lose digits in the backward pass.
        linear['prior_sd'] = np.minimum(piece.prior_sd, NEAR_SD)
        change, left = _core.smooth(linear, x[piece.columns], np.ascontiguousarray(way[:, piece.columns]), disturbances.sd,
                                    disturbances.time_constant_s, variance)
        square += left
        weights += float(linear['readings'][:, 1].sum())
        speeds = change[:, 2:4]
        piece.states = piece.states + np.column_stack([change[:, :2], np.clip(speeds, -30, 30), change[:, 4:5]])
        piece.states[:, 2:4] = np.where(piece.stands != 0, 0.0, np.maximum(piece.states[:, 2:4], 0.0))
        piece.states[:, 4] = np.maximum(piece.states[:, 4], 0.0)
    fit.rms_counts = float(np.sqrt(square / max(weights, 1e-9))) / problem.radians_per_count


def other_costs(fit: Fit, disturbances: Disturbances, affected: Sequence[bool],
                ) -> Callable[[Mapping[str, float]], tuple[np.ndarray, np.ndarray, float]]:
    """A function of other values of the parameters: normal equations, and -2 log likelihood without their change. It
    simulates the affected pieces anew and keeps the sensitivities."""
    problem = fit.problem
    settings = (_relative(problem, fit.values, fit.scale), disturbances, COUNT_VARIANCE * problem.radians_per_count**2)
    rest = filtered(problem, [piece for piece, hit in zip(fit.pieces, affected) if not hit], *settings)
    inputs = [log.inputs() for log in problem.logs]

    def costs(values: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, float]:
        changed = []
        for piece, hit in zip(fit.pieces, affected):
            if hit:
                other = _core.linearise(problem.base, problem.plant_values(values, piece.log), [], inputs[piece.log],
                                        piece.first, piece.states)
                moved = dataclasses.replace(piece, linear=dict(piece.linear))
                moved.linear.update(angles=other['angles'], end=other['end'])
                _measure(problem, values, moved)
                changed.append(moved)
        found = [*rest, *filtered(problem, changed, *settings)]
        return (np.asarray(sum(one[0] for one in found)), np.asarray(sum(one[1][:, 0] for one in found)),
                sum(float(one[2][0]) + one[3] for one in found))
    return costs


def search_u0(fit: Fit, disturbances: Disturbances, width: float, most: int,
              check: Callable[[], None] = lambda: None) -> list[tuple[float, float, float]]:
    """Moves u0 to the most likely gap between the duties of the logs, within `width` of its value. A log tells of u0 only
    in which of these gaps it lies: the cost is flat within one. Needs the linearisation of `step`; that stays valid.

    Returns (begin of the gap, end of the gap, cost) of those tried, in order.
    """
    problem = fit.problem
    if 'u0' in problem.fixed:
        return []
    present = fit.values['u0']
    duties = np.unique(np.concatenate([log.brake_pwm for log in problem.logs]))
    first = max(int(np.searchsorted(duties, present - width, 'right')) - 1, 0)
    edges = duties[first:int(np.searchsorted(duties, present + width)) + 1]
    gaps = list(zip(edges[:-1], edges[1:]))
    if not gaps:
        return []
    if len(gaps) > most:  # evenly chosen ones; a later call looks closer
        gaps = [gaps[i] for i in sorted({round(i) for i in np.linspace(0, len(gaps) - 1, most)})]
    affected = [_has_duties(problem, piece, edges[0], edges[-1]) for piece in fit.pieces]
    # The sensitivities are those of the present u0: other parameters may follow only as far as they are uncertain.
    within = np.zeros(len(fit.scale))
    within[fit.free] = 5.0 * np.sqrt(np.diag(fit.covariance()))
    others = other_costs(fit, disturbances, affected)
    tried = []
    for begin, end in gaps:
        check()
        # A duty that equals u0 acts (7): so u0 lies above the gap's begin, up to its end.
        N, n, cost = others({**fit.values, 'u0': max(0.5 * (begin + end), end - 1e-3)})
        x = solved(fit, N, n, -within, within)
        tried.append((float(begin), float(end), cost - float(2 * n @ x - x @ N @ x)))
    best = min(tried, key=lambda gap: gap[2])
    fit.values['u0'] = max(0.5 * (best[0] + best[1]), best[1] - 1e-3)
    return tried


def likely_u0(fit: Fit, disturbances: Disturbances,
              check: Callable[[], None] = lambda: None) -> list[tuple[float, float, float]]:
    """The gaps around u0 with their costs, over a range so wide that both its ends are unlikely, if there is one."""
    gaps: list[tuple[float, float, float]] = []
    duties = np.unique(np.concatenate([log.brake_pwm for log in fit.problem.logs]))
    for width in (8e-4, 3e-3, 1.2e-2, 4e-2):
        gaps = search_u0(fit, disturbances, width, 12, check)
        if not gaps:
            break
        least = min(gap[2] for gap in gaps) + 10.0
        lower = gaps[0][2] > least or gaps[0][0] <= duties[0]
        upper = gaps[-1][2] > least or gaps[-1][1] >= duties[-1]
        if lower and upper:
            break
    return gaps


def _has_duties(problem: Problem, piece: Piece, least: float, most: float) -> bool:
    duty = problem.logs[piece.log].brake_pwm[max(piece.rows.start - 1, 0):piece.rows.stop]
    return bool(np.any((duty >= least) & (duty <= most)))


def start_fit(problem: Problem, start: Mapping[str, float], check: Callable[[], None] = lambda: None,
              other_form: Fit | None = None) -> Fit:
    """First values and a few rounds with large disturbances: near the truth, whatever the start. What `other_form` found of
    the same logs is not sought again."""
    if other_form is not None:
        problem = dataclasses.replace(problem, motions=other_form.problem.motions,
                                      with_rate_limit=other_form.problem.with_rate_limit)
        discs = {p.key: other_form.first[p.key] for p in problem.parameters if p.acts == 'reading'}
        return _started(problem, start, check, discs, other_form.first)
    fit = _started(problem, start, check)
    discs = {p.key: fit.values[p.key] for p in problem.parameters if p.acts == 'reading'}
    if all(abs(value) < SMALL_DISC_RAD for value in discs.values()):
        return fit
    # Speeds that an eccentric disc does not sway give better first values.
    motions = []
    for number, (log, motion) in enumerate(zip(problem.logs, problem.motions)):
        read = log.counts * problem.radians_per_count
        turned = motion_of(dataclasses.replace(log, counts=log.counts - disc_waves_rad(problem, discs, number, read)
                                               / problem.radians_per_count), problem.counts_per_rev)
        motions.append(dataclasses.replace(motion, smooth_rad=turned.smooth_rad, speed_rad_s=turned.speed_rad_s))
    return _started(dataclasses.replace(problem, motions=motions), start, check, discs)


def _started(problem: Problem, start: Mapping[str, float], check: Callable[[], None],
             discs: Mapping[str, float] | None = None, other_form: Mapping[str, float] | None = None) -> Fit:
    values = first_values(problem.form, problem.base, problem.given, start, problem.logs, problem.motions,
                          problem.segments, problem.fixed, other_form)
    values.setdefault(DELAY, 0.0)
    values.setdefault(RATE_LIMIT.key, problem.fixed.get(RATE_LIMIT.key, 0.0))
    values.update({key: 1.0 for key in problem.factors})
    values.update({p.key: 0.0 for p in problem.parameters if p.acts == 'reading'} | dict(discs or {}))
    free = np.array([p.key not in problem.fixed and p.key != 'u0' for p in problem.parameters])
    fit = Fit(problem, values, pieces_of(problem, values, WINDOW_S), ROUNDS[0][0], WINDOW_S, free, dict(values))
    disturbances, count = ROUNDS[0]
    for _ in range(count):
        step(fit, disturbances, check)
    return fit


def finish_fit(fit: Fit, check: Callable[[], None] = lambda: None, most: int = 12) -> Fit:
    """The rest of the rounds, then without disturbances until nothing moves."""
    for number, (disturbances, count) in enumerate(ROUNDS[1:]):
        for _ in range(count):
            step(fit, disturbances, check)
        search_u0(fit, disturbances, 0.004 / 4**number, 9, check)
    _to_rest(fit, check, most)
    for _ in range(2):
        if not fit.rms_counts > LARGEST_QUIET_RMS:
            break
        # u0 may have stopped one step of the duties beside.
        moved = dataclasses.replace(fit, pieces=[dataclasses.replace(piece) for piece in fit.pieces])
        step(moved, ROUNDS[-1][0], check)
        search_u0(moved, ROUNDS[-1][0], 0.001, 9, check)
        if moved.values['u0'] == fit.values['u0']:
            break
        _to_rest(moved, check, most)
        if not moved.rms_counts < fit.rms_counts:
            break
        fit = moved
    return fit


def _to_rest(fit: Fit, check: Callable[[], None], most: int) -> None:
    """Steps without disturbances until nothing moves."""
    before = np.inf
    for _ in range(most):
        moved = step(fit, QUIET, check)
        # The residual settles last: past the peak the states need some rounds more than the parameters.
        if moved < CONVERGED or (moved < 1.0 and fit.rms_counts > 0.999 * before > LARGEST_QUIET_RMS):
            break
        before = fit.rms_counts


def disturbed_fit(fit: Fit, check: Callable[[], None] = lambda: None, say: Callable[[str], None] = lambda _: None) -> Fit:
    """A fit for a rig whose factors wander: estimates how much, by maximum likelihood, along with the parameters."""
    problem = fit.problem
    fit = dataclasses.replace(fit, pieces=pieces_of(problem, fit.values, WINDOW_DISTURBED_S), window_s=WINDOW_DISTURBED_S)
    present = Disturbances.of(0.02, 0.01, 0.2)
    for round_number in range(4):
        for _ in range(2 if round_number == 0 else 1):
            moved = step(fit, present, check)
        search_u0(fit, present, 0.003 / 2**round_number, 7, check)
        if round_number < 3:
            present = likeliest_disturbances(fit, present, 60 if round_number == 0 else 30)
            say(f'disturbances: {describe(present)}')
    for _ in range(3):
        if moved < CONVERGED:
            break
        moved = step(fit, present, check)
    return fit


def describe(disturbances: Disturbances) -> str:
    factors = ', '.join(f'{name} {100 * sd:.2g} %' for name, sd in zip(DISTURBANCES[:3], disturbances.sd))
    bearings = ', '.join(f'{name} {1e3 * sd:.2g} mN m' for name, sd in zip(DISTURBANCES[3:], disturbances.sd[3:]))
    return f'{factors}, {bearings}; over {disturbances.time_constant_s[0]:.2g} s'


def likeliest_disturbances(fit: Fit, guess: Disturbances, evaluations: int) -> Disturbances:
    """Maximises the likelihood over the five standard deviations and one time constant, at this linearisation."""
    x0 = np.log(np.append(guess.sd, guess.time_constant_s[0]))
    # A weak pull keeps a factor that no log excites from running away.
    centre = np.log(np.array([0.01, 0.01, 0.01, 0.003, 0.003, 0.2]))

    def cost(x: np.ndarray) -> float:
        value, _ = run_filter(fit, Disturbances(np.exp(x[:5]), np.full(5, np.exp(x[5]))))
        return value + float(np.sum(((x - centre) / 3.0)**2))
    bounds = [*zip(np.log([1e-5] * 3 + [1e-6] * 2 + [0.02]), np.log([0.5] * 3 + [0.3] * 2 + [5.0]))]
    best = scipy.optimize.minimize(cost, np.clip(x0, *np.transpose(bounds)), method='L-BFGS-B', bounds=bounds,
                                   options={'maxfun': evaluations, 'eps': 0.02, 'ftol': 1e-6})
    return Disturbances(np.exp(best.x[:5]), np.full(5, np.exp(best.x[5])))
