"""What identification writes: identified.json, model.toml, and a run that it predicts."""
import datetime
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import scipy.signal

from ..core import _core
from ..options import PathLike, options
from ..recording import load
from ..run import Run
from ..simulation import simulate
from .found import Estimate, Identified
from .intervals import WIDTH
from .logs import Log
from .parameters import DELAY, FORMS, WHEELS, Form
from .speeds import SpeedsFound
from .traces import Trace

#: keys of a run's configuration that say what the run did, not on what it ran
_DOING = ('control.', 'experiment.', 'observer.', 'gate.')
#: rigs that a prediction's interval comes from; a rig repeats its stop, with other places of the discs, to this share of it; and a
#: run so many times as far off as the interval reaches is of another rig
DRAWN = 16
REPEATS = 5e-3
CLEARLY = 2.0
#: a factor that wanders holds for so long, and a run lasts so long at most
WANDER_S = 0.1
LONGEST_S = 40.0
#: a run's gate.* belongs to its board where it names board limits
_LEFT_OUT = ('gate.brake_duty_max', 'gate.motor_duty_max')
#: of a form with the maker's curve or lever, what no log tells
_OF_THE_START = ('mu_w2', 'lever_L_m', 'lever_phi_deg')


def _json(found: Identified | SpeedsFound, parameters: Mapping[str, Estimate], form: str, **more: Any) -> dict[str, Any]:
    rows = {name: {'value': e.value, 'low': e.low, 'high': e.high, 'status': e.status} for name, e in parameters.items()}
    return {'parameters': rows, 'form': form, 'start': found.start, **more, 'misfit': found.misfit or None, 'notes': found.notes,
            'version': _core.version, 'date': datetime.date.today().isoformat()}


def as_json(found: Identified) -> dict[str, Any]:
    told = {name: e for name, e in {**found.parameters, **found.combinations}.items() if not found.refused or e.status == 'fixed'}
    return _json(found, told, 'undecided' if found.undecided else found.form,
                 residual_counts_rms=found.residual_counts_rms, validation=found.validation,
                 disturbances=None if found.disturbances is None else {
                     'sd': found.disturbances.sd.tolist(), 'time_constant_s': float(found.disturbances.time_constant_s[0])},
                 logs=[{'name': log.name, 'path': str(log.path), 'sha256': log.sha256, 'rows': len(log),
                        'duration_s': float(log.time_s[-1] - log.time_s[0]),
                        'disagreement': found.disagreement.get(log.name)} for log in found.logs])


def speeds_as_json(found: SpeedsFound) -> dict[str, Any]:
    return _json(found, {} if found.misfit else found.parameters, found.form.name, traces=[
        {'name': trace.name, 'path': str(trace.path), 'sha256': trace.sha256, 'readings': trace.keys,
         'left': [{'channel': kind, 'rms': rms, 'unit': unit} for name, kind, rms, unit in found.left if name == trace.name]}
        for trace in found.traces])


def speeds_as_toml(found: SpeedsFound) -> str:
    """As `as_toml`. What is not estimated is the start's."""
    plant = []
    for key, value in _core.PlantOptions(options(plant=found.start)).values().items():
        text = _number(found.plant.get(key, value)) if isinstance(value, float) else json.dumps(value)
        plant.append(_line(key, found.parameters[key]) if key in found.parameters else f'{key} = {text}')
    tyre = {} if found.form is FORMS['magic-formula'] else equivalent_tyre(found.base, found.plant)
    return _file(f'all else is that of the start, {_comment(found.start)}', found.traces, found.notes, found.form, plant,
                 [f'{key} = {_number(value)}' for key, value in tyre.items()])


def as_toml(found: Identified) -> str:
    """The content of model.toml: a plant's file, which --model and --plant load."""
    form = found.fit.problem.form
    base = found.fit.problem.base.values()
    plant = [f'{key.removeprefix("plant.")} = "{value}"' for key, value in form.settings.items()]
    plant += [_line(key, e) for key, e in found.parameters.items() if key in base and not key.startswith('brake_factor')]
    plant.append(f'encoder_counts_per_rev = {base["encoder_counts_per_rev"]}')
    if form is not FORMS['magic-formula']:
        plant += [f'{key} = {_number(base[key])}  # of the start, {_comment(found.start)}' for key in _OF_THE_START]
    return _file(f'residual {found.residual_counts_rms:.4f} counts RMS (0.2887 if nothing but the counts disturbs)', found.logs,
                 found.notes, form, plant, [*_believed(found)])


