"""The fit: prediction errors of the counts over all logs, by a Kalman filter on windows.

Each window of a log starts from states of its own, which the filter ties together: so a fit neither diverges where the
plant is unstable (past the tyre's peak) nor needs good start values. The plant is linearised around the most likely
states by simulating each window with each parameter moved a little (C++, `_core.linearise`). Slow random factors over
road, brake, motor and both bearings are states of the filter, with standard deviations sd. This is a homotopy: with large ones
the logs' -2 log likelihood is nearly a parabola of the parameters, without them it is that of the counts' steps alone, with
many valleys. So sd falls by half a decade at a time,

    sd = 0.1, 0.032, 0.01, ... 1e-5, 0,     bearings 0.3 sd N m

and each time the fit first comes to rest: a step of linear.py that goes less than one standard deviation. u0 is no parameter of
these steps: the likelihood is flat between two duties of the logs, so the gaps are tried. Where the rig wanders, sd and the time
constant are those of maximum likelihood, by its slopes (filter) and L-BFGS-B.
"""
import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import scipy.optimize

from ..core import _core
from .linear import CONVERGED, MOST_HALVINGS, disc_waves_rad, filtered, measure, run_filter, slopes, solved, step, to_rest
from .logs import motion_of
from .parameters import DELAY, FLAWS, RATE_LIMIT
from .problem import QUIET, WINDOW_DISTURBED_S, WINDOW_S, Disturbances, Fit, Problem, pieces_of
from .start import WORTH_DEAD, first_values

#: standard deviations of the homotopy's levels, from that of the first values down
LEVELS = (0.1, 0.032, 0.01, 3.2e-3, 1e-3, 3.2e-4, 1e-4, 3.2e-5, 1e-5)
#: the forms are compared at this one
COMPARED = 1e-3
#: a fit rests at a level when a step goes less far than this, in standard deviations; it has so many steps for it
RESTS = 1.0
MOST_AT_A_LEVEL = 6
MOST_QUIET = 64
#: of what a residual is above its bound: a step that takes less off is the last
GAINLESS = 0.02
#: an eccentricity below this sways no first value, rad
SMALL_DISC_RAD = 3e-4
#: of the likelihood, in one search for the disturbances
MOST_EVALUATIONS = 20


def other_costs(fit: Fit, affected: Sequence[bool], others: Sequence[tuple[Problem, Mapping[str, float]]]) -> list[float]:
    """-2 log likelihood with other duties or values. It simulates the affected pieces anew and keeps the sensitivities, so the
    other parameters may follow only as far as they are uncertain."""
    within = 5.0 * np.sqrt(np.diag(fit.covariance()))
    found, of_log = filtered(fit, [piece for piece, hit in zip(fit.pieces, affected) if not hit], fit.disturbances), {}
    for piece in [piece for piece, hit in zip(fit.pieces, affected) if hit]:
        fit.problem.check()
        if piece.log not in of_log:
            of_log[piece.log] = [problem.simulated(piece.log, values) for problem, values in others]
        (first, inputs), *more = of_log[piece.log]
        other = _core.linearise(fit.problem.base, first, [(one, 1.0, 'always', own) for one, own in more], inputs, piece.first,
                                piece.states)
        angles, ends = ([other[at]] + [other[at] + other[by][:, :, i] for i in range(len(more))]
                        for at, by in (('angles', 'by_parameter'), ('end', 'end_by_parameter')))
        moved = dataclasses.replace(piece, linear=dict(piece.linear))
        measure(fit.problem, fit.values, moved, angles, ends)
        found += filtered(fit, [moved], fit.disturbances)
    N = np.asarray(sum(one[0] for one in found))
    costs = []
    for i in range(len(others)):
        at = [i if len(one[2]) > 1 else 0 for one in found]  # pieces that were not affected have one column
        n = np.asarray(sum(one[1][:, column] for one, column in zip(found, at)))
        x = solved(fit, N, n, -within, within)
        costs.append(sum(float(one[2][column]) + one[3] for one, column in zip(found, at)) - float(2 * n @ x - x @ N @ x))
    return costs


