"""The delay of the board's inputs, where the logs show one."""
import dataclasses
from collections.abc import Callable

import numpy as np

from .fit import CONVERGED
from .linear import keep_normals, linearise, run_filter, solved, step
from .parameters import DELAY
from .problem import LARGEST_QUIET_RMS, QUIET, Fit

#: a delay is believed if it is this many standard deviations from 0
SURE_DELAY = 6.0
LARGEST_DELAY_S = 0.02



def with_delay(fit: Fit, check: Callable[[], None], say: Callable[[str], None]) -> Fit:
    """Adds the inputs' delay if the logs are sure of one, and if then only the counts' steps disturb."""
    problem = dataclasses.replace(fit.problem, with_delay=True)
    late = fit.copy(problem=problem, free=np.append(fit.free, True), values={**fit.values, DELAY: 0.0})
    late.scale = linearise(problem, late.values, late.pieces, check)
    N, n = keep_normals(late, run_filter(late, QUIET)[1])
    x = solved(late, N, n)[-1]
    if x < SURE_DELAY * float(np.sqrt(late.covariance()[-1, -1])) or not 2e-5 < x * late.scale[-1] < LARGEST_DELAY_S:
        return fit
    for _ in range(8):
        if step(late, QUIET, check) < CONVERGED:
            break
    if late.rms_counts > LARGEST_QUIET_RMS:
        return fit
    say(f'the inputs act {1e3 * late.values[DELAY]:.3g} ms late')
    return late