def _line(key: str, e: Estimate) -> str:
    return f'{key} = {_number(e.value)}  # {e.unit}: ' + ', '.join(filter(None, (e.status, shown(e)[1])))


def _file(about: str, sources: Sequence[Log] | Sequence[Trace], notes: list[str], form: Form, plant: list[str],
          model: list[str]) -> str:
    today = datetime.date.today().isoformat()
    lines = [f'# Identified by abs_identify {_core.version} on {today}: value, then status and interval of 95 %;', f'# {about}.',
             *(f'# {_comment(one.name)}: sha256 {one.sha256}' for one in sources), *(f'# {_comment(note)}' for note in notes), '',
             f'description = {json.dumps(f"identified from {len(sources)} records on {today}: {form.meaning}")}',
             f'identified = {today}', '', '[plant]', *plant, *(['', '[model]', *model] if model else [])]
    return '\n'.join(lines) + '\n'


def _believed(found: Identified) -> Iterator[str]:
    """Lines of the table [model]: where controllers believe something else than the plant."""
    if found.fit.problem.form is not FORMS['magic-formula']:
        yield "# What controllers believe of the tyre: the magic formula nearest to the plant's force in braking."
        tyre = equivalent_tyre(found.fit.problem.base, found.values())
        yield from (f'{key} = {_number(value)}' for key, value in tyre.items())
    for wheel in WHEELS:
        phase = found.parameters.get(f'{wheel}_encoder_phase_rad')
        if phase is not None and phase.status != 'identified':
            yield "# Counters begin anew at another place of the disc: without its phase the eccentricity is no help."
            yield f'{wheel}_encoder_eccentricity_rad = 0.0'


def _number(value: float) -> str:
    text = repr(float(value))
    return text if any(c in text for c in '.en') else text + '.0'


def _comment(text: str) -> str:
    """Text from a file in a comment: one line without control characters."""
    return ''.join(c if c.isprintable() else '?' for c in text)


#: where the curves of two tyres are compared
SLIP = np.linspace(0.005, 0.6, 120)


def braking_force_N(base: Any, values: Mapping[str, float]) -> np.ndarray:
    """The tyre's force of the plant `base` with these values while the brake holds the wheel at each SLIP."""
    omega2 = np.full(SLIP.shape, 100.0)
    r1 = values['r1_m']
    omega1 = omega2 * values['r2_m'] / r1 * (1 - SLIP)
    force = np.zeros(SLIP.shape)
    for _ in range(8):  # the lever's load grows with the brake's torque
        force = np.asarray(_core.tyre_forces_N(base, list(values.items()), omega1, omega2, np.maximum(0.0, r1 * force)))
    return force


def equivalent_tyre(base: Any, values: Mapping[str, float]) -> dict[str, float]:
    """theta_N, B and C of the magic formula whose force is nearest to that of the plant `base` with these values."""
    import scipy.optimize
    force = braking_force_N(base, values)
    fit = scipy.optimize.least_squares(lambda x: x[0] * np.sin(x[2] * np.arctan(x[1] * SLIP)) - force,
                                       (float(force.max()), 25.0, 1.5), bounds=((0.1, 1.0, 0.8), (499.0, 199.0, 2.0)))
    return {'theta_N': float(fit.x[0]), 'B': float(fit.x[1]), 'C': float(fit.x[2])}


def plant_settings(found: Identified) -> dict[str, Any]:
    """--set for the identified plant."""
    base = found.fit.problem.base.values()
    settings: dict[str, Any] = dict(found.fit.problem.form.settings)
    settings.update({f'plant.{key}': value for key, value in found.values().items() if key in base})
    settings['plant.encoder_counts_per_rev'] = base['encoder_counts_per_rev']
    if found.fit.problem.form is not FORMS['magic-formula']:
        settings.update({f'plant.{key}': base[key] for key in _OF_THE_START})
    return settings


def validating(folder: PathLike) -> Run:
    """The run of a folder. Raises ValueError for one whose configuration is unknown or that did not stop."""
    run = load(folder)
    if not run.config or run.summary.get('stop_distance_m') is None:
        raise ValueError(f'--validate "{folder}": a run that validates needs its summary.json, with a stop')
    return run