def search_u0(fit: Fit, width: float, most: int) -> list[tuple[float, float, float]]:
    """Moves u0 to the most likely gap between the duties of the logs, of at most so many, within `width` of its value, or beside
    it for a width of 0. A log tells of u0 only in which of these gaps it lies: the cost is flat within one. Needs the
    linearisation of `step`; that stays valid.

    Returns (begin of the gap, end of the gap, cost) of those tried, in order.
    """
    problem, present = fit.problem, fit.values['u0']
    if 'u0' in problem.fixed:
        return []
    duties = problem.duties
    # Below the duty at which its line crosses zero the brake gives nothing, wherever u0 lies: a search there sees no slope.
    if present < (crossing := -fit.values['b2_Nm'] / fit.values['b1_Nm']) < duties[-1]:
        present = crossing
    first, last = int(np.searchsorted(duties, present - width, 'right')) - 1, int(np.searchsorted(duties, present + width))
    if width == 0.0:
        first, last = first - most // 2, last + most // 2
    edges = duties[max(first, 0):last + 1]
    if not (gaps := list(zip(edges[:-1], edges[1:]))):
        return []
    if len(gaps) > most:  # evenly chosen ones; a later call looks closer
        own = min(max(int(np.searchsorted(edges, fit.values['u0'])) - 1, 0), len(gaps) - 1)
        gaps = [gaps[i] for i in sorted({own, *(round(i) for i in np.linspace(0, len(gaps) - 1, most))})]
    acting = [problem.logs[piece.log].brake_pwm[max(piece.rows.start - 1, 0):piece.rows.stop] for piece in fit.pieces]
    affected = [bool(np.any((duty >= edges[0]) & (duty <= edges[-1]))) for duty in acting]
    # A duty that equals u0 acts (7): so u0 lies above the gap's begin, up to its end.
    inside = [float(max(0.5 * (begin + end), end - 1e-3)) for begin, end in gaps]
    costs = other_costs(fit, affected, [(problem, {**fit.values, 'u0': u0}) for u0 in inside])
    tried = [(float(begin), float(end), cost) for (begin, end), cost in zip(gaps, costs)]
    fit.values['u0'] = inside[int(np.argmin(costs))]
    return tried


def likely_u0(fit: Fit) -> list[tuple[float, float, float]]:
    """The gaps around u0 with their costs, over a range so wide that both its ends are unlikely, if there is one. Where another
    gap than u0's is the likeliest, the fit rests there first."""
    gaps: list[tuple[float, float, float]] = []
    duties = fit.problem.duties
    for _ in range(3):
        before = np.searchsorted(duties, fit.values['u0'])
        for width in (8e-4, 3e-3, 1.2e-2, 4e-2):
            gaps = search_u0(fit, width, 12)
            least = min((gap[2] for gap in gaps), default=0.0) + 10.0
            if not gaps or ((gaps[0][2] > least or gaps[0][0] <= duties[0])
                            and (gaps[-1][2] > least or gaps[-1][1] >= duties[-1])):
                break
        if np.searchsorted(duties, fit.values['u0']) == before:
            break
        to_rest(fit, fit.disturbances, 6)
    return gaps


def start_fit(problem: Problem, start: Mapping[str, float], other_form: Fit | None = None) -> Fit:
    """First values and a few rounds with large disturbances: near the truth, whatever the start. What `other_form` found of
    the same logs is not sought again."""
    if other_form is not None:
        known = other_form.first
        return _started(dataclasses.replace(problem, motions=other_form.problem.motions), start, known, known)
    fit = _started(problem, start, {})
    if not fit.may_follow and (late := _started(problem, start, {}, worth_dead=0.0)).least_rms < fit.least_rms:
        fit = late
    discs = {p.key: fit.values[p.key] for p in problem.parameters if p.acts == 'reading'}
    if all(abs(value) < SMALL_DISC_RAD for value in discs.values()):
        return fit
    # Speeds that an eccentric disc does not sway give better first values.
    motions = []
    for number, (log, motion) in enumerate(zip(problem.logs, problem.motions)):
        waves = disc_waves_rad(problem, discs, number, log.counts * problem.radians_per_count) / problem.radians_per_count
        turned = motion_of(dataclasses.replace(log, counts=log.counts - waves), problem.counts_per_rev)
        motions.append(dataclasses.replace(motion, smooth_rad=turned.smooth_rad, speed_rad_s=turned.speed_rad_s))
    return _started(dataclasses.replace(problem, motions=motions), start, discs)


def _started(problem: Problem, start: Mapping[str, float], discs: Mapping[str, float],
             other_form: Mapping[str, float] | None = None, worth_dead: float = WORTH_DEAD) -> Fit:
    first = first_values(problem, start, other_form, worth_dead)
    problem = dataclasses.replace(problem, flaws=tuple(flaw.key for flaw in FLAWS if flaw.key in first))
    values = {DELAY: 0.0, RATE_LIMIT.key: problem.fixed.get(RATE_LIMIT.key, 0.0), **first, **dict.fromkeys(problem.factors, 1.0),
              **{p.key: discs.get(p.key, 0.0) for p in problem.parameters if p.acts == 'reading'}}
    free = np.array([p.key not in problem.fixed and p.key != 'u0' for p in problem.parameters])
    fit = Fit(problem, values, pieces_of(problem, values, WINDOW_S), level(LEVELS[0]), WINDOW_S, free, dict(values))
    to_rest(fit, level(LEVELS[0]), 2)
    return fit


