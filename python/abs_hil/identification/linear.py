"""The linearised plant over the logs, and one step of the fit: sensitivities, the filter's normal equations, new states.

The filter (python/src/identification_filter.cpp) gives for the scaled changes dp of the parameters, summed over all logs

    -2 log L(dp) = s - 2 n'dp + dp'N dp + log |S|            but for a constant

One step (Gauss and Newton) takes (N + P) dp = n + P d, with the precision P of the first values and the way d to them, within
bounds; then the states that are most likely at this dp. It has gone sqrt(dp'(N + P) dp) standard deviations. A step after which
-2 log L is larger is halved. Logs l that are left out are foretold by all others: with dp from N - N_l and n - n_l,

    -2 log L_l = s_l - 2 n_l'dp + dp'N_l dp
"""
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..core import _core
from .brake_flaws import act
from .parameters import DEAD_TIME, DELAY, WHEELS, disc_of
from .problem import COUNT_VARIANCE, Disturbances, Fit, Move, Piece, Problem

#: an iteration that moves less, in standard deviations, is the last
CONVERGED = 0.1
#: largest change of a parameter in one iteration, over its size
LARGEST_STEP = 0.3
#: a step after which -2 log likelihood is larger by more than this is halved, at most so often. It is that of a linearised
#: plant, and not exact to less
LARGEST_RISE = 10.0
MOST_HALVINGS = 6
#: how far a piece's first state may move in one iteration: angles, speeds, brake torque
NEAR_SD = np.array([0.005, 0.005, 0.5, 0.5, 0.1])


def linearise(problem: Problem, values: Mapping[str, float], pieces: Sequence[Piece],
              fill: Callable[[Piece, np.ndarray], None] | None = None) -> np.ndarray:
    """Fills `linear` of each piece; returns the scale of the parameters' changes. `fill` adds to a piece's columns, before only
    the filter's sums of them are kept."""
    scale = np.array([max(abs(values[p.key]), p.floor) for p in problem.parameters])
    near = np.sort(np.abs(problem.duties - values['u0']))
    # A change of u0 reaches other duties of the logs: two steps of the brake's PWM at least.
    own = {'u0': float(np.clip(near[min(4, len(near) - 1)], 5e-4, 0.02)), DELAY: 1e-5, DEAD_TIME.key: 1e-6}
    steps = [own.get(p.key, 1e-5 * one) for p, one in zip(problem.parameters, scale)]
    steps = [size if values[p.key] + size <= p.most else -size for p, size in zip(problem.parameters, steps)]
    for number in range(len(problem.logs)):
        asks, acts = problem.flawed(number, values), act(values)
        there = problem.columns(number)
        simulated = np.array([problem.parameters[i].acts not in ('reading', 'cause') for i in there])
        moved = []
        for i in there[simulated]:
            p = problem.parameters[i]
            changed = {**values, p.key: values[p.key] + steps[i]}
            brakes = p.acts == 'flaw' or p.key in ('b1_Nm', 'b2_Nm', DELAY)  # what flaws make of the duties depends on these
            asked = problem.flawed(number, changed) if brakes or not acts else asks
            moved.append((problem.plant_values(changed, number, asked), steps[i] / scale[i],
                          'brake' if p.acts == 'flaw' else p.acts, *((asked[0].inputs(),) if brakes and act(changed) else ())))
        nominal, inputs = problem.plant_values(values, number, asks), asks[0].inputs()
        for piece in [piece for piece in pieces if piece.log == number]:
            problem.check()
            piece.linear = _core.linearise(problem.base, nominal, moved, inputs, piece.first, piece.states)
            piece.columns = there
            if not simulated.all():
                for name in ('by_parameter', 'end_by_parameter'):
                    few = piece.linear[name]
                    piece.linear[name] = np.zeros((*few.shape[:2], len(there)))
                    piece.linear[name][:, :, simulated] = few
                _read_by_discs(problem, scale, piece)
            if fill is not None:
                fill(piece, scale)
            measure(problem, values, piece, [piece.linear['angles']], [piece.linear['end']])
            if fill is not None:
                del piece.linear['by_parameter'], piece.linear['by_state']
    return scale


