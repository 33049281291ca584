"""The fit: prediction errors of the counts over all logs, by a Kalman filter on windows.

Each window of a log starts from states of its own, which the filter ties together: so a fit neither diverges where the
plant is unstable (past the tyre's peak) nor needs good start values. The plant is linearised around the most likely
states by simulating each window with each parameter moved a little (C++, `_core.linearise`). Slow random factors over
road, brake, motor and both bearings are states of the filter: large in the first rounds, when the model is wrong;
as large as the logs say in the last.
"""
import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np
import scipy.optimize

from ..core import _core
from .brake_flaws import act
from .linear import CONVERGED, disc_waves_rad, filtered, measure, run_filter, slopes, solved, step, to_rest
from .logs import motion_of
from .parameters import DELAY, RATE_LIMIT
from .problem import LARGEST_QUIET_RMS, QUIET, WINDOW_DISTURBED_S, WINDOW_S, Disturbances, Fit, Problem, pieces_of
from .start import first_values

#: rounds of the homotopy: disturbances, number of iterations
ROUNDS = ((Disturbances.of(0.10, 0.05, 0.2), 2), (Disturbances.of(0.01, 0.005, 0.5), 2),
          (Disturbances.of(1e-3, 1e-4, 1.0), 1), (Disturbances.of(1e-4, 1e-5, 1.0), 1))
#: an eccentricity below this sways no first value, rad
SMALL_DISC_RAD = 3e-4
#: a residual without disturbances that hardly falls from above this, in counts, will not fall to the counts' steps
HOPELESS_RMS = 10.0
#: of the likelihood, in one search for the disturbances
MOST_EVALUATIONS = 20


def other_costs(fit: Fit, disturbances: Disturbances, affected: Sequence[bool], key: str, others: Sequence[float],
                check: Callable[[], None]) -> list[float]:
    """-2 log likelihood at other values of one parameter. It simulates the affected pieces anew and keeps the sensitivities,
    so the other parameters may follow only as far as they are uncertain."""
    problem = fit.problem
    values = [{**fit.values, key: other} for other in others]
    # With flaws of the brake, the duties that ask for its torque depend on the value: one by one.
    together = [values] if not act(fit.values) else [[one] for one in values]
    within = 5.0 * np.sqrt(np.diag(fit.covariance()))
    rest = filtered(fit, [piece for piece, hit in zip(fit.pieces, affected) if not hit], disturbances)
    costs = []
    for some in together:
        found = list(rest)
        for piece, hit in zip(fit.pieces, affected):
            if not hit:
                continue
            check()
            first, *more = [problem.plant_values(one, piece.log) for one in some]
            other = _core.linearise(problem.base, first, [(one, 1.0, 'always') for one in more],
                                    problem.flawed(piece.log, some[0])[0].inputs(), piece.first, piece.states)
            angles, ends = ([other[at]] + [other[at] + other[by][:, :, i] for i in range(len(more))]
                            for at, by in (('angles', 'by_parameter'), ('end', 'end_by_parameter')))
            moved = dataclasses.replace(piece, linear=dict(piece.linear))
            measure(problem, fit.values, moved, angles, ends)
            found += filtered(fit, [moved], disturbances)
        N = np.asarray(sum(one[0] for one in found))
        for i in range(len(some)):
            at = [i if len(one[2]) > 1 else 0 for one in found]  # pieces that were not affected have one column
            n = np.asarray(sum(one[1][:, column] for one, column in zip(found, at)))
            x = solved(fit, N, n, -within, within)
            costs.append(sum(float(one[2][column]) + one[3] for one, column in zip(found, at))
                         - float(2 * n @ x - x @ N @ x))
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
    # Below the duty at which its line crosses zero the brake gives nothing, wherever u0 lies: a search there sees no slope.
    if present < (crossing := -fit.values['b2_Nm'] / fit.values['b1_Nm']) < duties[-1]:
        present = crossing
    first = max(int(np.searchsorted(duties, present - width, 'right')) - 1, 0)
    edges = duties[first:int(np.searchsorted(duties, present + width)) + 1]
    gaps = list(zip(edges[:-1], edges[1:]))
    if not gaps:
        return []
    if len(gaps) > most:  # evenly chosen ones; a later call looks closer
        gaps = [gaps[i] for i in sorted({round(i) for i in np.linspace(0, len(gaps) - 1, most)})]
    acting = [problem.logs[piece.log].brake_pwm[max(piece.rows.start - 1, 0):piece.rows.stop] for piece in fit.pieces]
    affected = [bool(np.any((duty >= edges[0]) & (duty <= edges[-1]))) for duty in acting]
    # A duty that equals u0 acts (7): so u0 lies above the gap's begin, up to its end.
    inside = [max(0.5 * (begin + end), end - 1e-3) for begin, end in gaps]
    costs = other_costs(fit, disturbances, affected, 'u0', inside, check)
    tried = [(float(begin), float(end), cost) for (begin, end), cost in zip(gaps, costs)]
    fit.values['u0'] = float(inside[int(np.argmin(costs))])
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


