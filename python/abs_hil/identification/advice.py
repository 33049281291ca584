"""What to run next: by how much each shipped experiment would narrow the intervals (D-optimal design)."""
import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..core import _core
from ..options import Value, options
from ..simulation import simulate
from .found import Identified
from .linear import keep_normals, linearise, run_filter
from .logs import Log, motion_of, segments_of
from .parameters import EXPERIMENTS
from .problem import QUIET, WINDOW_DISTURBED_S, WINDOW_S, Disturbances, Fit, pieces_of
from .results import plant_settings

#: factors below this are worth a word
NARROWER = 0.8


@dataclass
class Advice:
    """gain: of the logarithm of the information's determinant; narrower: parameter -> new over old standard deviation."""
    experiment: str
    gain: float
    narrower: dict[str, float]

    def sentence(self) -> str:
        if not self.narrower:
            return f'{self.experiment}: would narrow no interval by a fifth'
        best = sorted(self.narrower.items(), key=lambda item: item[1])[:6]
        return f'{self.experiment}: ' + ', '.join(f'{name} to {100 * factor:.0f} % of its interval' for name, factor in best)


def log_of(name: str, settings: Mapping[str, Value], phases: Sequence[float] | None = None) -> Log:
    """A log of an experiment on a simulated plant. `phases`: where within a count each wheel's encoder begins, from 0 to 1;
    the duties are those of phases 0."""
    columns = simulate(experiment=name, set=settings).columns
    counts = np.stack([columns['upper_counts'], columns['lower_counts']], axis=1)
    log = Log(name, pathlib.Path(name), '', columns['time_s'], counts - counts[0], np.nan_to_num(columns['brake_pwm']),
              np.nan_to_num(columns['motor_pwm']), columns['wheels_apart'], columns.get('phase_name', columns['phase']),
              np.zeros((len(counts), 2)), first_counts=counts[0].astype(float), experiment=name)
    if phases is not None:
        base = _core.PlantOptions(options(set=settings))
        per_count = 2 * np.pi / int(base.values()['encoder_counts_per_rev'])
        start = np.array([phases[0] * per_count, phases[1] * per_count, columns['omega1_rad_s'][0],
                          columns['omega2_rad_s'][0], columns['brake_torque_Nm'][0]])
        counts = _core.encoder_counts(base, _core.trajectory(base, [], log.inputs(), start)[:, :2]).astype(float)
        log.counts, log.first_counts = counts - counts[0], counts[0]
    return log


def advise(found: Identified) -> list[Advice]:
    """The experiments, best first. Simulates each on the identified plant."""
    fit = found.fit
    free = fit.free
    present = (fit.normal.sum(axis=0) + np.diag(fit.prior()[0]))[np.ix_(free, free)]
    before = np.sqrt(np.diag(np.linalg.inv(present)))
    keys = [key for key, one in zip(fit.keys, free) if one]
    disturbances = QUIET if found.disturbances is None else found.disturbances
    all_of_them = []
    for name in EXPERIMENTS:
        fit.problem.check()
        try:
            log = log_of(name, plant_settings(found))
        except ValueError:
            continue  # this rig cannot do it, for instance because it never gets fast enough
        added = information(fit, log, WINDOW_S if found.disturbances is None else WINDOW_DISTURBED_S, disturbances)
        total = present + added[np.ix_(free, free)]
        after = np.sqrt(np.diag(np.linalg.inv(total)))
        gain = float(np.linalg.slogdet(total)[1] - np.linalg.slogdet(present)[1])
        all_of_them.append(Advice(name, gain, {key: float(b / a) for key, a, b in zip(keys, before, after) if b / a < NARROWER}))
    return sorted(all_of_them, key=lambda one: -one.gain)


def information(fit: Fit, log: Log, window_s: float, disturbances: Disturbances) -> np.ndarray:
    """The information of one more log at the estimate, in the scaled changes of `fit`."""
    old = fit.problem
    motion = motion_of(log, old.counts_per_rev)
    problem = dataclasses.replace(old, logs=[log], motions=[motion], segments=[segments_of(log, motion)], drifts=(), discs=(),
                                  slots={})
    values = {key: value for key, value in fit.values.items() if not key.startswith('brake_factor')}
    other = Fit(problem, values, pieces_of(problem, values, window_s), disturbances, window_s,
                np.array([p.key not in old.fixed and p.key != 'u0' for p in problem.parameters]))
    other.scale = linearise(problem, values, other.pieces)
    N, _ = keep_normals(other, run_filter(other, disturbances)[1])
    chosen = [fit.keys.index(key) for key in other.keys]
    out = np.zeros((len(fit.keys), len(fit.keys)))
    ratio = fit.scale[chosen] / other.scale
    out[np.ix_(chosen, chosen)] = N * np.outer(ratio, ratio)
    return out