def by_windows(piece: Piece, per_row: np.ndarray) -> np.ndarray:
    """The mean of a log's rows in each window, shape (windows,)."""
    first = piece.first - piece.first[0]
    return np.asarray(np.add.reduceat(per_row[piece.rows], first[:-1]) / np.diff(first))


def _read_by_discs(problem: Problem, scale: np.ndarray, piece: Piece) -> None:
    """Derivatives of the readings by what eccentric discs add. That these change the other derivatives, too, by a
    hundredth at most, is left out: it changes neither where the residuals vanish nor, visibly, an interval."""
    place = problem.disc_angles_rad(piece.log, piece.linear['angles'])
    for wheel in problem.discs:
        number = WHEELS.index(wheel)
        for p, wave in zip(disc_of(wheel, piece.log), (np.sin(place[:, number]), np.cos(place[:, number]))):
            i = problem.keys.index(p.key)
            column = int(np.flatnonzero(piece.columns == i)[0])
            piece.linear['by_parameter'][:, number, column] = scale[i] * wave


def measure(problem: Problem, values: Mapping[str, float], piece: Piece, angles: Sequence[np.ndarray],
            ends: Sequence[np.ndarray]) -> None:
    """What the filter needs beside the sensitivities: residuals, weights, gaps between windows. There is a column for each
    of the simulations that `angles` and `ends` come from."""
    motion, linear = problem.motions[piece.log], piece.linear
    angle = motion.angle_rad[piece.rows]
    read = np.stack([one + disc_waves_rad(problem, values, piece.log, one) for one in angles], axis=2)
    residual = np.nan_to_num(angle)[:, :, None] - read
    weight = np.where(np.isfinite(angle), motion.weight[piece.rows], 0.0)
    gap = np.zeros((*piece.states.shape, len(ends)))
    gap[:-1] = np.stack(ends, axis=2)[:-1] - piece.states[1:, :, None]
    linear.update(read=read, residual=residual, weight=weight, gap=gap, stands=piece.stands, first=piece.first,
                  prior_sd=piece.prior_sd, time_s=problem.logs[piece.log].time_s)
    if problem.jitter_s > 0.0:
        linear['common_sd'] = problem.common_sd(piece)
    linear.update(_core.condense(linear))


def disc_waves_rad(problem: Problem, values: Mapping[str, float], log: int, angles_rad: np.ndarray) -> np.ndarray:
    """What the discs add to the readings at these angles, shape (rows, 2)."""
    waves = np.zeros(angles_rad.shape)
    place = problem.disc_angles_rad(log, angles_rad)
    for wheel in problem.discs:
        number, (sine, cosine) = WHEELS.index(wheel), disc_of(wheel, log)
        waves[:, number] = values[sine.key] * np.sin(place[:, number]) + values[cosine.key] * np.cos(place[:, number])
    return waves


def _relative(problem: Problem, values: Mapping[str, float], scale: np.ndarray) -> np.ndarray:
    """What each disturbance does, as scaled changes of the parameters: shape (5, parameters). A factor moves a parameter by
    its own value (b2 may be smaller than its scale)."""
    out = np.zeros((5, len(problem.keys)))
    for row, names in enumerate((problem.form.road, ('b1_Nm', 'b2_Nm'), ('motor_stall_torque_Nm',), ('M10_Nm',), ('M20_Nm',))):
        for name in names:
            i = problem.keys.index(name)
            out[row, i] = (values[name] if row < 3 else 1.0) / scale[i]
    return out


def run_filter(fit: Fit, disturbances: Disturbances) -> tuple[float, list[Any]]:
    """-2 log likelihood but for a constant at the best parameters, and what `_core.filter_pieces` gave."""
    found = filtered(fit, fit.pieces, disturbances)
    N, n, square, log_variance = summed(found)
    return float(square[0] - n[:, 0] @ solved(fit, N, n[:, 0]) + log_variance), found


def summed(found: Sequence[Any]) -> list[np.ndarray]:
    """Over all pieces: the normal equations, squares and logarithms of variances that `filtered` gave."""
    return [np.asarray(sum(part)) for part in zip(*(one[:4] for one in found))]


