"""abs_hil.identify: a rig's parameters from its logs."""
from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core import _core
from ..options import PathLike, options
from . import discs, intervals, rate_limit
from .delay import with_delay
from .fit import ROUNDS, describe, disturbed_fit, finish_fit, likely_u0, start_fit
from .forms import better_form
from .linear import step
from .logs import Log, load_log
from .parameters import COMBINATIONS, DELAY, FORMS, GIVEN, RATE_LIMIT, WHEELS, checked_keys
from .problem import LARGEST_QUIET_RMS, QUIET, Disturbances, Fit, Problem

#: an estimate whose standard deviation is above this share of its value is not called identified
LARGEST_SD = 0.05
#: above this share no interval is given at all
LARGEST_WIDTH = 0.25
#: a combination is given too if a part of it is less certain than this
UNCERTAIN_PART = 0.01
#: a log whose own estimate lies this far from the others' is named: chi-square over its degrees of freedom
LARGEST_DISAGREEMENT = 6.0
#: the wheels' radii differ by less than this factor: further from 1, the wheels did not roll on each other
LARGEST_RATIO = 1.5
#: of a parameter in its relative change: a log with less does not speak of it
LEAST_INFORMATION = 10.0
#: the disturbances take up what the model lacks, so a fit that follows the logs has 0.3 counts RMS also on a rig that wanders
LARGEST_RMS = 1.0
#: friction, brake and motor of no rig wander this far; what else the model or the logs lack does
LARGEST_WANDER = 0.1


@dataclass
class Estimate:
    """status: identified, bounded, fixed or not-identifiable; low and high hold the truth in 95 % of cases, None where
    the logs say too little."""
    value: float
    low: float | None
    high: float | None
    status: str
    unit: str


@dataclass
class Identified:
    """What identify() found. parameters: by name with unit; notes: sentences about what the logs do not tell."""
    form: str
    start: str
    parameters: dict[str, Estimate]
    combinations: dict[str, Estimate]
    residual_counts_rms: float
    disturbances: Disturbances | None
    notes: list[str]
    logs: list[Log]
    fit: Fit
    spread: intervals.Spread
    disagreement: dict[str, float] = field(default_factory=dict)
    validation: dict[str, Any] | None = None
    interrupted: bool = False

    def values(self) -> dict[str, float]:
        """The plant's keys without "plant." and their values."""
        return {name: estimate.value for name, estimate in self.parameters.items() if name != DELAY}


def _silent(_: str) -> None:
    pass


