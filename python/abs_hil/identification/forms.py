"""Which form of the plant the logs are of: by cross-validation, and by which one follows them."""
from collections.abc import Callable, Sequence

import numpy as np

from .fit import ROUNDS, finish_fit
from .linear import solved, step
from .parameters import disc_of
from .problem import LARGEST_QUIET_RMS, Fit

#: a difference of -2 log likelihood that decides between the forms, and one that does so at first values already
CLEAR_DIFFERENCE = 500.0
CLEAR_AT_FIRST = 5000.0



def better_form(fits: Sequence[Fit], start_form: str, check: Callable[[], None], say: Callable[[str], None],
                notes: list[str]) -> tuple[Fit, bool]:
    """The form that better predicts each log from all the others, by the likelihood. Large disturbances and first values
    are enough if they show a clear difference already. False: the logs do not tell, and the form is the start's."""
    costs = [_cross_validated(fit) for fit in fits]
    if abs(costs[0] - costs[1]) < CLEAR_AT_FIRST:
        for number, fit in enumerate(fits):
            for _ in range(2):
                step(fit, ROUNDS[1][0], check)
            costs[number] = _cross_validated(fit)
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


def _cross_validated(fit: Fit) -> float:
    N, n = fit.normal.sum(axis=0), fit.right.sum(axis=0)
    if len(fit.normal) == 1:
        return float(fit.cost.sum() - n @ solved(fit, N, n))
    total = 0.0
    keys = fit.keys
    for log, (Nl, nl, cl) in enumerate(zip(fit.normal, fit.right, fit.cost)):
        x = solved(fit, N - Nl, n - nl)
        # Where its counters began, only the log itself can tell.
        own = [keys.index(p.key) for wheel in fit.problem.discs for p in disc_of(wheel, log)]
        x[own] = 0.0
        x[own] = np.linalg.solve(Nl[np.ix_(own, own)] + 1e-9 * np.eye(len(own)), nl[own] - Nl[own] @ x)
        total += float(cl - 2 * nl @ x + x @ Nl @ x)
    return total
