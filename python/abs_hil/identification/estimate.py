"""abs_hil.identify: a rig's parameters from its logs.

The way of a fit: first values (start.py), both forms of tyre and load side by side down to disturbances of 0.1 % (choices.py),
then down to none (fit.py). With the residual's root mean square R over n readings (by weight), in counts,

    R^2 <= (1 + 4 * 0.894 / sqrt(n)) / 12      within four standard deviations of what the counts' steps leave (problem.py)

nothing but these steps is left, and intervals follow (intervals.py). If more is left, duties as a board rounds them are tried,
then flaws that the brake may have (structure.py), then a rig that wanders. Nothing is said of the rig by a fit that is not at
rest (last step of at least one standard deviation) or leaves more than a count.
"""
import contextlib
import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..core import _core
from ..options import PathLike, options
from ..run import Run, names_apart, stretches
from . import choices, intervals, structure
from .fit import COMPARED, RESTS, disturbed_fit, finish_fit, level, likely_u0, search_u0, start_fit
from .found import LARGEST_DISAGREEMENT, Finished, Identified, assembled, disagreement, interrupted, leave_form_open, refuse
from .linear import keep_normals, run_filter, to_rest
from .logs import Log, load_log, motion_of
from .parameters import ALL_FORMS, FORMS, RATE_LIMIT, WHEELS, checked_keys
from .problem import DISTURBANCES, QUIET, Fit, Problem, residuals

#: the wheels' radii differ by less than this factor: further from 1, the wheels did not roll on each other
LARGEST_RATIO = 1.5
#: the disturbances take up what the model lacks, so a fit that follows the logs has 0.3 counts RMS also on a rig that wanders
LARGEST_RMS = 1.0
#: no motor drives a rig this fast
FASTEST_RAD_S = 2000.0
#: the disturbances at which causes are looked for first: those that the likelihood asks for would take them up
SMALL = level(0.01)
#: friction, brake and motor of no rig wander this far; what else the model or the logs lack does
LARGEST_WANDER = 0.1
#: the logs' mean disagreement by chance, at most
CHANCE = 2.0
#: what acts there and does not fit leaves the form of the tyre open
AT_THE_CONTACT = ('road', 'r1_m')


