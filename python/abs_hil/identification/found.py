"""What identify() found: estimates with their intervals, statuses and combinations, and which logs disagree."""
import math
from dataclasses import dataclass, field
from typing import Any, Self, TypeGuard

import numpy as np

from . import choices, intervals, structure
from .linear import solved
from .logs import Log
from .parameters import COMBINATIONS, DELAY, EXPERIMENTS, GIVEN, RATE_LIMIT, WHEELS
from .problem import Disturbances, Fit, Problem

#: an estimate whose standard deviation is above this share of its value is not called identified
LARGEST_SD = 0.05
#: above this share no interval is given at all
LARGEST_WIDTH = 0.25
#: a combination is given too if a part of it is less certain than this
UNCERTAIN_PART = 0.01
#: a log whose own estimate lies this far from the others' is named: chi-square over its degrees of freedom
LARGEST_DISAGREEMENT = 6.0
#: of a parameter in its relative change: a log with less does not speak of it
LEAST_INFORMATION = 10.0


@dataclass
class Estimate:
    """status: identified, bounded, fixed or not-identifiable; low and high hold the truth in 95 % of cases, None where
    the logs say too little."""
    value: float
    low: float | None
    high: float | None
    status: str
    unit: str

    @classmethod
    def normal(cls, value: float, sd: float, unit: str, known: bool | None = None) -> Self:
        """With the interval of a normal distribution, identified if `known`: else if it is narrow."""
        known = sd <= LARGEST_SD * abs(value) if known is None else known
        return cls(value, value - intervals.WIDTH * sd, value + intervals.WIDTH * sd,
                   'identified' if known else 'not-identifiable', unit)

    @classmethod
    def fixed(cls, value: float, unit: str) -> Self:
        return cls(value, value, value, 'fixed', unit)

    def withdraw(self) -> None:
        """The logs do not tell it."""
        self.status, self.low, self.high = 'not-identifiable', None, None


@dataclass
class Identified:
    """What identify() found. parameters: by name with unit; notes: sentences about what the logs do not tell; misfit: why the
    logs give no model of the plant, empty if they do; undecided: they do not tell the form of the tyre, or their tyre is
    of no form; refused: its values are those of no rig; wanted: those notes that say what to run."""
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
    misfit: str = ''
    undecided: bool = False
    refused: bool = False
    wanted: list[str] = field(default_factory=list)

    def values(self) -> dict[str, float]:
        """The plant's keys without "plant." and their values."""
        return {name: estimate.value for name, estimate in self.parameters.items() if name != DELAY}


@dataclass
class Finished:
    """The last fit, what its intervals are made of, the disturbances if there are any, the largest eccentricity of the
    discs that no log shows, what the disturbances have in common that the plant lacks, why the logs give no model."""
    fit: Fit
    spread: intervals.Spread
    gaps: list[tuple[float, float, float]]
    disturbances: Disturbances | None
    round_discs: dict[str, float]
    causes: list[structure.Found] = field(default_factory=list)
    misfit: str = ''


def interrupted(fit: Fit, start: str, notes: list[str]) -> Identified:
    """What there is, without intervals."""
    size = len(fit.problem.parameters)
    nothing = np.full((size, size), np.nan)
    found = assembled(Finished(fit, intervals.Spread(nothing, nothing), [], None, {}), start,
                       ['interrupted: the values so far are kept, without intervals; for all, the same command with --force'])
    found.notes[1:] = notes
    without_intervals(found)
    found.interrupted = True
    return found


def refuse(found: Identified, why: str, of_logs: list[str], undecided: bool) -> None:
    """The logs do not fit the plant: the values are the last ones of the fit, and nothing is promised of them."""
    found.misfit, found.undecided, found.refused = why, undecided, True
    found.notes[:] = [f'{why}{"" if why.endswith("?") else "."} So no interval is given and no model.toml is written',
                      *(note for note in of_logs if not (undecided and note.startswith('form: '))),
                      *(note for note in found.wanted if all(log.experiment for log in found.logs) and 'among the' not in note)]
    without_intervals(found)


def leave_form_open(found: Identified) -> None:
    """The logs do not tell the form of tyre and load. What both forms share is kept."""
    found.undecided = True
    found.misfit = ('the logs do not tell the form of tyre and load. Run: slip-sweep or locked-stop, or name it with --form')
    found.notes.insert(0, f'{found.misfit}. The tyre has no interval, and no model.toml is written')
    for p in found.fit.problem.form.tyre:
        found.parameters[p.key].withdraw()
    found.combinations.pop('theta_B_C_N', None)