def identify(logs: Sequence[PathLike | Log], start: PathLike = 'paper-table1', *,
             fix: Mapping[str, float | None] | None = None, drift: Sequence[str] = (), form: str = 'auto', seed: int = 1,
             say: Callable[[str], None] = _silent, check: Callable[[], None] = lambda: None) -> Identified:
    """Estimates the rig's parameters from logs of counts and duties.

    logs:  run folders, event logs or CSV files (see load_log), or Log objects
    start: plant that gives J2_kg_m2, r2_m, the encoder's counts and what the logs do not tell
    fix:   parameters to leave alone: at their start value (None) or at the given one
    drift: factors that may differ from log to log: brake_torque
    form:  auto, magic-formula or inteco-mu; auto compares how well each predicts logs that it was not fitted to
    seed:  of the bootstrap
    say, check: called with progress in words; called often, may raise to stop

    An interruption (Ctrl-C) after the first values returns what there is, without intervals. Raises ValueError for logs
    that cannot serve and for unknown keys.
    """
    fix = dict(fix or {})
    checked_keys(fix)
    if form != 'auto' and form not in FORMS:
        raise ValueError(f'form {form}: give auto, {" or ".join(FORMS)}')
    for name in drift:
        if name != 'brake_torque':
            raise ValueError(f'--drift {name}: no such drift; give brake_torque')
    loaded = _with_names([log if isinstance(log, Log) else load_log(log) for log in logs])
    if not loaded:
        raise ValueError('give at least one log')
    notes = [note for log in loaded for note in log.notes]
    given = _core.PlantOptions(options(plant=start)).values()
    start_form = str(given['tyre'])
    values = {k: v for k, v in given.items() if isinstance(v, float)}
    values.update({key: number for key, number in fix.items() if number is not None})
    _refuse_swapped(loaded)

    fits: list[Fit] = []
    begun: list[Fit] = []
    for name in FORMS if form == 'auto' else (form,):
        say(f'{FORMS[name].meaning}: first values')
        problem = Problem.of(FORMS[name], start, loaded, fix, drift, WHEELS)
        if not any(problem.segments):
            raise ValueError('in no log does a wheel turn for long enough (0.2 s above 10 rad/s)')
        try:
            begun.append(start_fit(problem, values, check, begun[0] if begun else None))
            # Each form for itself: one that cannot follow the logs may take a limit for a remedy.
            fits.append(rate_limit.started(begun[-1], check))
        except (ValueError, np.linalg.LinAlgError) as error:
            notes.append(f'{FORMS[name].meaning}: cannot be fitted ({error})')
    if not fits:
        raise ValueError(f'no form of the plant can be fitted to these logs: {"; ".join(notes[-2:])}')
    fit = fits[0] if len(fits) == 1 else better_form(fits, start_form, check, say, notes)
    try:
        finished = _finished(fit, seed, say, check)
    except KeyboardInterrupt:
        return _interrupted(fit, str(start), notes)
    found = _assembled(finished, str(start), notes)
    _name_disagreement(found)
    if found.residual_counts_rms > LARGEST_RMS:
        found.notes.insert(0, f'the model does not follow the logs: residual {found.residual_counts_rms:.3g} counts RMS, at most '
                           f'{LARGEST_RMS:g} is expected even of a rig that wanders. No interval is given')
        _without_intervals(found)
    elif found.disturbances is not None and found.disturbances.sd[:3].max() > LARGEST_WANDER:
        odd = max(found.disagreement, key=lambda name: found.disagreement[name], default='')
        found.notes.insert(0, f'the logs disagree{f", {odd} most" if odd else ""}: only a rig that wanders by '
                           f'{100 * found.disturbances.sd[:3].max():.2g} % would explain them with one set of parameters. Are '
                           'they of one rig, and of one state of its brake and tyre? No interval is given')
        _without_intervals(found)
    return found


def _with_names(logs: list[Log]) -> list[Log]:
    """Each log with a name of its own."""
    seen: dict[str, int] = {}
    out = []
    for log in logs:
        seen[log.name] = seen.get(log.name, 0) + 1
        out.append(log if seen[log.name] == 1 else dataclasses.replace(log, name=f'{log.name} ({seen[log.name]})'))
    return out


@dataclass
class Finished:
    """The last fit, what its intervals are made of, the disturbances if there are any, and the largest eccentricity of
    the discs that no log shows."""
    fit: Fit
    spread: intervals.Spread
    gaps: list[tuple[float, float, float]]
    disturbances: Disturbances | None
    round_discs: dict[str, float]


def _finished(fit: Fit, seed: int, say: Callable[[str], None], check: Callable[[], None]) -> Finished:
    say(f'{fit.problem.form.meaning}: fit')
    # Without disturbances a fit to the logs of a rig that wanders may go anywhere: the other one begins where this one does.
    undisturbed = _undisturbed(fit.copy(), check, say)
    quiet = undisturbed is not None and undisturbed.rms_counts <= LARGEST_QUIET_RMS
    if undisturbed is not None and quiet:
        fit = undisturbed
    else:
        left = f'residual {undisturbed.rms_counts:.3g} counts RMS' if undisturbed is not None else 'no fit without disturbances'
        say(f'{left}: the rig wanders, or the model lacks something')
        try:
            fit = disturbed_fit(fit, check, say)
            limited = rate_limit.started(fit, check)
            fit = fit if limited is fit else disturbed_fit(limited, check, say)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise ValueError(f'the fit does not converge: these logs are not of a rig that the plant describes ({error})'
                             ) from None
    if not np.isfinite(fit.rms_counts):
        raise ValueError('the fit does not converge: these logs are not of a rig that the plant describes')
    fit = rate_limit.settle(fit, QUIET if quiet else fit.disturbances, check)
    fit, round_discs = discs.settle(fit, QUIET if quiet else fit.disturbances, check)
    gaps = likely_u0(fit, QUIET if quiet else fit.disturbances, check)
    say('intervals')
    spread = intervals.bootstrap(fit, seed, check=check) if quiet else intervals.information(fit)
    return Finished(fit, spread, gaps, None if quiet else fit.disturbances, round_discs)


