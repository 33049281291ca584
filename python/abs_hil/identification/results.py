"""What identification writes: identified.json, model.toml, and a run that it predicts."""
import datetime
import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..core import _core
from ..options import PathLike, options
from ..recording import load
from ..run import Run
from ..simulation import simulate
from .found import Estimate, Identified
from .parameters import DELAY, FORMS, WHEELS

#: keys of a run's configuration that say what the run did, not on what it ran
_DOING = ('control.', 'experiment.', 'observer.', 'gate.')
#: a run's gate.* belongs to its board where it names board limits
_LEFT_OUT = ('gate.brake_duty_max', 'gate.motor_duty_max')
#: of a form with the maker's curve or lever, what no log tells
_OF_THE_START = ('mu_w1', 'mu_w2', 'mu_w3', 'lever_L_m', 'lever_phi_deg')


def as_json(found: Identified) -> dict[str, Any]:
    def row(estimate: Estimate) -> dict[str, Any]:
        return {'value': estimate.value, 'low': estimate.low, 'high': estimate.high, 'status': estimate.status}
    return {'parameters': {name: row(e) for name, e in {**found.parameters, **found.combinations}.items()},
            'residual_counts_rms': found.residual_counts_rms,
            'form': 'undecided' if found.undecided else found.form,
            'start': found.start,
            'disturbances': None if found.disturbances is None else {
                'sd': found.disturbances.sd.tolist(), 'time_constant_s': float(found.disturbances.time_constant_s[0])},
            'logs': [{'name': log.name, 'path': str(log.path), 'sha256': log.sha256, 'rows': len(log),
                      'duration_s': float(log.time_s[-1] - log.time_s[0]),
                      'disagreement': found.disagreement.get(log.name)} for log in found.logs],
            'misfit': found.misfit or None,
            'notes': found.notes,
            'validation': found.validation,
            'version': _core.version,
            'date': datetime.date.today().isoformat()}


def as_toml(found: Identified) -> str:
    """The content of model.toml: a plant's file, which --model and --plant load."""
    def line(key: str, e: Estimate) -> str:
        return f'{key} = {_number(e.value)}  # {e.unit}: ' + ', '.join(filter(None, (e.status, shown(e)[1])))

    form = found.fit.problem.form
    base = found.fit.problem.base.values()
    lines = [f'# Identified by abs_identify {_core.version} on {datetime.date.today().isoformat()}: value, then status and '
             'interval of 95 %.',
             f'# Residual {found.residual_counts_rms:.4f} counts RMS (0.2887 if nothing but the counts disturbs).']
    lines += [f'# Log {_comment(log.name)}: sha256 {log.sha256}' for log in found.logs]
    lines += [f'# {_comment(note)}' for note in found.notes]
    description = f'identified from {len(found.logs)} logs on {datetime.date.today().isoformat()}: {form.meaning}'
    lines += ['', f'description = {json.dumps(description)}', f'identified = {datetime.date.today().isoformat()}', '', '[plant]',
              *(f'{key.removeprefix("plant.")} = "{value}"' for key, value in form.settings.items())]
    lines += [line(key, e) for key, e in found.parameters.items() if key in base and not key.startswith('brake_factor')]
    lines.append(f'encoder_counts_per_rev = {base["encoder_counts_per_rev"]}')
    if found.fit.problem.form is not FORMS['magic-formula']:
        lines += [f'{key} = {_number(base[key])}  # of the start, {_comment(found.start)}' for key in _OF_THE_START]
    believed = _believed(found)
    return '\n'.join([*lines, *(['', '[model]', *believed] if believed else [])]) + '\n'


def _believed(found: Identified) -> list[str]:
    """Lines of the table [model]: where controllers believe something else than the plant."""
    lines = []
    if found.fit.problem.form is not FORMS['magic-formula']:
        lines.append("# What controllers believe of the tyre: the magic formula nearest to the plant's force in braking.")
        tyre = equivalent_tyre(found.fit.problem.base, found.values())
        lines += [f'{key} = {_number(value)}' for key, value in tyre.items()]
    for wheel in WHEELS:
        phase = found.parameters.get(f'{wheel}_encoder_phase_rad')
        if phase is not None and phase.status != 'identified':
            lines.append("# Counters begin anew at another place of the disc: without its phase the eccentricity is no help.")
            lines.append(f'{wheel}_encoder_eccentricity_rad = 0.0')
    return lines


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
    both stop."""
    config = run.config
    settings = {key: value for key, value in config.items() if key.startswith(_DOING) and key not in _LEFT_OUT}
    known = {row['name'] for row in _core.keys(options())}
    for part in ('plant.', 'model.'):  # what the controllers believed, and not the plant that is identified
        settings.update({f'model.{key.removeprefix(part)}': value for key, value in config.items() if key.startswith(part)})
    settings.update(plant_settings(found))
    settings = {key: value for key, value in settings.items() if value is not None and key in known}
    predicted = simulate(controller=str(run.summary.get('controller', 'adaptive')),
                         experiment=str(run.summary.get('experiment', 'paper')), set=settings)
    out: dict[str, Any] = {'run': str(run.folder)}
    for name in ('stop_distance_m', 'stop_time_s'):
        measured, simulated = run.summary.get(name), predicted.summary.get(name)
        out[name] = measured
        out[f'predicted_{name}'] = simulated
        out[f'{name}_error'] = simulated / measured - 1 if measured and simulated is not None else None
    return out


def shown(e: Estimate) -> tuple[str, str]:
    """(value, interval) with as many digits as the interval has to say; the interval is empty if there is none."""
    if e.low is None or e.high is None or e.status == 'fixed' or not e.high > e.low:
        return f'{e.value:.6g}', ''
    digits = 2 + max(1, math.ceil(math.log10(max(abs(e.value), e.high - e.low) / (e.high - e.low))))
    return f'{e.value:.{digits}g}', f'{e.low:.{digits}g} to {e.high:.{digits}g}'


def words(found: Identified) -> list[str]:
    rows: Mapping[str, Estimate] = {**found.parameters, **found.combinations}
    width = max(len(name) for name in rows)
    return ['{:{}}  {:14}  {:34}  {}'.format(name, width, *shown(e), e.status) for name, e in rows.items()
            if name != DELAY or e.value != 0.0]