def start_fit(problem: Problem, start: Mapping[str, float], check: Callable[[], None] = lambda: None,
              other_form: Fit | None = None) -> Fit:
    """First values and a few rounds with large disturbances: near the truth, whatever the start. What `other_form` found of
    the same logs is not sought again."""
    if other_form is not None:
        problem = dataclasses.replace(problem, motions=other_form.problem.motions)
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
    values = {DELAY: 0.0, RATE_LIMIT.key: problem.fixed.get(RATE_LIMIT.key, 0.0), **first_values(problem, start, other_form),
              **dict.fromkeys(problem.factors, 1.0),
              **{p.key: 0.0 for p in problem.parameters if p.acts == 'reading'}, **(discs or {})}
    free = np.array([p.key not in problem.fixed and p.key != 'u0' for p in problem.parameters])
    fit = Fit(problem, values, pieces_of(problem, values, WINDOW_S), ROUNDS[0][0], WINDOW_S, free, dict(values))
    disturbances, count = ROUNDS[0]
    for _ in range(count):
        step(fit, disturbances, check)
    return fit


def finish_fit(fit: Fit, check: Callable[[], None] = lambda: None) -> Fit:
    """The rest of the rounds, then without disturbances until nothing moves."""
    for number, (disturbances, count) in enumerate(ROUNDS[1:]):
        for _ in range(count):
            step(fit, disturbances, check)
        search_u0(fit, disturbances, 0.004 / 4**number, 9, check)
    _undisturbed(fit, check)
    for _ in range(2):
        if not fit.rms_counts > LARGEST_QUIET_RMS:
            break
        # u0 may have stopped one step of the duties beside.
        moved = fit.copy()
        step(moved, ROUNDS[-1][0], check)
        search_u0(moved, ROUNDS[-1][0], 0.001, 9, check)
        if moved.values['u0'] == fit.values['u0']:
            break
        _undisturbed(moved, check)
        if not moved.rms_counts < fit.rms_counts:
            break
        fit = moved
    return fit


def _undisturbed(fit: Fit, check: Callable[[], None]) -> None:
    """Steps without disturbances until nothing moves, or until it shows that the logs are of a rig that wanders."""
    before, stalls = np.inf, 0
    for _ in range(12):
        moved = step(fit, QUIET, check)
        # The residual settles last: past the peak the states need some rounds more than the parameters.
        if moved < CONVERGED or (moved < 1.0 and fit.rms_counts > 0.999 * before > LARGEST_QUIET_RMS):
            break
        stalls = stalls + 1 if fit.rms_counts > 0.99 * before > HOPELESS_RMS else 0
        if stalls == 2:
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
        if round_number == 0 and search_u0(fit, present, 0.03, 13, check):
            step(fit, present, check)  # u0 may have begun far off
        search_u0(fit, present, 0.003 / 2**round_number, 7, check)
        if round_number < 3:
            present = likeliest_disturbances(fit, present)
            say(f'disturbances: {present}')
    if not moved < CONVERGED:
        to_rest(fit, present, 6, check)
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
