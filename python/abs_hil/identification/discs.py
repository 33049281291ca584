"""Eccentric encoder discs: which logs show them, and what all logs say together of a wheel's."""
import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.stats

from .intervals import WIDTH, Spread
from .linear import to_rest
from .parameters import disc_of
from .problem import Disturbances, Fit

#: A disc is believed, and one phase for all logs refused, if chance does it less often than this.
CHANCE = 1e-6


@dataclass
class Disc:
    """phase_rad is None if the logs do not agree on one: their counters began at different places of the disc."""
    eccentricity_rad: float
    sd_rad: float
    phase_rad: float | None
    phase_sd_rad: float


def _places(fit: Fit, wheel: str) -> np.ndarray:
    """Of sine and cosine of each log among the parameters, shape (logs, 2)."""
    keys = fit.keys
    return np.array([[keys.index(p.key) for p in disc_of(wheel, log)] for log in range(len(fit.problem.logs))])


def _information(fit: Fit, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values and covariance of these parameters by the filter's information."""
    chosen = places.ravel()
    scale = fit.scale[chosen]
    values = np.array([fit.values[fit.keys[i]] for i in chosen])
    return values, fit.covariance()[np.ix_(chosen, chosen)] * np.outer(scale, scale)


def settle(fit: Fit, disturbances: Disturbances, check: Callable[[], None] = lambda: None) -> tuple[Fit, dict[str, float]]:
    """The fit without the discs that its logs do not show, and the largest eccentricity that each of these may have, from
    the log that says most (95 %)."""
    largest: dict[str, float] = {}
    problem = fit.problem
    for wheel in problem.discs:
        values, covariance = _information(fit, _places(fit, wheel))
        if scipy.stats.chi2.sf(float(values @ np.linalg.solve(covariance, values)), len(values)) < CHANCE:
            continue
        bounds = []
        for i in range(0, len(values), 2):
            sd = float(np.sqrt(np.linalg.eigvalsh(covariance[i:i + 2, i:i + 2])[-1]))
            bounds.append((sd, float(np.hypot(*values[i:i + 2])) + WIDTH * sd))
        largest[wheel] = min(bounds)[1]
    if not largest:
        return fit, largest
    left = dataclasses.replace(problem, discs=tuple(wheel for wheel in problem.discs if wheel not in largest))
    kept = {p.key for p in left.parameters}
    fit = fit.copy(problem=left, free=fit.free[[key in kept for key in fit.keys]],
                   values={key: value for key, value in fit.values.items() if '_disc_' not in key or key in kept})
    to_rest(fit, disturbances, 4, check)
    return fit, largest


def disc(fit: Fit, spread: Spread, wheel: str) -> Disc:
    """All logs together: one phase if they agree on one, else the eccentricity alone."""
    places = _places(fit, wheel)
    values, covariance = _information(fit, places)
    logs = len(places)
    chosen = places.ravel()
    scattered = spread.covariance[np.ix_(chosen, chosen)] * np.outer(fit.scale[chosen], fit.scale[chosen])
    same = np.tile(np.eye(2), (logs, 1))
    weights = np.linalg.solve(covariance, same)
    weights = weights @ np.linalg.inv(same.T @ weights)  # (2 logs, 2)
    mean = weights.T @ values
    left = values - same @ mean
    misfit = float(left @ np.linalg.solve(covariance, left))
    if logs == 1 or scipy.stats.chi2.sf(misfit, 2 * logs - 2) > CHANCE:
        e = float(np.hypot(*mean))
        spreads = weights.T @ scattered @ weights
        out, along = mean / e, np.array([-mean[1], mean[0]]) / e
        return Disc(e, float(np.sqrt(out @ spreads @ out)), float(np.arctan2(mean[1], mean[0])),
                    float(np.sqrt(along @ spreads @ along)) / e)
    pairs = values.reshape(-1, 2)
    each = np.hypot(*pairs.T)
    outward = np.zeros((logs, 2 * logs))
    for i in range(logs):
        outward[i, 2 * i:2 * i + 2] = pairs[i] / each[i]
    weight = np.linalg.solve(outward @ covariance @ outward.T, np.ones(logs))
    weight /= weight.sum()
    return Disc(float(weight @ each), float(np.sqrt(weight @ outward @ scattered @ outward.T @ weight)), None, np.nan)