def level(sd: float) -> Disturbances:
    return Disturbances.of(sd, 0.3 * sd, 0.2 if sd > 0.03 else 0.5)


def rest(fit: Fit, disturbances: Disturbances, most: int, rests: float) -> None:
    """Steps until one goes less far than `rests`, at most so many, or until no further one will bring the fit below the bound of
    its residual: where the gain of one falls below GAINLESS of what is missing."""
    stuck, before = 0, np.inf
    for number in range(most):
        # What the logs hardly tell moves on without end: the longer it lasts, the larger a step may be the last.
        moved, square = step(fit, disturbances), fit.least_rms**2
        stuck += fit.halvings >= MOST_HALVINGS
        if moved < min(max(rests, 0.05 * number), RESTS) or stuck == 2 or (
                not fit.may_follow and before - square < GAINLESS * (square - fit.bound_rms**2)):
            break
        before = square


def descend(fit: Fit, levels: Sequence[float]) -> None:
    """Lowers the disturbances level by level, and waits at each until the fit rests; goes no lower than where it shows that it
    cannot follow the logs. Where a level's last step hardly moved, the steps converge quadratically: then the next levels are
    left out, more each time."""
    at, stride = 0, 1
    while at < len(levels):
        present = level(levels[at])
        for number in range(3):
            rest(fit, present, MOST_AT_A_LEVEL, RESTS)
            u0 = fit.values['u0']
            if number == 0 and levels[at] > COMPARED:
                search_u0(fit, 0.004, 9)
            search_u0(fit, 0.0, 6)
            if fit.values['u0'] == u0:
                break
        if not fit.may_follow:
            break
        stride = 2 * stride if fit.last_step < CONVERGED else 1
        at += stride


def finish_fit(fit: Fit) -> Fit:
    """From the fit's level, or COMPARED, down the others; then without disturbances until nothing moves. It stays at the level
    that shows that it cannot follow the logs."""
    top = float(fit.disturbances.sd[0]) or COMPARED
    descend(fit, [sd for sd in LEVELS if sd <= top])
    if fit.may_follow:
        rest(fit, QUIET, MOST_QUIET, CONVERGED)
    return fit


def disturbed_fit(fit: Fit) -> Fit:
    """A fit for a rig whose factors wander: estimates how much, by maximum likelihood, along with the parameters."""
    problem = fit.problem
    fit = dataclasses.replace(fit, pieces=pieces_of(problem, fit.values, WINDOW_DISTURBED_S), window_s=WINDOW_DISTURBED_S,
                              moved=None)
    present = Disturbances.of(0.02, 0.01, 0.2)
    for round_number in range(4):
        for _ in range(2 if round_number == 0 else 1):
            moved = step(fit, present)
        if round_number == 0 and search_u0(fit, 0.03, 13):
            step(fit, present)  # u0 may have begun far off
        search_u0(fit, 0.003 / 2**round_number, 7)
        if round_number < 3:
            present = likeliest_disturbances(fit, present)
            problem.say(f'disturbances: {present}')
    if not moved < CONVERGED:
        to_rest(fit, present, 6)
    return fit


def likeliest_disturbances(fit: Fit, guess: Disturbances) -> Disturbances:
    """Maximises the likelihood over the five standard deviations and one time constant, at this linearisation."""
    x0 = np.log(np.append(guess.sd, guess.time_constant_s[0]))
    # A weak pull keeps a factor that no log excites from running away.
    centre = np.log(np.array([0.01, 0.01, 0.01, 0.003, 0.003, 0.2]))

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        present = Disturbances(np.exp(x[:5]), np.full(5, np.exp(x[5])))
        value, found = run_filter(fit, present)
        by_sd, by_time = slopes(fit, present, found)
        pull = (x - centre) / 3.0
        return value + float(pull @ pull), np.append(by_sd, by_time.sum()) + 2.0 / 3.0 * pull
    bounds = [*zip(np.log([1e-5] * 3 + [1e-6] * 2 + [0.02]), np.log([0.5] * 3 + [0.3] * 2 + [5.0]))]
    best = scipy.optimize.minimize(cost, np.clip(x0, *np.transpose(bounds)), method='L-BFGS-B', jac=True, bounds=bounds,
                                   options={'maxfun': MOST_EVALUATIONS, 'ftol': 1e-6})
    return Disturbances(np.exp(best.x[:5]), np.full(5, np.exp(best.x[5])))