def _undisturbed(fit: Fit, check: Callable[[], None], say: Callable[[str], None]) -> Fit | None:
    """The fit as if nothing disturbed the rig but the counts' steps; None if it ends nowhere."""
    try:
        fit = with_delay(finish_fit(fit, check), check, say)
        if fit.rms_counts <= LARGEST_QUIET_RMS:
            limited = rate_limit.sought(fit, QUIET, check)
        else:
            near = fit.copy()
            step(near, ROUNDS[-1][0], check)
            limited = rate_limit.started(near, check)
            limited = fit if limited is near else limited
        return fit if limited is fit else finish_fit(limited, check)
    except (ValueError, np.linalg.LinAlgError):
        return None


def _interrupted(fit: Fit, start: str, notes: list[str]) -> Identified:
    """What there is, without intervals."""
    size = len(fit.problem.parameters)
    nothing = np.full((size, size), np.nan)
    found = _assembled(Finished(fit, intervals.Spread(nothing, np.zeros(size), 0, nothing), [], None, {}), start,
                       ['interrupted: the values are provisional, and no interval is given'])
    found.notes[1:] = notes
    _without_intervals(found)
    found.interrupted = True
    return found


def _without_intervals(found: Identified) -> None:
    """The values are the last ones of the fit; nothing is promised of them."""
    for estimate in found.parameters.values():
        if estimate.status != 'fixed':
            estimate.status, estimate.low, estimate.high = 'not-identifiable', None, None
    found.combinations.clear()


def _refuse_swapped(logs: Sequence[Log]) -> None:
    """The brake slows the upper wheel: while it acts most, the upper wheel turns less for a turn of the lower one than
    while both roll."""
    for log in logs:
        strong = (log.brake_pwm > 0) & (log.brake_pwm >= 0.95 * log.brake_pwm.max())
        recent = round(0.5 / log.period_s)  # after a locked wheel, rolling takes its time
        acted = np.convolve(log.brake_pwm > 0, np.ones(recent))[:len(log)] > 0
        rolling = ~acted & (log.motor_pwm == 0)
        ratios = []
        for rows in (strong, rolling):
            together = (rows & (log.wheels_apart == 0))[:-1]
            turned = np.nansum(np.abs(np.diff(log.counts, axis=0))[together], axis=0)
            ratios.append(turned[0] / turned[1] if turned.min() > 200 else np.nan)
        if ratios[0] > 1.02 * ratios[1]:
            cause = 'upper_counts and lower_counts seem to be swapped'
            if not 1 / LARGEST_RATIO < ratios[1] < LARGEST_RATIO:
                cause = 'the wheels seem to be apart at times; give a column wheels_apart that is 1 then and 0 otherwise'
            raise ValueError(f'"{log.path}": {cause}: the upper wheel turns {ratios[0]:.4f} times as far as the lower one '
                             f'while the brake acts, but {ratios[1]:.4f} times while neither brake nor motor acts')