def identify(logs: Sequence[PathLike | Run | Log], start: PathLike = 'paper-table1', *,
             fix: Mapping[str, float | None] | None = None, drift: Sequence[str] = (), form: str = 'auto', seed: int = 1,
             say: Callable[[str], None] = lambda _: None, check: Callable[[], None] = lambda: None) -> Identified:
    """Estimates the rig's parameters from logs of counts and duties.

    logs:  runs of `simulate` or `load`, run folders, event logs or CSV files (see load_log), or Log objects
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
    checked_keys(fix, start)
    if seed < 0:
        raise ValueError(f'seed {seed}: give a whole number of at least 0')
    if form != 'auto' and form not in FORMS:
        raise ValueError(f'form {form}: give auto, {" or ".join(FORMS)}')
    for name in drift:
        if name != 'brake_torque':
            raise ValueError(f'--drift {name}: no such drift; give brake_torque')
    loaded = [log if isinstance(log, Log) else load_log(log) for log in logs]
    loaded = [dataclasses.replace(log, name=name) for log, name in zip(loaded, names_apart(log.name for log in loaded))]
    if not loaded:
        raise ValueError('give at least one log')
    notes = [note for log in loaded for note in log.notes]
    given = _core.PlantOptions(options(plant=start)).values()
    start_form = str(given['tyre'])
    values = {k: v for k, v in given.items() if isinstance(v, float)}
    values.update({key: number for key, number in fix.items() if number is not None})
    counts_per_rev = int(given['encoder_counts_per_rev'])
    _refuse_odd(loaded, values, counts_per_rev)

    begun: list[Fit] = []
    forms = FORMS if FORMS[start_form].settings['plant.load'] == given['load'] else {
        one.name: one for one in ALL_FORMS if one.settings['plant.load'] == given['load']}
    for tried in forms.values() if form == 'auto' else (forms[form],):
        say(f'{tried.meaning}: first values')
        problem = dataclasses.replace(Problem.of(tried, start, loaded, fix, drift, WHEELS), say=say, check=check)
        if not any(problem.segments):
            upper, lower = np.max([motion.speed_rad_s.max(axis=0) for motion in problem.motions], axis=0)
            raise ValueError('in no log does a wheel turn for long enough (0.2 s above 10 rad/s): with '
                             f'{counts_per_rev} counts per revolution the upper wheel reaches {upper:.3g} rad/s, the lower one '
                             f'{lower:.3g}; are the counts of another unit?')
        try:
            begun.append(start_fit(problem, values, begun[0] if begun else None))
        except (ValueError, np.linalg.LinAlgError) as error:
            notes.append(f'{tried.meaning}: cannot be fitted ({error})')
    if not begun:
        raise ValueError(f'no form of the plant can be fitted to these logs: {"; ".join(notes[-2:])}')
    fits, decided = choices.better_form(begun, start_form, notes)
    try:
        finished = _likelier(fits, seed)
    except KeyboardInterrupt:
        return interrupted(fits[0], str(start), notes)
    of_logs = list(notes)
    found = assembled(finished, str(start), notes)
    of_all = finished.fit.copy()
    if finished.disturbances is not None:  # to disagree by less is no reason to refuse a rig
        keep_normals(of_all, run_filter(of_all, finished.disturbances.at_least())[1])
    found.disagreement = disagreement(of_all, finished.spread.scores)
    if why := finished.misfit or _doubt(found, finished.fit):
        causes = finished.causes
        off = (causes[0].cause.acts if causes else
               DISTURBANCES[int(np.argmax(finished.disturbances.sd[:3]))] if finished.disturbances is not None else '')
        open_form = off in AT_THE_CONTACT or not finished.fit.last_step < RESTS
        refuse(found, why, of_logs, not decided or (form == 'auto' and open_form))
    elif not decided:
        leave_form_open(found)
    return found


def _wanders_too_far(fit: Fit, odd: str = '') -> str:
    """Says so of a fit that needs such a rig; empty if it does not. odd: the log that disagrees most."""
    factor = max(fit.disturbances.sd[:3])
    return '' if factor <= LARGEST_WANDER else (
        f'the fit did not get there, or the logs are not of one rig{f", {odd} most" if odd else ""}: with one set of parameters '
        f'only a rig that wanders by {100 * factor:.2g} % would explain them. Nothing is said of the rig')


def _doubt(found: Identified, fit: Fit) -> str:
    """Why the logs do not fit each other; empty if they do."""
    odd = max(found.disagreement, key=lambda name: found.disagreement[name], default='')
    if far := _wanders_too_far(fit, odd):
        return far
    if found.disagreement.get(odd, 0.0) > LARGEST_DISAGREEMENT:
        return (f'the model lacks something, or not all logs are of one rig in one state: the logs disagree, {odd} most '
                f'(chi-square per degree of freedom {found.disagreement[odd]:.3g}, expected 1). If the brake was weaker in some '
                'of them, give --drift brake_torque')
    return ''


def _likelier(fits: Sequence[Fit], seed: int) -> Finished:
    """The first form that follows the logs without disturbances, else the first that needs nothing which the plant lacks, else the
    first."""
    near: list[Fit] = []
    for fit in fits:
        fit.problem.say(f'{fit.problem.form.meaning}: fit')
        if (quiet := _quiet(fit, near)) is not None:
            return _settled(quiet, seed)
    done: list[Finished] = []
    failed = ''
    for fit in fits:
        try:
            done.append(_explained(fit, seed, near))
        except (ValueError, np.linalg.LinAlgError) as error:
            failed = failed or f'the fit does not converge: these logs are not of a rig that the plant describes ({error})'
        if done and (not done[-1].misfit and (len(done) == 1 or done[-1].disturbances is None)):
            return done[-1]
    if not done:
        raise ValueError(failed)
    if done[0].misfit and near:  # what another fit lacks says nothing then
        done[0].misfit, done[0].causes = _not_there(near[0]), []
    return done[0]


def _quiet(fit: Fit, near: list[Fit] | None = None) -> Fit | None:
    """The fit as if nothing disturbed the rig but the counts' steps, if it follows the logs so: as it is, or with duties as a
    board gives them; with late inputs and a limit of the brake's rate where the logs show them. Of duties that no board gives
    as they are, the likeliest rounding counts: it may be too little to be seen in the residual, and yet move the parameters.
    near: gets a fit that follows the logs and does not rest."""
    stopped = 0.0
    best = None
    for takes_up, tried in itertools.chain([(np.inf, fit)], choices.with_steps(fit)):
        if stopped > takes_up:
            continue
        try:
            found = finish_fit(tried.copy()) if tried is not fit or fit.may_follow else fit
            stopped = stopped or float(found.disturbances.sd[0])
            for remedy in (choices.with_delay, choices.sought):
                if (more := remedy(found)) is not found and finish_fit(more).follows:
                    found = more
        except (ValueError, np.linalg.LinAlgError):
            continue
        if near is not None and found.follows and not found.last_step < RESTS:
            near.append(found)
        if left := _left_by(found):
            fit.problem.say(left)
        elif any(choices.are_given_in(fit, steps) for steps in choices.PWM_STEPS):
            return found
        elif best is None or found.cost.sum() < best.cost.sum():
            best = found
    return best


def _settled(quiet: Fit, seed: int) -> Finished:
    quiet, round_discs = intervals.settle_discs(choices.settle(quiet))
    gaps = likely_u0(quiet)
    quiet.problem.say('intervals')
    return Finished(quiet, intervals.bootstrap(quiet, seed), gaps, None, round_discs)


def _explained(fit: Fit, seed: int, near: list[Fit]) -> Finished:
    """The fit with the flaws that the logs show; of a rig that wanders, unless it follows the logs with them."""
    fit.problem.say(f'{fit.problem.form.meaning}: the rig wanders, or the model lacks something')
    flawed, first_causes = _flawed(fit)
    if flawed is not fit and (quiet := _quiet(flawed)) is not None:
        return _settled(quiet, seed)
    fit = disturbed_fit(flawed)
    limited = choices.sought(fit)
    fit = fit if limited is fit else disturbed_fit(limited)
    # Disturbances may lead a fit past what held it up: where hardly any are left, it may follow the logs without them.
    if max(fit.disturbances.sd[:3]) < COMPARED and (quiet := _quiet(fit, near)) is not None:
        return _settled(quiet, seed)
    while (found := structure.explained(fit, fit.disturbances))[0] is not fit:
        if (quiet := _quiet(found[0].without([RATE_LIMIT.key]))) is not None:
            return _settled(quiet, seed)
        fit = disturbed_fit(found[0])
    causes = found[1]
    if first_causes and any(one.cause is first_causes[0].cause for one in causes):
        causes = first_causes  # surer
    fit, round_discs = intervals.settle_discs(choices.settle(fit))
    gaps = likely_u0(fit)
    misfit = ''
    if not (fit.last_step < RESTS and fit.rms_counts <= LARGEST_RMS):
        misfit, causes = _not_there(fit), []
    elif causes and structure.named(causes):
        misfit = structure.sentence(causes, fit)
    elif causes and not (misfit := _wanders_too_far(fit)):
        misfit = f'the model lacks something, most in {_most_left(fit)}; no single cause explains it'
    fit.problem.say('intervals')
    # What changed between the logs by more than chance makes all of them less certain (Birge 1932).
    birge = float(np.mean([*disagreement(fit).values()] or [1.0]))
    unsure = 0.0 if misfit else structure.unsettled(fit, fit.disturbances)
    spread = intervals.information(fit, unsure, birge if birge > CHANCE else 1.0)
    return Finished(fit, spread, gaps, fit.disturbances, round_discs, causes, misfit)


def _not_there(fit: Fit) -> str:
    return (f'the fit did not get there (last step {fit.last_step:.3g} standard deviations, residual {fit.rms_counts:.3g} counts '
            f'RMS): nothing is said of the rig. Most is left in {_most_left(fit)}')


def _most_left(fit: Fit) -> str:
    """Where the model lacks most: by what is left without disturbances."""
    near = fit.copy()
    with contextlib.suppress(ValueError, np.linalg.LinAlgError):
        to_rest(near, QUIET, 3)
    left = ', '.join(f'{log}{f", phase {phase}," if phase else ""} {rms:.3g}' for rms, log, phase in residuals(near)[:3])
    return f'{left} counts RMS without disturbances'


def _left_by(quiet: Fit) -> str:
    """What says that more than the counts' steps disturbed the rig; empty if nothing does."""
    if not (quiet.follows and quiet.last_step < RESTS):
        return (f'residual at least {max(quiet.rms_counts, quiet.least_rms):.4g} counts RMS without disturbances, at most '
                f'{quiet.bound_rms:.4f} by the steps of the counts')
    most = max(disagreement(quiet).values(), default=0.0)
    return f'the logs disagree (chi-square per degree of freedom up to {most:.3g})' if most > LARGEST_DISAGREEMENT else ''


