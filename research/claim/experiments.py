"""Whole experiments on the nominal plants: the paper's figures 5 to 10, and the numbers of docs/theory*.md."""
from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType

import numpy as np

from abs_hil.merits import OVERSHOOT
from abs_hil.run import Run
from abs_hil.simulation import simulate
from abs_hil.tune import START_SPEED_RAD_S

from .criteria import ACTUATORS, PLANTS
from .laws import Entry, Settings
from .page import table

JUDGED_ABOVE_M_S = 3.0
SETTLED_AFTER_S = 0.3


def whole_run(entry: Entry, plant: str) -> Run:
    """The paper's experiment from rest, with the real actuator and encoders."""
    values = {key: value for key, value in entry.settings('real').items() if key != 'experiment.start_speed_rad_s'}
    return simulate(entry.controller, plant, set=values)


class Braking:
    """Phase brake of a run; times from its start."""

    def __init__(self, run: Run) -> None:
        part = run.columns['phase'] == 'brake'
        self._columns = {name: values[part] for name, values in run.columns.items()}
        self.summary = run.summary
        self.time_s = self['time_s'] - self['time_s'][0]
        self.speed_m_s = run.config['plant.r2_m'] * self['omega2_rad_s']
        self.judged = self.speed_m_s > JUDGED_ABOVE_M_S
        self.late = self.judged & (self.time_s > SETTLED_AFTER_S)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._columns[name]

    def first(self, holds: np.ndarray) -> str:
        return f'{self.time_s[np.argmax(holds)]:.3f}' if holds.any() else 'never'


def _optional(value: float | None, digits: int) -> str:
    return 'never' if value is None else f'{value:.{digits}f}'


#: the paper's figures, the quantity, and its value in a run
QUANTITIES: tuple[tuple[str, str, Callable[[Braking], str]], ...] = (
    ('5, 6', 'braking starts at / s', lambda b: f'{b.summary["brake_start_s"]:.3f}'),
    ('5, 6', 'stop time / s', lambda b: f'{b.summary["stop_time_s"]:.3f}'),
    ('7', 'slip first within 0.02 of 0.15 after / s', lambda b: _optional(b.summary['slip_reached_s'], 3)),
    ('7', 'mean slip, later than 0.3 s, above 3 m/s', lambda b: f'{b["slip"][b.late].mean():.3f}'),
    ('7', 'slip RMS error, the same', lambda b: f'{b.summary["slip_rms"]:.4f}'),
    ('7', 'largest slip above 3 m/s', lambda b: f'{b["slip"][b.judged].max():.3f}'),
    ('8', 'total variation of the torque asked for / N m', lambda b: f'{b.summary["torque_total_variation_Nm"]:.0f}'),
    ('8', 'the same per second of braking / (N m/s)',
     lambda b: f'{b.summary["torque_total_variation_Nm"] / b.summary["stop_time_s"]:.0f}'),
    ('9', 'estimate of θ first within 5 % after / s',
     lambda b: b.first(np.abs(b['theta_est_N'] / b['theta_N'] - 1.0) <= 0.05)),
    ('9', 'error of the estimate at 3 m/s / %', lambda b: f'{100.0 * b.summary["theta_error_final"]:+.1f}'),
    ('10', 'stop distance / m', lambda b: f'{b.summary["stop_distance_m"]:.2f}'))


def figures_table(adaptive: Entry, baselines: Mapping[str, Entry | None]) -> tuple[list[str], list[list[str]]]:
    """Headings, and one row for each quantity in the paper's figures, for the adaptive law and a baseline on each plant."""
    columns = []
    for plant in PLANTS:
        other = baselines[plant]
        columns.append((f'{plant}: adaptive', Braking(whole_run(adaptive, plant))))
        if other is not None:
            columns.append((f'{plant}: sliding-mode', Braking(whole_run(other, plant))))
    return (['figure', 'quantity', *(name for name, _ in columns)],
            [[figure, quantity, *(value(run) for _, run in columns)] for figure, quantity, value in QUANTITIES])


def _braking(controller: str, plant: str = 'paper-table1', values: Settings = MappingProxyType({})) -> Braking:
    # The experiment from the paper's speed, without the run-up.
    return Braking(simulate(controller, plant, set={'experiment.start_speed_rad_s': START_SPEED_RAD_S, **values}))


def beyond_table() -> str:
    """docs/theory-beyond.md: what stepping back through the brake's lag gives."""
    rows = []
    for plant in ('paper-table1', 'paper-timing', 'inteco-manual'):
        for controller in ('adaptive', 'adaptive-actuator'):
            run = _braking(controller, plant)
            s = run.summary
            rows.append([f'{plant}, {controller}', f'{s["stop_time_s"]:.3f}', f'{s["stop_distance_m"]:.2f}',
                         f'{s[OVERSHOOT]:.3f}', _optional(s['slip_settling_s'], 3), f'{s["slip_rms"]:.4f}',
                         _optional(s['theta_settling_s'], 3), f'{s["torque_total_variation_Nm"]:.0f}'])
    return table(['plant, controller', 'time s', 'distance m', 'overshoot', 'within 0.02 after s', 'slip RMS',
                  'θ̂ within 5 % after s', 'torque variation N m'], rows)


def theory_phrases() -> Iterator[str]:
    """docs/theory.md: sentences with numbers of runs."""
    run = _braking('nominal', values=ACTUATORS['ideal'])
    at = {speed: float(np.interp(-speed, -run.speed_m_s, run['slip'])) for speed in (12.0, 2.3)}
    yield (f'`nominal` with ideal actuator and sensors passes {at[12.0]:.4f} at 12 m/s and {at[2.3]:.4f} at 2.3 m/s')


def expected_table() -> str:
    """docs/theory.md: an independent prototype's numbers, which stay, and ours."""
    ideal = ACTUATORS['ideal']

    def both(run: Braking) -> str:
        return f'{run.summary["stop_time_s"]:.3f} s, {run.summary["stop_distance_m"]:.2f} m'

    adaptive = _braking('adaptive', values=ideal)
    within = adaptive.first(np.abs(adaptive['theta_est_N'] / adaptive['theta_N'] - 1.0) <= 0.02)
    real = _braking('adaptive')
    locked = _braking('locked')
    return table(['case', 'expected', 'abs_hil'], [
        ['nominal, ideal actuator, true speeds', '2.277 s, 19.36 m', both(_braking('nominal', values=ideal))],
        ['adaptive, ideal actuator, true speeds', '2.283 s, 19.32 m, θ̂ within 2 % at 0.223 s', f'{both(adaptive)}, {within} s'],
        ['adaptive, real actuator, encoders', '2.325 s, 19.72 m, slip RMS 0.008',
         f'{both(real)}, {real.summary["slip_rms"]:.4f}'],
        ['adaptive, ideal, θ = 45 N', '1.208 s, 10.08 m', both(_braking('adaptive', values={**ideal, 'plant.theta_N': 45.0}))],
        ['locked wheel', '3.19 s, 26.9 m',
         f'{locked.summary["stop_time_s"]:.2f} s, {locked.summary["stop_distance_m"]:.1f} m']])