def validate(found: Identified, run: Run) -> dict[str, Any]:
    """Simulates a run of `validating` on the identified plant, with its own controller and model, and compares where and when
    both stop. The predictions' intervals come from rigs drawn from the estimates, which wander as the logs' rig does.

    A run that lies clearly outside of its interval is of another rig or state: `misfit` then says so."""
    config = run.config
    settings = {key: value for key, value in config.items() if key.startswith(_DOING) and key not in _LEFT_OUT}
    known = {row['name'] for row in _core.keys(options())}
    for part in ('plant.', 'model.'):  # what the controllers believed, and not the plant that is identified
        settings.update({f'model.{key.removeprefix(part)}': value for key, value in config.items() if key.startswith(part)})
    settings.update(plant_settings(found))
    settings = {key: value for key, value in settings.items() if value is not None and key in known}
    random = np.random.default_rng(1)

    def stop(more: Mapping[str, Any]) -> dict[str, Any]:
        return simulate(controller=str(run.summary.get('controller', 'adaptive')),
                        experiment=str(run.summary.get('experiment', 'paper')), set={**settings, **more}).summary
    predicted, drawn = stop({}), [stop(_drawn(found, random)) for _ in range(DRAWN)]
    out: dict[str, Any] = {'run': str(run.folder)}
    apart = []
    for name, unit in (('stop_distance_m', 'm'), ('stop_time_s', 's')):
        measured, simulated = run.summary.get(name), predicted.get(name)
        others = [one[name] for one in drawn if one.get(name) is not None]
        out[name], out[f'predicted_{name}'], out[f'{name}_error'], out[f'{name}_interval'] = measured, simulated, None, None
        if measured and simulated is not None and others:
            reach = WIDTH * float(np.hypot(np.std([*others, simulated]), REPEATS * simulated))
            out[f'{name}_error'], out[f'{name}_interval'] = simulated / measured - 1, [simulated - reach, simulated + reach]
            if abs(measured - simulated) > CLEARLY * reach:
                apart.append(f'{name} is {measured:.4g} {unit}, predicted {simulated:.4g} ({simulated - reach:.4g} to '
                             f'{simulated + reach:.4g})')
        elif measured:
            apart.append(f'{name} is {measured:.4g} {unit}, and the identified plant does not stop')
    out['misfit'] = (f'"{run.folder}" is of another rig, or of another state of this one: {" and ".join(apart)}' if apart else '')
    return out


def _drawn(found: Identified, random: np.random.Generator) -> dict[str, Any]:
    """--set for a rig of the estimates' distribution, whose friction, brake and motor wander as the fit found it."""
    fit = found.fit
    x = random.multivariate_normal(np.zeros(len(fit.scale)), found.spread.covariance, check_valid='ignore')
    values = {p.key: float(np.clip(fit.values[p.key] + scale * at, p.least, p.most))
              for p, scale, at in zip(fit.problem.parameters, fit.scale, x)}
    settings: dict[str, Any] = {f'plant.{key}': values[key] for key in found.parameters if key in values and key != DELAY
                                and not key.startswith('brake_factor')}
    if found.disturbances is not None:
        keeps = np.exp(-WANDER_S / found.disturbances.time_constant_s[0])
        for name, sd in zip(('friction', 'brake_torque', 'motor_torque'), found.disturbances.sd):
            noise = np.sqrt(1.0 - keeps**2) * random.standard_normal(int(LONGEST_S / WANDER_S))
            factors = 1.0 + sd * scipy.signal.lfilter([1.0], [1.0, -keeps], noise)
            settings[f'plant.{name}_profile'] = 'time: 1; ' + '; '.join(
                f'{factor:.6f} from {i * WANDER_S:g} to {(i + 1) * WANDER_S:g}' for i, factor in enumerate(factors))
    return settings


def shown(e: Estimate) -> tuple[str, str]:
    """(value, interval) with as many digits as the interval has to say; the interval is empty if there is none."""
    if e.low is None or e.high is None or e.status == 'fixed' or not e.high > e.low:
        return f'{e.value:.6g}', ''
    digits = 2 + max(1, math.ceil(math.log10(max(abs(e.value), e.high - e.low) / (e.high - e.low))))
    return f'{e.value:.{digits}g}', f'{e.low:.{digits}g} to {e.high:.{digits}g}'


def words(rows: Mapping[str, Estimate]) -> list[str]:
    width = max(len(name) for name in rows)
    return ['{:{}}  {:14}  {:34}  {}'.format(name, width, *shown(e), e.status) for name, e in rows.items()
            if name != DELAY or e.value != 0.0]