def _assembled(finished: Finished, start: str, notes: list[str]) -> Identified:
    fit, spread, disturbances = finished.fit, finished.spread, finished.disturbances
    problem = fit.problem
    parameters: dict[str, Estimate] = {}
    for key, unit in GIVEN.items():
        parameters[key] = Estimate(problem.given[key], problem.given[key], problem.given[key], 'fixed', unit)
    cures: dict[str, list[str]] = {}
    relative: dict[str, float] = {}
    for i, p in enumerate(problem.parameters):
        value = fit.values[p.key]
        if p.acts == 'reading':
            continue
        if p.key in problem.fixed:
            parameters[p.key] = Estimate(value, value, value, 'fixed', p.unit)
            continue
        if p.key == 'u0':
            parameters[p.key] = _u0(fit, finished.gaps if _known(parameters.get('b1_Nm')) else [])
            if parameters[p.key].status != 'identified':
                cures.setdefault(p.cure, []).append(p.key)
            continue
        sd = float(np.sqrt(np.maximum(spread.covariance[i, i], 0.0))) * float(fit.scale[i])
        relative[p.key] = sd / max(abs(value), 1e-300)
        low, high = value - intervals.WIDTH * sd, value + intervals.WIDTH * sd
        estimate = Estimate(value, max(low, p.least), min(high, p.most), 'identified', p.unit)
        if value <= p.least or value >= p.most:
            estimate.status = 'bounded'
            notes.append(f'{p.key} is at its bound {value:g} {p.unit}')
        elif not relative[p.key] <= LARGEST_SD:
            estimate.status = 'not-identifiable'
            cures.setdefault(p.cure, []).append(p.key)
            if relative[p.key] > LARGEST_WIDTH or sd == 0.0:
                estimate.low = estimate.high = None
        parameters[p.key] = estimate
    if RATE_LIMIT.key not in parameters:
        parameters[RATE_LIMIT.key] = _no_rate_limit(fit, notes, cures)
    parameters.update(_discs(finished, notes))
    combinations: dict[str, Estimate] = {}
    for name, (unit, parts, cure) in COMBINATIONS.items():
        if any(part not in parameters for part in parts):
            continue
        value, sd = intervals.combination(fit, spread, name)
        known = sd <= LARGEST_SD * abs(value)
        worst = max(relative.get(part, 0.0) for part in parts)
        if worst <= UNCERTAIN_PART or 3 * sd > worst * abs(value):
            continue
        combinations[name] = Estimate(value, value - intervals.WIDTH * sd, value + intervals.WIDTH * sd,
                                      'identified' if known else 'not-identifiable', unit)
        if known:
            joined = ' and '.join((', '.join(parts[:-1]), parts[-1]))
            notes.append(f'{joined} are known better together, as {name} = {value:.5g} {unit}; to part them, run: {cure}')
    for cure, keys in cures.items():
        if cure:
            notes.append(f'the logs do not tell {", ".join(keys)}; run: {cure}')
    if disturbances is not None:
        notes.append(f'the rig wanders ({describe(disturbances)}); the intervals count with it')
    return Identified(problem.form.name, start, parameters, combinations, fit.rms_counts, disturbances, notes,
                      list(problem.logs), fit, spread)


def _no_rate_limit(fit: Fit, notes: list[str], cures: dict[str, list[str]]) -> Estimate:
    """The logs show none: 0, the lag alone. A larger one than the logs' fastest change cannot be seen."""
    problem = fit.problem
    if RATE_LIMIT.key in problem.fixed:
        value = problem.fixed[RATE_LIMIT.key]
        return Estimate(value, value, value, 'fixed', RATE_LIMIT.unit)
    if not any(log.brake_pwm.any() for log in problem.logs):
        cures.setdefault(RATE_LIMIT.cure, []).append(RATE_LIMIT.key)
        return Estimate(0.0, None, None, 'not-identifiable', RATE_LIMIT.unit)
    notes.append(f'the logs show no limit of the brake\'s rate; one above {rate_limit.fastest_Nm_s(fit, problem.logs):.3g} N m/s '
                 'would not show')
    return Estimate(0.0, 0.0, RATE_LIMIT.most, 'bounded', RATE_LIMIT.unit)