def without_intervals(found: Identified) -> None:
    for estimate in found.parameters.values():
        if estimate.status != 'fixed':
            estimate.withdraw()
    found.combinations.clear()


def assembled(finished: Finished, start: str, notes: list[str]) -> Identified:
    fit, spread, disturbances = finished.fit, finished.spread, finished.disturbances
    problem = fit.problem
    parameters = {key: Estimate.fixed(problem.given[key], unit) for key, unit in GIVEN.items()}
    cures: dict[str, list[str]] = {}
    relative: dict[str, float] = {}
    for i, p in enumerate(problem.parameters):
        value = fit.values[p.key]
        if p.acts == 'reading':
            continue
        if p.key in problem.fixed:
            parameters[p.key] = Estimate.fixed(value, p.unit)
            continue
        if p.key == 'u0':
            parameters[p.key] = _u0(value, finished.gaps if _known(parameters.get('b1_Nm')) else [])
            if not _told_by_no_log(parameters, notes) and parameters[p.key].status != 'identified':
                cures.setdefault(p.cure, []).append(p.key)
            continue
        sd = float(np.sqrt(np.maximum(spread.covariance[i, i], 0.0))) * float(fit.scale[i])
        relative[p.key] = sd / max(abs(value), 1e-300)
        reach = intervals.WIDTH * sd
        estimate = Estimate(value, max(value - reach, p.least), min(value + reach, p.most), 'identified', p.unit)
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
    for wheel, slots in problem.slots.items():
        parameters[f'{wheel}_encoder_slot_error_counts'] = Estimate.normal(slots.error_counts, slots.sd_counts, '1')
        notes.append(f'every second edge of the {wheel} encoder comes late by {slots.error_counts:.2g} of a count')
    if problem.pwm_steps:
        notes.append(f"the board gives duties in {problem.pwm_steps} steps; the logs' own were rounded to them before the fit")
    if problem.jitter_s > 0.0:
        notes.append(f'the encoders were read {1e6 * problem.jitter_s:.2g} us early or late (standard deviation); the intervals '
                     'count with it, and would be narrower with the true times in a column sample_time_s')
    combinations: dict[str, Estimate] = {}
    for name, (unit, parts, cure) in COMBINATIONS.items():
        if any(part not in parameters for part in parts):
            continue
        value, sd = intervals.combination(fit, spread, name)
        worst = max(relative.get(part, 0.0) for part in parts)
        if worst <= UNCERTAIN_PART or 3 * sd > worst * abs(value):
            continue
        combinations[name] = Estimate.normal(value, sd, unit)
        if _known(combinations[name]):
            apart = _run(cure, problem, 'to part them, ')
            joined = ' and '.join((', '.join(parts[:-1]), parts[-1]))
            notes.append(f'{joined} are known better together, as {name} = {value:.5g} {unit}{apart}')
    wanted = [f'the logs do not tell {", ".join(keys)}{_run(cure, problem)}' for cure, keys in cures.items() if cure]
    notes += wanted
    if disturbances is not None:
        notes.append(f'the rig wanders ({disturbances}); the intervals count with it')
    return Identified(problem.form.name, start, parameters, combinations, fit.rms_counts, disturbances, notes,
                      list(problem.logs), fit, spread, wanted=wanted)


def _run(cure: str, problem: Problem, why: str = '') -> str:
    """The end of a note: what to run of the experiments that `cure` names, or that all of them were run."""
    run = {log.experiment for log in problem.logs}
    named = [word for word in cure.split() if word in EXPERIMENTS]
    missing = [name for name in named if name not in run]
    if named and not missing:
        return f'; {cure} is among the logs and did not suffice; the report says what to run next'
    return f'; {why}run: {cure if len(missing) == len(named) else " and ".join(missing)}'


def _told_by_no_log(parameters: dict[str, Estimate], notes: list[str]) -> bool:
    """Whether the brake's line crosses zero above the least u0 that the logs allow. Wherever u0 lies below that duty, the
    brake gives nothing there, so the crossing is as good a u0 as any: it is taken."""
    u0, slope, offset = parameters['u0'], parameters.get('b1_Nm'), parameters.get('b2_Nm')
    if not (_known(slope) and _known(offset)) or u0.status == 'fixed' or u0.low is None or u0.high is None:
        return False
    crossing = math.ceil(-offset.value / slope.value * 1e6) / 1e6  # rounded up: the map is not negative there
    if not u0.low < crossing <= u0.high or u0.status == 'identified':
        return False
    u0.value = crossing
    notes.append(f'up to a duty of {crossing:.4g} the brake\'s map b1_Nm u + b2_Nm is negative and the brake gives nothing, so no '
                 'log tells where below it u0 lies; u0 is that duty here, which changes no torque')
    return True