def _flawed(fit: Fit) -> tuple[Fit, list[structure.Found]]:
    """The fit with the flaws that it shows while small disturbances are allowed, if it rests there, and the causes that are left:
    the disturbances that the likelihood asks for would take them up."""
    near = fit.without([RATE_LIMIT.key])  # it may stand for a flaw
    to_rest(near, SMALL, 10, RESTS)
    if search_u0(near, 0.01, 9):
        to_rest(near, SMALL, 3, RESTS)
    if not (near.rms_counts <= LARGEST_RMS and near.last_step < RESTS):
        return fit, []  # too far off to tell anything
    flawed, left = structure.explained(near, SMALL)
    return (fit, left) if flawed is near else structure.explained(choices.sought(flawed), SMALL)


def _refuse_odd(logs: Sequence[Log], plant: Mapping[str, float], counts_per_rev: int) -> None:
    """Raises ValueError for logs whose columns cannot be what their names say, as their counts alone show."""
    for log in logs:
        for counts, name in zip(log.counts.T, ('upper_counts', 'lower_counts')):
            rows = np.flatnonzero(np.isfinite(counts))
            turned = np.diff(counts[rows])
            most = FASTEST_RAD_S * counts_per_rev / (2 * np.pi) * np.maximum(np.diff(log.time_s[rows]), log.period_s)
            if (jumps := np.flatnonzero(np.abs(turned) > most)).size:
                raise ValueError(f'"{log.path}": {name} jumps by {turned[jumps[0]]:.0f} in row {rows[jumps[0] + 1] + 1}; give '
                                 'counts that wrap at 32 bit only, and sample_valid 0 where a reading is lost')
            if turned.sum() < -counts_per_rev:
                raise ValueError(f'"{log.path}": {name} falls by {-turned.sum():.0f} from the first row to the last; give it the '
                                 'other sign, so that it rises as the car drives')
        _refuse_swapped(log, plant['r2_m'] / plant['r1_m'])
        # Without the motor no wheel becomes faster than the other one was.
        speed = motion_of(log, counts_per_rev).speed_rad_s
        for begin, end in stretches(log.motor_pwm == 0):
            lower = speed[begin:end, 1]
            if (gain := (lower - np.minimum.accumulate(lower)).max()) > max(20.0, 0.5 * speed.max()):
                raise ValueError(f'"{log.path}": the lower wheel gains {gain:.3g} rad/s while motor_pwm is 0, rows {begin + 1} to '
                                 f'{end}: brake_pwm and motor_pwm seem to be swapped')