def _discs(finished: Finished, notes: list[str]) -> dict[str, Estimate]:
    """The encoders' eccentricity: 0, at most what no log would show, or what the logs say together."""
    out = {}
    for wheel in WHEELS:
        name = f'{wheel}_encoder_eccentricity_rad'
        if wheel not in finished.fit.problem.discs:
            out[name] = Estimate(0.0, 0.0, finished.round_discs.get(wheel), 'bounded', 'rad')
            continue
        disc = discs.disc(finished.fit, finished.spread, wheel)
        e, reach = disc.eccentricity_rad, intervals.WIDTH * disc.sd_rad
        known = disc.sd_rad <= LARGEST_SD * e
        out[name] = Estimate(e, max(0.0, e - reach), e + reach, 'identified' if known else 'not-identifiable', 'rad')
        turned = intervals.WIDTH * disc.phase_sd_rad
        phase = f'{wheel}_encoder_phase_rad'
        if disc.phase_rad is None:
            out[phase] = Estimate(0.0, None, None, 'not-identifiable', 'rad')
            notes.append(f'the {wheel} encoder is eccentric, but its counter began at another place of the disc in each log: so '
                         'no phase is known, and [model] leaves the eccentricity out; control.observer.learn_eccentricity_s '
                         'learns it before a braking')
        else:
            out[phase] = Estimate(disc.phase_rad, disc.phase_rad - turned, disc.phase_rad + turned,
                                  'identified' if known else 'not-identifiable', 'rad')
    return out


def _known(estimate: Estimate | None) -> bool:
    return estimate is not None and estimate.status in ('identified', 'fixed')


def _u0(fit: Fit, gaps: list[tuple[float, float, float]]) -> Estimate:
    """identified if the logs exclude smaller and larger values, bounded if one of them. Without the brake's line, which tells
    what a duty above u0 does, nothing is excluded."""
    value = fit.values['u0']
    smaller, larger = intervals.excluded(gaps)
    if not (smaller or larger):
        return Estimate(value, None, None, 'not-identifiable', '1')
    low, high = intervals.u0_interval(gaps, fit.values)
    certain = smaller and larger and high - low <= LARGEST_SD * value
    return Estimate(value, low, high if larger else 1.0, 'identified' if certain else 'bounded', '1')


def _name_disagreement(found: Identified) -> None:
    """Compares each log with all of them: the score of one log at the joint estimate."""
    fit = found.fit
    if len(found.logs) == 1:
        return
    inverse = np.zeros((len(fit.scale), len(fit.scale)))
    inverse[np.ix_(fit.free, fit.free)] = fit.covariance()
    for log, Nl, nl in zip(found.logs, fit.normal, fit.right):
        told = fit.free & (np.diag(Nl) > LEAST_INFORMATION)
        d = 1 / np.sqrt(np.diag(Nl)[told])
        covariance = (Nl - Nl @ inverse @ Nl)[np.ix_(told, told)] * np.outer(d, d)
        values, vectors = np.linalg.eigh(covariance)
        kept = values > 1e-3  # what the log has in common with others; the rest is its own, and rounding
        if kept.any():
            z = (vectors.T @ (d * nl[told]))[kept] / np.sqrt(values[kept])
            found.disagreement[log.name] = float(z @ z / kept.sum())
    odd = {name: ratio for name, ratio in found.disagreement.items() if ratio > LARGEST_DISAGREEMENT}
    if odd:
        worst = max(odd, key=lambda name: odd[name])
        found.notes.append(f'the logs disagree: {worst} most (chi-square per degree of freedom {odd[worst]:.3g}, expected '
                           '1); is it of another rig, has something changed between the logs, or does the brake fade '
                           '(--drift brake_torque)? So no interval is given')
        for estimate in (*found.parameters.values(), *found.combinations.values()):
            if estimate.status != 'fixed':
                estimate.status, estimate.low, estimate.high = 'not-identifiable', None, None
