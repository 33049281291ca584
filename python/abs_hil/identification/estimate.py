"""abs_hil.identify: a rig's parameters from its logs."""
import dataclasses
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..core import _core
from ..options import PathLike, options
from ..run import Run, names_apart, stretches
from . import choices, intervals, structure
from .fit import ROUNDS, disturbed_fit, finish_fit, likely_u0, search_u0, start_fit
from .found import LARGEST_DISAGREEMENT, Finished, Identified, assembled, disagreement, interrupted, leave_form_open, refuse
from .linear import run_filter, step
from .logs import Log, load_log, motion_of
from .parameters import ALL_FORMS, FORMS, WHEELS, checked_keys
from .problem import DISTURBANCES, LARGEST_QUIET_RMS, QUIET, Fit, Problem

#: the wheels' radii differ by less than this factor: further from 1, the wheels did not roll on each other
LARGEST_RATIO = 1.5
#: the disturbances take up what the model lacks, so a fit that follows the logs has 0.3 counts RMS also on a rig that wanders
LARGEST_RMS = 1.0
#: no motor drives a rig this fast
FASTEST_RAD_S = 2000.0
#: a fit whose last step went farther than this, in standard deviations, has not arrived
LARGEST_LAST_STEP = 5.0
#: friction, brake and motor of no rig wander this far; what else the model or the logs lack does
LARGEST_WANDER = 0.1
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

    fits: list[Fit] = []
    begun: list[Fit] = []
    forms = FORMS if FORMS[start_form].settings['plant.load'] == given['load'] else {
        one.name: one for one in ALL_FORMS if one.settings['plant.load'] == given['load']}
    for tried in forms.values() if form == 'auto' else (forms[form],):
        say(f'{tried.meaning}: first values')
        problem = Problem.of(tried, start, loaded, fix, drift, WHEELS)
        if not any(problem.segments):
            upper, lower = np.max([motion.speed_rad_s.max(axis=0) for motion in problem.motions], axis=0)
            raise ValueError('in no log does a wheel turn for long enough (0.2 s above 10 rad/s): with '
                             f'{counts_per_rev} counts per revolution the upper wheel reaches {upper:.3g} rad/s, the lower one '
                             f'{lower:.3g}; are the counts of another unit?')
        try:
            begun.append(start_fit(problem, values, check, begun[0] if begun else None))
            # Each form for itself: one that cannot follow the logs may take a limit for a remedy.
            fits.append(choices.started(begun[-1], check))
        except (ValueError, np.linalg.LinAlgError) as error:
            notes.append(f'{tried.meaning}: cannot be fitted ({error})')
    if not fits:
        raise ValueError(f'no form of the plant can be fitted to these logs: {"; ".join(notes[-2:])}')
    fit, decided = (fits[0], True) if len(fits) == 1 else choices.better_form(fits, start_form, check, say, notes)
    try:
        finished = _likelier([fit, *(one for one in fits if one is not fit)], seed, say, check)
    except KeyboardInterrupt:
        return interrupted(fit, str(start), notes)
    of_logs = list(notes)
    found = assembled(finished, str(start), notes)
    found.disagreement = disagreement(finished.fit)
    if why := _doubt(found, finished):
        causes = finished.causes or finished.hidden
        off = (causes[0].cause.acts if causes else
               DISTURBANCES[int(np.argmax(finished.disturbances.sd[:3]))] if finished.disturbances is not None else '')
        refuse(found, why, of_logs, not decided or (form == 'auto' and off in AT_THE_CONTACT))
    elif not decided:
        leave_form_open(found)
    return found


def _doubt(found: Identified, finished: Finished) -> str:
    """Why the logs do not fit this plant; empty if they do."""
    if finished.causes:
        return structure.sentence(finished.causes, finished.fit)
    if found.residual_counts_rms > LARGEST_RMS:
        return (f'the model does not follow the logs: residual {found.residual_counts_rms:.3g} counts RMS, at most '
                f'{LARGEST_RMS:g} is expected even of a rig that wanders')
    odd = max(found.disagreement, key=lambda name: found.disagreement[name], default='')
    hidden = f'{structure.sentence(finished.hidden, finished.fit)}. If that is not it: ' if finished.hidden else ''
    factor = max(found.disturbances.sd[:3]) if found.disturbances is not None else 0.0
    if found.disturbances is not None and found.fit.last_step > LARGEST_LAST_STEP:
        return 'the fit does not settle: the logs tell too little, or the model does not follow them'
    if factor > LARGEST_WANDER:
        return (f'{hidden}the logs disagree{f", {odd} most" if odd else ""}: only a rig that wanders by {100 * factor:.2g} % '
                'would explain them with one set of parameters. Are they of one rig, and of one state of its brake and tyre?')
    if found.disagreement.get(odd, 0.0) > LARGEST_DISAGREEMENT:
        return (f'{hidden}the logs disagree: {odd} most (chi-square per degree of freedom {found.disagreement[odd]:.3g}, '
                'expected 1); is it of another rig, has something changed between the logs, or is the brake weaker in some of '
                'them (--drift brake_torque)?')
    return ''