def _refuse_swapped(log: Log, ratio: float) -> None:
    """The brake slows the upper wheel: while it acts most, the upper wheel turns less for a turn of the lower one than
    while both roll; that is about `ratio` turns."""
    strong = (log.brake_pwm > 0) & (log.brake_pwm >= 0.95 * log.brake_pwm.max())
    recent = round(0.5 / log.period_s)  # after a locked wheel, rolling takes its time
    acted = np.convolve(log.brake_pwm > 0, np.ones(recent))[:len(log)] > 0
    rolling = ~acted & (log.motor_pwm == 0)
    ratios = []
    for rows in (strong, rolling):
        together = (rows & (log.wheels_apart == 0))[:-1]
        turned = np.nansum(np.abs(np.diff(log.counts, axis=0))[together], axis=0)
        ratios.append(turned[0] / turned[1] if turned.min() > 200 else np.nan)
    cause = 'upper_counts and lower_counts seem to be swapped' if ratios[0] > 1.02 * ratios[1] else ''
    if abs(np.log(ratios[1] / ratio)) > np.log(LARGEST_RATIO):
        cause = ('the wheels seem to be apart at times (give a column wheels_apart that is 1 then and 0 otherwise), or one '
                 'encoder has another number of counts per revolution')
    if cause:
        braked = '' if np.isnan(ratios[0]) else f', but {ratios[0]:.4f} times while the brake acts'
        raise ValueError(f'"{log.path}": {cause}: the upper wheel turns {ratios[1]:.4f} times as far as the lower one '
                         f'while neither brake nor motor acts{braked}')