def _no_rate_limit(fit: Fit, notes: list[str], cures: dict[str, list[str]]) -> Estimate:
    """The logs show none: 0, the lag alone. A larger one than the logs' fastest change cannot be seen."""
    problem = fit.problem
    if RATE_LIMIT.key in problem.fixed:
        return Estimate.fixed(problem.fixed[RATE_LIMIT.key], RATE_LIMIT.unit)
    if not any(log.brake_pwm.any() for log in problem.logs):
        cures.setdefault(RATE_LIMIT.cure, []).append(RATE_LIMIT.key)
        return Estimate(0.0, None, None, 'not-identifiable', RATE_LIMIT.unit)
    notes.append(f'the logs show no limit of the brake\'s rate; one above {choices.fastest_Nm_s(fit, problem.logs):.3g} N m/s '
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
        eccentricity_rad, sd_rad, phase_rad, phase_sd_rad = intervals.disc(finished.fit, finished.spread, wheel)
        e = out[name] = Estimate.normal(eccentricity_rad, sd_rad, 'rad')
        e.low = max(0.0, eccentricity_rad - intervals.WIDTH * sd_rad)
        phase = f'{wheel}_encoder_phase_rad'
        if phase_rad is None:
            out[phase] = Estimate(0.0, None, None, 'not-identifiable', 'rad')
            notes.append(f'the {wheel} encoder is eccentric, but its counter began at another place of the disc in each log: so '
                         'no phase is known, and [model] leaves the eccentricity out; control.observer.learn_eccentricity_s '
                         'learns it before a braking')
        else:
            out[phase] = Estimate.normal(phase_rad, phase_sd_rad, 'rad', _known(e))
    return out


def _known(estimate: Estimate | None) -> TypeGuard[Estimate]:
    return estimate is not None and estimate.status in ('identified', 'fixed')


def _u0(value: float, gaps: list[tuple[float, float, float]]) -> Estimate:
    """From the first to the last gap between duties that is not less likely than the best by 95 %: identified if smaller and
    larger values are, bounded if one of them is. Without the brake's line, which tells what a duty does, there are no gaps."""
    least = min((gap[2] for gap in gaps), default=0.0) + intervals.LIKELY
    likely = [i for i, gap in enumerate(gaps) if gap[2] <= least] or [0]
    below, above = gaps[:likely[0]], gaps[likely[-1] + 1:]
    if not (below or above):
        return Estimate(value, None, None, 'not-identifiable', '1')
    low, high = below[-1][1] if below else gaps[0][0], above[0][0] if above else 1.0
    certain = below and above and high - low <= LARGEST_SD * value
    return Estimate(value, low, high, 'identified' if certain else 'bounded', '1')


def disagreement(fit: Fit, scores: np.ndarray | None = None) -> dict[str, float]:
    """Of each log against all of them, by its name: the score of the log alone at the joint estimate, as chi-square over its
    degrees of freedom. Empty for one log. Its variances are the filter's, for errors that are independent; or those of `scores`
    (intervals.bootstrap): where a wheel turns by nearly whole counts a row, errors follow each other."""
    out: dict[str, float] = {}
    logs = fit.problem.logs
    inverse = fit.covariance()
    joint = solved(fit, fit.normal.sum(axis=0), fit.right.sum(axis=0))
    for number, (log, Nl, nl) in enumerate(zip(logs, fit.normal, fit.right)) if len(logs) > 1 else ():
        told = fit.free & (np.diag(Nl) > LEAST_INFORMATION)
        d = 1 / np.sqrt(np.diag(Nl)[told])
        covariance = (Nl - Nl @ inverse @ Nl)[np.ix_(told, told)] * np.outer(d, d)
        values, vectors = np.linalg.eigh(covariance)
        kept = values > 1e-3  # what the log has in common with others; the rest is its own, and rounding
        if kept.any():
            along, variance = vectors.T[kept] * d, values[kept]
            if scores is not None:  # the mean of 1 / their variance's estimate is larger by draws / (draws - 2)
                variance = np.sum((along @ scores[number][told])**2, axis=1) / (scores.shape[2] - 2)
            out[log.name] = float(np.mean((along @ (nl - Nl @ joint)[told])**2 / variance))
    return out
