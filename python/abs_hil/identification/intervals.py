"""Intervals of 95 %: by quantising the fitted motion anew with other encoder phases (parametric bootstrap) where only the
counts' steps disturb, by the information of the filter where the rig wanders. And what the logs say of eccentric discs."""
import dataclasses
from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.stats

from ..core import _core
from .encoders import middles
from .linear import filtered, solved, to_rest
from .parameters import COMBINATIONS, WHEELS, disc_of
from .problem import COUNT_VARIANCE, QUIET, Fit

REPLICATES = 80
_BATCH = 20
#: of a normal distribution, 95 %
WIDTH = 1.96
#: of a chi-square distribution with one degree of freedom, 95 %
LIKELY = 3.84
#: A disc is believed, and one phase for all logs refused, if chance does it less often than this.
CHANCE = 1e-6


@dataclass
class Spread:
    """Covariance of the free parameters' scaled changes, (n, n) with zeros for those that are not free. `of_logs`: the part
    of it that the logs' own errors make, for combinations that hardly depend on the first values; scores: of each log alone at
    the joint estimate of each draw, (logs, n, draws)."""
    covariance: np.ndarray
    of_logs: np.ndarray
    scores: np.ndarray | None = None


def bootstrap(fit: Fit, seed: int = 1) -> Spread:
    """Spread of the estimates over random encoder phases. The estimate is linear in the counts near the solution."""
    problem = fit.problem
    per_count = problem.radians_per_count
    random = np.random.default_rng(seed)
    phases = random.uniform(size=(len(problem.logs), 2, REPLICATES))
    late = np.array([[[problem.slots[wheel].error_counts if wheel in problem.slots else 0.0] for wheel in WHEELS]])
    estimates, scores = [], []
    for begin in range(0, REPLICATES, _BATCH):
        problem.check()
        chosen = phases[:, :, begin:begin + _BATCH]
        size = len(fit.scale)
        logs = len(problem.logs)
        N, n = np.zeros((logs, size, size)), np.zeros((logs, size, chosen.shape[2]))
        for piece in fit.pieces:
            exact = piece.linear['read'] / per_count
            phase = chosen[piece.log][None]
            from_edge = exact + phase * np.where(late > 0.0, 2.0, 1.0)
            jittered = from_edge
            if problem.jitter_s > 0.0:
                common = problem.common_sd(piece)[:, :, None] * np.sqrt(COUNT_VARIANCE)
                jittered = from_edge + common * random.standard_normal((len(common), 1, chosen.shape[2]))
            residual = (middles(jittered, late) - from_edge) * per_count
            changed = {**piece.linear, 'residual': residual, 'gap': np.zeros((*piece.states.shape, chosen.shape[2]))}
            changed.update(_core.condense(changed))
            found = filtered(fit, [dataclasses.replace(piece, linear=changed)], QUIET)[0]
            N[piece.log] += found[0]
            n[piece.log] += found[1]
        whole = N.sum(axis=0)
        shift = solved(fit, whole, np.zeros(size))  # what the prior alone does
        some = np.transpose([solved(fit, whole, right) - shift for right in n.sum(axis=0).T])
        estimates.append(some)
        scores.append(n - N @ some)
    scatter = np.cov(np.concatenate(estimates, axis=1))
    # The first values' errors add to it: all of it where the logs tell nothing.
    known = fit.covariance()
    return Spread(scatter + known @ np.diag(fit.prior()[0]) @ known, scatter, np.concatenate(scores, axis=2))


def information(fit: Fit, more: np.ndarray | float = 0.0, wider: float = 1.0) -> Spread:
    """Spread by the filter's information, `wider` times, and by `more` (structure.unsettled)."""
    return Spread(wider * fit.covariance() + more, wider * fit.covariance() + more)


def combination(fit: Fit, spread: Spread, name: str) -> tuple[float, float]:
    """(value, standard deviation) of a combination of parameters."""
    at, values = zip(*((fit.keys.index(key), fit.values[key]) for key in COMBINATIONS[name][1]))
    product = name == 'theta_B_C_N'
    value = float(np.prod(values) if product else np.sum(values))
    gradient = fit.scale[list(at)] * (value / np.array(values) if product else 1.0)
    return value, float(np.sqrt(max(0.0, gradient @ spread.of_logs[np.ix_(at, at)] @ gradient)))


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


def settle_discs(fit: Fit) -> tuple[Fit, dict[str, float]]:
    """The fit without the discs that its logs do not show, and the largest eccentricity that each of these may have, from
    the log that says most (95 %)."""
    largest: dict[str, float] = {}
    for wheel in fit.problem.discs:
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
    fit = fit.changed({}, discs=tuple(wheel for wheel in fit.problem.discs if wheel not in largest))
    fit.values = {key: value for key, value in fit.values.items() if '_disc_' not in key or key in fit.keys}
    to_rest(fit, fit.disturbances, 4)
    return fit, largest


def disc(fit: Fit, spread: Spread, wheel: str) -> tuple[float, float, float | None, float]:
    """All logs together: eccentricity and phase, rad, each with its standard deviation. The phase is None if the logs do not
    agree on one: their counters began at different places of the disc."""
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
        return (e, float(np.sqrt(out @ spreads @ out)), float(np.arctan2(mean[1], mean[0])),
                float(np.sqrt(along @ spreads @ along)) / e)
    pairs = values.reshape(-1, 2)
    each = np.hypot(*pairs.T)
    outward = scipy.linalg.block_diag(*(pairs / each[:, None]))
    weight = np.linalg.solve(outward @ covariance @ outward.T, np.ones(logs))
    weight /= weight.sum()
    return float(weight @ each), float(np.sqrt(weight @ outward @ scattered @ outward.T @ weight)), None, np.nan
