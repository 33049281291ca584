"""What of the model the logs ask for: the form of tyre and load, a limit of the brake's rate, a delay of the board's inputs."""
import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from .brake_flaws import brake_torques, static_torques
from .fit import ROUNDS, finish_fit, other_costs
from .linear import keep_normals, left_out_cost, linearise, run_filter, solved, step, to_rest
from .logs import Log
from .parameters import DELAY, RATE_LIMIT
from .problem import LARGEST_QUIET_RMS, QUIET, Disturbances, Fit

#: a delay is believed if it is this many standard deviations from 0
SURE_DELAY = 6.0
LARGEST_DELAY_S = 0.02
#: a difference of -2 log likelihood that decides between the forms, and one that does so at first values already
CLEAR_DIFFERENCE = 500.0
CLEAR_AT_FIRST = 5000.0
#: a limit is believed if it lowers -2 log likelihood by this
CLEAR_GAIN = 50.0
#: its standard deviation over its value, at most
LEAST_SURE = 0.05
#: candidates, over the fastest rate that the lag alone would give; the first ones tell whether others are worth a look
FIRST_SHARES = (0.98, 0.9, 0.6)
SHARES = (*np.geomspace(0.06, 0.9, 15), 0.95, 0.98)
WORTH_A_LOOK = 3.0


def better_form(fits: Sequence[Fit], start_form: str, check: Callable[[], None], say: Callable[[str], None],
                notes: list[str]) -> tuple[Fit, bool]:
    """The form that better predicts each log from all the others, by the likelihood. Large disturbances and first values
    are enough if they show a clear difference already. False: the logs do not tell, and the form is the start's."""
    costs = [left_out_cost(fit) for fit in fits]
    if abs(costs[0] - costs[1]) < CLEAR_AT_FIRST:
        for number, fit in enumerate(fits):
            for _ in range(2):
                step(fit, ROUNDS[1][0], check)
            costs[number] = left_out_cost(fit)
        follow = [_follows(fit, check) for fit in fits] if abs(costs[0] - costs[1]) > CLEAR_DIFFERENCE else []
        if sum(follow) == 1:
            best = follow.index(True)
            notes.append(f'form: {fits[best].problem.form.meaning}; it alone follows the logs to the steps of the counts')
            return fits[best], True
    for fit, cost in zip(fits, costs):
        say(f'{fit.problem.form.meaning}: -2 log likelihood of left-out logs {cost:.6g}')
    best = int(np.argmin(costs))
    starts = [i for i, fit in enumerate(fits) if fit.problem.form.name == start_form]
    if abs(costs[0] - costs[1]) < CLEAR_DIFFERENCE and starts:
        return fits[starts[0]], False
    notes.append(f'form: {fits[best].problem.form.meaning}; it predicts left-out logs better (-2 log likelihood lower by '
                 f'{abs(costs[0] - costs[1]):.3g})')
    return fits[best], True


def _follows(fit: Fit, check: Callable[[], None]) -> bool:
    """Whether nothing but the steps of the counts is left between the logs and this form."""
    try:
        return finish_fit(fit.copy(), check).rms_counts <= LARGEST_QUIET_RMS
    except (ValueError, np.linalg.LinAlgError):
        return False


def fastest_Nm_s(fit: Fit, logs: Sequence[Log]) -> float:
    """The largest rate of the brake's torque in the logs if the lag alone held it back."""
    values = {key: value for key, value in fit.values.items() if key != RATE_LIMIT.key}
    return max(float(np.max(np.abs(values['c31_per_s'] * (static_torques(log, values) - brake_torques(log, values)))))
               for log in logs)


def sought(fit: Fit, disturbances: Disturbances, check: Callable[[], None] = lambda: None) -> Fit:
    """The fit with a limit of the brake's rate if one explains the logs clearly better. Needs the linearisation of `step`."""
    problem = fit.problem
    if problem.with_rate_limit or RATE_LIMIT.key in problem.fixed or not any(log.brake_pwm.any() for log in problem.logs):
        return fit
    fastest = fastest_Nm_s(fit, problem.logs)
    affected = [bool(np.any(problem.logs[piece.log].brake_pwm[piece.rows] > 0)) for piece in fit.pieces]

    def costs_of(shares: Sequence[float]) -> list[float]:
        return other_costs(fit, disturbances, affected, RATE_LIMIT.key, [share * fastest for share in shares], check)

    without, *first = costs_of((0.0, *FIRST_SHARES))
    if min(first) > without - WORTH_A_LOOK:
        return fit
    costs = costs_of(SHARES)
    best = int(np.argmin(costs))
    if not costs[best] < without - CLEAR_GAIN:
        return fit
    limit = {RATE_LIMIT.key: SHARES[best] * fastest}
    return dataclasses.replace(fit.changed(limit, with_rate_limit=True), first={**fit.first, **limit})


def started(fit: Fit, check: Callable[[], None] = lambda: None) -> Fit:
    """As `sought`, with a few rounds around the limit."""
    found = sought(fit, fit.disturbances, check)
    if found is not fit:
        to_rest(found, found.disturbances, 3, check)
    return found


def settle(fit: Fit, disturbances: Disturbances, check: Callable[[], None] = lambda: None) -> Fit:
    """The fit without a limit that its logs do not tell after all."""
    if not fit.problem.with_rate_limit:
        return fit
    at = fit.keys.index(RATE_LIMIT.key)
    value = fit.values[RATE_LIMIT.key]
    sd = float(np.sqrt(fit.covariance()[at, at]) * fit.scale[at])
    if sd < LEAST_SURE * value and value < fastest_Nm_s(fit, fit.problem.logs):
        return fit
    fit = without(fit)
    to_rest(fit, disturbances, 4, check)
    return fit


def without(fit: Fit) -> Fit:
    """A copy of the fit in which the lag alone holds the brake's torque back."""
    if not fit.problem.with_rate_limit:
        return fit.copy()
    return fit.changed({RATE_LIMIT.key: 0.0}, with_rate_limit=False)


def with_delay(fit: Fit, check: Callable[[], None], say: Callable[[str], None]) -> Fit:
    """Adds the inputs' delay if the logs are sure of one, and if then only the counts' steps disturb."""
    late = fit.changed({DELAY: 0.0}, with_delay=True)
    late.scale = linearise(late.problem, late.values, late.pieces, check)
    N, n = keep_normals(late, run_filter(late, QUIET)[1])
    x = solved(late, N, n)[-1]
    if x < SURE_DELAY * float(np.sqrt(late.covariance()[-1, -1])) or not 2e-5 < x * late.scale[-1] < LARGEST_DELAY_S:
        return fit
    to_rest(late, QUIET, 8, check)
    if late.rms_counts > LARGEST_QUIET_RMS:
        return fit
    say(f'the inputs act {1e3 * late.values[DELAY]:.3g} ms late')
    return late