def filtered(fit: Fit, pieces: Sequence[Piece], disturbances: Disturbances) -> list[Any]:
    """What `_core.filter_pieces` gives of each piece, with a row and a column for every parameter."""
    out = []
    way = _relative(fit.problem, fit.values, fit.scale)
    size = len(fit.scale)
    for piece in pieces:
        at = piece.columns
        N, n, square, log_variance, readings = _core.filter_pieces(
            [piece.linear], way[:, at], disturbances.sd, disturbances.time_constant_s, fit.problem.variance_rad2)[0]
        whole, right = np.zeros((size, size)), np.zeros((size, n.shape[1]))
        whole[np.ix_(at, at)], right[at] = N, n
        out.append((whole, right, square, log_variance, readings))
    return out


def solved(fit: Fit, N: np.ndarray, n: np.ndarray, low: np.ndarray | None = None, high: np.ndarray | None = None) -> np.ndarray:
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


def step(fit: Fit, disturbances: Disturbances) -> float:
    """One iteration: linearise, estimate, move parameters and states. Returns how far they moved, in standard deviations:
    of the direction that the logs know best, not of each parameter alone."""
    problem = fit.problem
    if (found := linearise_where_better(fit)) is None or disturbances is not fit.disturbances:
        _, found = run_filter(fit, disturbances)
    fit.disturbances = disturbances
    N, n = keep_normals(fit, found)
    before = [piece.states for piece in fit.pieces]
    values = np.array([fit.values[p.key] for p in problem.parameters])
    # Sizes that cannot vanish move by factors: where the logs know only a product, its factors move along straight lines.
    sizes = np.array([not p.floor and p.key != DELAY for p in problem.parameters])
    least, most = np.array([(p.least, p.most) for p in problem.parameters]).T
    with np.errstate(divide='ignore', invalid='ignore'):
        low = np.where(sizes, np.log(np.maximum(least, 1e-12) / values), (least - values) / fit.scale)
        high = np.where(sizes, np.log(most / values), (most - values) / fit.scale)
    x = solved(fit, N, n, np.maximum(low, -LARGEST_STEP), np.minimum(high, LARGEST_STEP))
    fit.last_step = float(np.sqrt(x @ (N + np.diag(fit.prior()[0])) @ x))
    square, weights = (sum(float(np.ravel(one[i])[0]) for one in found) for i in (2, 4))
    fit.least_rms = float(np.sqrt(COUNT_VARIANCE * max(square - 2.0 * n @ x + x @ N @ x, 0.0) / max(weights, 1e-9)))
    _move_states(fit, disturbances, x)
    shorter = max(fit.halvings - 1, 0)  # begin near the length that the last step had in the end
    x = x * 0.5**shorter
    for piece, states in zip(fit.pieces, before):
        piece.states = states + 0.5**shorter * (piece.states - states) if shorter else piece.states
    with np.errstate(over='ignore'):
        moved = np.clip(np.where(sizes, values * np.exp(x), values + fit.scale * x), least, most)
    fit.moved = Move(fit.values, before, float(fit.cost.sum()), shorter)
    fit.values = {**fit.values, **{p.key: float(v) for p, v in zip(problem.parameters, moved)}}
    return fit.last_step


def to_rest(fit: Fit, disturbances: Disturbances, most: int, rests: float = CONVERGED) -> None:
    """Steps until one goes less far than `rests`, at most so many."""
    for _ in range(most):
        if step(fit, disturbances) < rests:
            break


def linearise_where_better(fit: Fit) -> list[Any] | None:
    """Linearises at the present values. Where the last step led to worse ones, or to a plant that cannot be, halves it.
    Returns what the filter gave with the last step's disturbances; None if there was no step to judge."""
    if (last := fit.moved) is None:
        fit.scale, fit.halvings = linearise(fit.problem, fit.values, fit.pieces), 0
        return None
    found: list[Any] = []
    for halving in range(MOST_HALVINGS + 1):
        try:
            fit.scale = linearise(fit.problem, fit.values, fit.pieces)
            _, found = run_filter(fit, fit.disturbances)
            cost = sum(float(one[2][0]) + one[3] for one in found)
        except ValueError:
            if halving == MOST_HALVINGS:
                raise
            cost = np.inf
        halved = halving if cost == np.inf else last.shorter + halving
        if cost <= last.cost + LARGEST_RISE or halved >= MOST_HALVINGS or halving == MOST_HALVINGS:
            break
        fit.values = {key: value if key == 'u0' else 0.5 * (last.before[key] + value) for key, value in fit.values.items()}
        for piece, states in zip(fit.pieces, last.states):
            piece.states = 0.5 * (piece.states + states)
    fit.halvings = last.shorter + halving if halving else last.shorter // 2
    return found