def _finished(fit: Fit, seed: int, say: Callable[[str], None], check: Callable[[], None]) -> Finished:
    say(f'{fit.problem.form.meaning}: fit')
    # Without disturbances a fit to the logs of a rig that wanders may go anywhere: the other one begins where this one does.
    undisturbed = _undisturbed(fit.copy(), check, say)
    if undisturbed is None or (left := _left_by(undisturbed)):
        say(f'{left if undisturbed else "no fit without disturbances"}: the rig wanders, or the model lacks something')
        try:
            fit, first_causes, cost = _explained_first(fit, check, say)
            fit = disturbed_fit(fit, check, say)
            limited = choices.started(fit, check)
            fit = fit if limited is fit else disturbed_fit(limited, check, say)
            while (found := structure.explained(fit, fit.disturbances, check, say))[0] is not fit:
                fit = disturbed_fit(found[0], check, say)
            causes = found[1]
            if first_causes and any(one.cause is first_causes[0].cause for one in causes):
                causes = first_causes  # surer
        except (ValueError, np.linalg.LinAlgError) as error:
            raise ValueError(f'the fit does not converge: these logs are not of a rig that the plant describes ({error})'
                             ) from None
        disturbances = fit.disturbances
    else:
        fit, disturbances, causes, first_causes, cost = undisturbed, QUIET, [], [], 0.0
    if not np.isfinite(fit.rms_counts):
        raise ValueError('the fit does not converge: these logs are not of a rig that the plant describes')
    fit = choices.settle(fit, disturbances, check)
    fit, round_discs = intervals.settle_discs(fit, disturbances, check)
    gaps = likely_u0(fit, disturbances, check)
    say('intervals')
    if disturbances is QUIET:
        spread = intervals.bootstrap(fit, seed, check=check)
    else:
        spread = intervals.information(fit, structure.unsettled(fit, disturbances))
    return Finished(fit, spread, gaps, None if disturbances is QUIET else disturbances, round_discs, causes, first_causes, cost)


def _left_by(undisturbed: Fit) -> str:
    """What says that more than the counts' steps disturbed the rig; empty if nothing does."""
    if not undisturbed.rms_counts <= LARGEST_QUIET_RMS:
        return f'residual {undisturbed.rms_counts:.3g} counts RMS'
    most = max(disagreement(undisturbed).values(), default=0.0)
    return f'the logs disagree (chi-square per degree of freedom up to {most:.3g})' if most > LARGEST_DISAGREEMENT else ''


def _likelier(fits: Sequence[Fit], seed: int, say: Callable[[str], None], check: Callable[[], None]) -> Finished:
    """The first form if it needs no cause which the plant lacks, or one that nothing but the counts' steps disturbs. Else the
    form that is likelier with its surest cause: the disturbances of a wrong form may hide every cause."""
    done: list[Finished] = []
    failed = ''
    for fit in fits:
        try:
            done.append(_finished(fit, seed, say, check))
        except ValueError as error:
            failed = failed or str(error)
            continue
        if not done[-1].causes and (len(done) == 1 or done[-1].disturbances is None):
            return done[-1]
    if not done:
        raise ValueError(failed)
    return min(done, key=lambda one: one.cost)


def _explained_first(fit: Fit, check: Callable[[], None], say: Callable[[str], None]) -> tuple[Fit, list[structure.Found], float]:
    """The fit with the flaws that it shows while small disturbances are allowed: those that the likelihood asks
    for would take the flaws up. With the causes that are left, and -2 log likelihood with the surest of them."""
    disturbances = ROUNDS[1][0]
    near = choices.without(fit)  # a limit that was found may stand for a flaw
    for _ in range(3):
        step(near, disturbances, check)
    if search_u0(near, disturbances, 0.01, 9, check):
        step(near, disturbances, check)
    if not near.rms_counts <= LARGEST_RMS:
        return fit, [], np.inf  # too far off to tell anything
    flawed, left = structure.explained(near, disturbances, check, say)
    if flawed is not near:
        flawed, left = structure.explained(choices.started(flawed, check), disturbances, check, say)
    cost = run_filter(flawed, disturbances)[0] - (left[0].sure**2 if left else 0.0)
    return (fit if flawed is near else flawed), left, cost


def _undisturbed(fit: Fit, check: Callable[[], None], say: Callable[[str], None]) -> Fit | None:
    """The fit as if nothing disturbed the rig but the counts' steps; None if it ends nowhere."""
    try:
        fit = choices.with_delay(finish_fit(fit, check), check, say)
        if fit.rms_counts <= LARGEST_QUIET_RMS:
            limited = choices.sought(fit, QUIET, check)
        else:
            near = fit.copy()
            step(near, ROUNDS[-1][0], check)
            limited = choices.started(near, check)
            limited = fit if limited is near else limited
        return fit if limited is fit else finish_fit(limited, check)
    except (ValueError, np.linalg.LinAlgError):
        return None


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
