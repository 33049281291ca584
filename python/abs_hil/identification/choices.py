"""What of the model the logs ask for: the form of tyre and load, a limit of the brake's rate, a delay of the board's inputs, the
steps of its duties."""
import dataclasses
from collections.abc import Iterator, Sequence

import numpy as np

from .brake_flaws import brake_torques, static_torques
from .fit import COMPARED, LEVELS, descend, other_costs
from .linear import keep_normals, left_out_cost, linearise, run_filter, solved, to_rest
from .logs import Log
from .parameters import DELAY, JOINING, RATE_LIMIT
from .problem import Fit

#: a delay is believed if it is this many standard deviations from 0, and a flaw kept
SURE_DELAY = 6.0
SURE = 4.0
LARGEST_DELAY_S = 0.02
#: a difference of -2 log likelihood that decides between the forms
CLEAR_DIFFERENCE = 500.0
#: of boards with PWMs of 8, 10 and 12 bit
PWM_STEPS = (255, 1023, 4095)
#: a limit is believed if it lowers -2 log likelihood by this
CLEAR_GAIN = 50.0
#: its standard deviation over its value, at most
LEAST_SURE = 0.05
#: candidates, over the fastest rate that the lag alone would give; the first ones tell whether others are worth a look
FIRST_SHARES = (0.98, 0.9, 0.6)
SHARES = (*np.geomspace(0.06, 0.9, 15), 0.95, 0.98)
WORTH_A_LOOK = 3.0


def better_form(fits: Sequence[Fit], start_form: str, notes: list[str]) -> tuple[list[Fit], bool]:
    """Takes all forms down to COMPARED side by side, or to where none can follow the logs. First the one that better predicts each
    log from all the others, by the likelihood. One that cannot follow the logs waits behind all while another may. False: the logs
    do not tell, and the form is the start's."""
    left, waiting, levels = [(np.inf, fit) for fit in fits], list[Fit](), LEVELS[1:LEVELS.index(COMPARED) + 1]
    while levels:
        now = levels if len(left) == 1 else levels[:1]
        levels = levels[len(now):]
        tried = sorted(((_lowered(fit, now), fit) for _, fit in left), key=lambda one: one[0])
        if not (left := [one for one in tried if one[1].may_follow]):
            left = tried
            break
        waiting += [fit for _, fit in tried if not fit.may_follow]
    for cost, fit in left:
        fit.problem.say(f'{fit.problem.form.meaning}: -2 log likelihood of left-out logs {cost:.6g}')
    if len(left) > 1 and left[-1][0] - left[0][0] <= CLEAR_DIFFERENCE:
        return sorted((fit for _, fit in left), key=lambda fit: fit.problem.form.name != start_form), False
    if len(fits) > 1:
        why = 'it predicts left-out logs better' if len(left) > 1 else 'it alone may follow the logs to the steps of the counts'
        notes.append(f'form: {left[0][1].problem.form.meaning}; {why}')
    return [fit for _, fit in left] + waiting, True


def _lowered(fit: Fit, levels: Sequence[float]) -> float:
    """The form's cost at the last of these levels: infinite where it leads to a plant that cannot be."""
    try:
        descend(fit, levels)
        return left_out_cost(fit)
    except (ValueError, np.linalg.LinAlgError):
        fit.least_rms = np.inf
        return np.inf


def are_given_in(fit: Fit, steps: int) -> bool:
    """True if the logs' own duties are those of a board with so many steps."""
    duties = np.unique(np.concatenate([duty for log in fit.problem.logs for duty in (log.brake_pwm, log.motor_pwm)]))
    return bool(np.abs(duties * steps - np.rint(duties * steps)).max() < 1e-5)


def with_steps(fit: Fit) -> Iterator[tuple[float, Fit]]:
    """The fit to duties as boards would have given them, which the logs hold as they were asked for, each with the level of
    disturbances that would take up what a step is: one that cannot follow there has other reasons. To be believed only if nothing
    but the counts' steps is left then: on a rig that the plant does not describe, any other duties may be likelier."""
    for steps in PWM_STEPS[::-1]:
        if not are_given_in(fit, steps):
            # A half rounds up, as on the board, whatever the last digit of the log's.
            logs = [dataclasses.replace(log, **{name: np.floor(getattr(log, name) * steps + 0.5 + 1e-6) / steps
                                                for name in ('brake_pwm', 'motor_pwm')}) for log in fit.problem.logs]
            yield 0.5 / steps, fit.copy(problem=dataclasses.replace(fit.problem, logs=logs, pwm_steps=steps))


def fastest_Nm_s(fit: Fit, logs: Sequence[Log]) -> float:
    """The largest rate of the brake's torque in the logs if the lag alone held it back."""
    values = {key: value for key, value in fit.values.items() if key != RATE_LIMIT.key}
    return max(float(np.max(np.abs(values['c31_per_s'] * (static_torques(log, values) - brake_torques(log, values)))))
               for log in logs)


def sought(fit: Fit) -> Fit:
    """The fit with a limit of the brake's rate if one explains the logs clearly better. Needs the linearisation of `step`."""
    problem = fit.problem
    if RATE_LIMIT.key in {*problem.flaws, *problem.fixed} or not any(log.brake_pwm.any() for log in problem.logs):
        return fit
    fastest = fastest_Nm_s(fit, problem.logs)
    affected = [bool(np.any(problem.logs[piece.log].brake_pwm[piece.rows] > 0)) for piece in fit.pieces]

    def costs_of(shares: Sequence[float]) -> list[float]:
        return other_costs(fit, affected, [(problem, {**fit.values, RATE_LIMIT.key: share * fastest}) for share in shares])

    without, *first = costs_of((0.0, *FIRST_SHARES))
    if min(first) > without - WORTH_A_LOOK:
        return fit
    costs = costs_of(SHARES)
    best = int(np.argmin(costs))
    if not costs[best] < without - CLEAR_GAIN:
        return fit
    limit = {RATE_LIMIT.key: SHARES[best] * fastest}
    limited = dataclasses.replace(fit.changed(limit, flaws=(*problem.flaws, RATE_LIMIT.key)), first={**fit.first, **limit})
    to_rest(limited, fit.disturbances, 3)
    return limited


def with_delay(fit: Fit) -> Fit:
    """The fit with a delay of the inputs if the logs are sure of one."""
    late = fit.changed({DELAY: 0.0}, flaws=(*fit.problem.flaws, DELAY))
    late.scale = linearise(late.problem, late.values, late.pieces)
    N, n = keep_normals(late, run_filter(late, fit.disturbances)[1])
    x = solved(late, N, n)[-1]
    sure = x >= SURE_DELAY * float(np.sqrt(late.covariance()[-1, -1])) and 2e-5 < x * late.scale[-1] < LARGEST_DELAY_S
    return late if sure else fit


def settle(fit: Fit) -> Fit:
    """The fit without what its logs do not tell after all: an unsure limit, a dead time of the first values that went to 0."""
    sd = dict(zip(fit.keys, np.sqrt(np.diag(fit.covariance())) * fit.scale))
    idle = []
    for key in fit.problem.flaws:
        value, none = fit.values[key], JOINING[key].none
        if key == RATE_LIMIT.key:
            told = sd[key] < LEAST_SURE * value and value < fastest_Nm_s(fit, fit.problem.logs)
        else:
            told = abs(value - none) > SURE * sd[key]
        idle += [] if told else [key]
    if idle:
        fit = fit.without(idle)
        to_rest(fit, fit.disturbances, 4)
    return fit