def slopes(fit: Fit, disturbances: Disturbances, found: Sequence[Any]) -> np.ndarray:
    """Of the -2 log likelihood of `run_filter`, which gave `found`: by the logarithms of the disturbances' sizes and of
    their times, shape (2, 5). At the best parameters these need not follow."""
    N, n, *_ = summed(found)
    x = solved(fit, N, n[:, 0])
    way = _relative(fit.problem, fit.values, fit.scale)
    return np.asarray(sum(_core.slopes(piece.linear, x[piece.columns], way[:, piece.columns], disturbances.sd,
                                       disturbances.time_constant_s, fit.problem.variance_rad2) for piece in fit.pieces))


def keep_normals(fit: Fit, found: Sequence[Any]) -> tuple[np.ndarray, np.ndarray]:
    logs, n = len(fit.problem.logs), len(fit.scale)
    fit.normal, fit.right, fit.cost = np.zeros((logs, n, n)), np.zeros((logs, n)), np.zeros(logs)
    for piece, (N, right, square, log_variance, _) in zip(fit.pieces, found):
        fit.normal[piece.log] += N
        fit.right[piece.log] += right[:, 0]
        fit.cost[piece.log] += square[0] + log_variance
    return fit.normal.sum(axis=0), fit.right.sum(axis=0)


def left_out_cost(fit: Fit, doubted: str = '') -> float:
    """-2 log likelihood but for a constant of each log by what all the others tell, or of the only one. Needs the
    normal equations of the last step or of `keep_normals`. A doubted flaw is none where the others do not tell."""
    N, n = fit.normal.sum(axis=0), fit.right.sum(axis=0)
    if len(fit.normal) == 1:
        return float(fit.cost.sum() - n @ solved(fit, N, n))
    total = 0.0
    keys = fit.keys
    if doubted:
        at = keys.index(doubted)
        to_none = (fit.problem.parameters[at].none - fit.values[doubted]) / fit.scale[at]
        N[at, at] += to_none**-2
        n[at] += 1.0 / to_none
    for log, (Nl, nl, cl) in enumerate(zip(fit.normal, fit.right, fit.cost)):
        x = solved(fit, N - Nl, n - nl)
        # Where its counters began, only the log itself can tell.
        own = [keys.index(p.key) for wheel in fit.problem.discs for p in disc_of(wheel, log)]
        x[own] = 0.0
        x[own] = np.linalg.solve(Nl[np.ix_(own, own)] + 1e-9 * np.eye(len(own)), nl[own] - Nl[own] @ x)
        total += float(cl - 2 * nl @ x + x @ Nl @ x)
    return total


def _move_states(fit: Fit, disturbances: Disturbances, x: np.ndarray) -> None:
    problem = fit.problem
    way = _relative(problem, fit.values, fit.scale)
    square = weights = 0.0
    for piece in fit.pieces:
        # The states are near already. A wide prior would only lose digits in the backward pass.
        linear = {**piece.linear, 'prior_sd': np.minimum(piece.prior_sd, NEAR_SD)}
        change, left = _core.smooth(linear, x[piece.columns], way[:, piece.columns], disturbances.sd,
                                    disturbances.time_constant_s, problem.variance_rad2)
        square += left
        weights += float(linear['readings'][:, 1].sum())
        change[:, 2:4] = np.clip(change[:, 2:4], -30, 30)
        piece.states = piece.states + change[:, :5]
        piece.states[:, 2:4] = np.where(piece.stands != 0, 0.0, np.maximum(piece.states[:, 2:4], 0.0))
        piece.states[:, 4] = np.maximum(piece.states[:, 4], 0.0)
    fit.rms_counts = float(np.sqrt(square / max(weights, 1e-9))) / problem.radians_per_count
