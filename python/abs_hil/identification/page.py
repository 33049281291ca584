"""The page of an identification: fits, residuals, intervals, correlations, what to run next."""
import pathlib
from collections.abc import Iterator

import numpy as np

from ..core import _core
from ..report.model import Curve, Figure, Label, Panel, Shade, run_style
from ..report.page import render, view
from ..report.tables import Table
from ..run import stretches
from .advice import Advice
from .found import Identified
from .problem import residuals
from .results import shown

_FOLDER = pathlib.Path(__file__).parent
_MOST_POINTS = 4000


def _parameters(found: Identified) -> Table:
    rows = []
    for name, e in {**found.parameters, **found.combinations}.items():
        value, interval = shown(e)
        width = '–'
        if e.low is not None and e.high is not None and e.status != 'fixed' and e.value:
            width = f'± {50 * (e.high - e.low) / abs(e.value):.2g} %'
        rows.append([name, value, e.unit, interval or '–', width, e.status])
    return Table('parameters', ['parameter', 'value', 'unit', 'interval of 95 %', 'half width', 'status'], rows)


def _log_figures(found: Identified) -> Iterator[Figure]:
    fit = found.fit
    left_in: dict[str, list[str]] = {log.name: [] for log in found.logs}
    for rms, name, phase in residuals(fit):
        left_in[name].append(f'{phase or "all"} {rms:.3f}')
    for number, log in enumerate(found.logs):
        motion = fit.problem.motions[number]
        speeds = [Curve(0, name, run_style(i), *_thinned(log.time_s, motion.speed_rad_s[:, i]), legend=name, group=name)
                  for i, name in enumerate(('upper wheel', 'lower wheel'))]
        duties = [Curve(0, name, run_style(i + 2), *_thinned(log.time_s, values), legend=name, group=name)
                  for i, (name, values) in enumerate((('brake', log.brake_pwm), ('motor', log.motor_pwm)))]
        pieces = [piece for piece in fit.pieces if piece.log == number]
        rows = np.concatenate([np.empty(0, dtype=int), *(np.arange(len(log))[piece.rows] for piece in pieces)])
        weight = np.concatenate([np.empty((0, 2)), *(piece.linear['weight'] for piece in pieces)])
        left = np.concatenate([np.empty((0, 2)), *(piece.linear['residual'][:, :, 0] for piece in pieces)])
        left /= fit.problem.radians_per_count
        shown_left = np.where(weight > 0, left, np.nan)
        left_over = [Curve(0, f'residual, {name}', run_style(i), *_thinned(log.time_s[rows], shown_left[:, i]), group=name)
                     for i, name in enumerate(('upper wheel', 'lower wheel')) if pieces]
        yield Figure(
            f'log-{number + 1}', log.name, Label('time, s', 'time, s'),
            [Panel(Label('speed, rad/s', 'speed, rad/s'), speeds, height_px=150.0),
             Panel(Label('duty', 'duty'), duties, height_px=90.0),
             Panel(Label('residual, counts', 'residual, counts'), left_over, height_px=110.0)],
            caption=f'{len(log)} rows; residual by phase: {", ".join(left_in[log.name])}.', axis=f'log-{number + 1}',
            shades=[Shade(float(log.time_s[a]), float(log.time_s[b - 1]), 'hold') for a, b in stretches(log.wheels_apart != 0)])


def _thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    step = max(1, len(x) // _MOST_POINTS)
    return x[::step], y[::step]


def _correlations(found: Identified) -> Table:
    fit = found.fit
    chosen = [i for i, one in enumerate(fit.free) if one]
    covariance = found.spread.covariance[np.ix_(chosen, chosen)]
    sd = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    correlation = covariance / np.outer(sd, sd)
    names = [fit.keys[i] for i in chosen]
    rows = [[name, *(f'{correlation[i, j]:+.2f}' if j < i else '' for j in range(len(names)))] for i, name in enumerate(names)]
    return Table('correlations', ['', *names], rows)


def page(found: Identified, advice: list[Advice]) -> str:
    figures = [*_log_figures(found)]
    validation = Table('validation', ['', 'measured', 'predicted', 'interval', 'error'], [])
    if found.validation is not None:
        v = found.validation
        for name, label in (('stop_distance_m', 'stop distance, m'), ('stop_time_s', 'stop time, s')):
            measured, predicted, error = (v[name], v[f'predicted_{name}'], v[f'{name}_error'])
            validation.rows.append([label, f'{measured or np.nan:.5g}', f'{predicted or np.nan:.5g}', '–' if error is None else
                                    '{:.5g} to {:.5g}'.format(*v[f'{name}_interval']),
                                    '–' if error is None else f'{100 * error:+.3f} %'])
    logs = Table('logs', ['log', 'rows', 's', 'disagreement', 'sha256'],
                 [[log.name, str(len(log)), f'{log.time_s[-1] - log.time_s[0]:.1f}',
                   f'{found.disagreement[log.name]:.2f}' if log.name in found.disagreement else '–', log.sha256[:16]]
                  for log in found.logs])
    return render('identification.html.j2', figures, _FOLDER, version=_core.version, found=found,
                  parameters=_parameters(found), correlations=_correlations(found), validation=validation, logs=logs,
                  advice=[one.sentence() for one in advice], figures=[view(figure) for figure in figures])
