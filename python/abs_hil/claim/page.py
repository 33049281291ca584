"""The tables of docs/paper.md, from fresh runs."""
from __future__ import annotations

import math
import pathlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..simulation import STANDARD_VARIATION, Study, simulate, simulate_many
from ..tune import START_SPEED_RAD_S
from .criteria import ACTUATORS, PLANTS, judge, slip_velocity_gain
from .laws import LAWS, gains_file
from .map import FIGURES, PAPER_RATIO, Map

#: seed of the plants on which the page's figures are measured: neither training nor the map uses it
EVALUATION_SEED = 1
EVALUATIONS = 400
RATIO_HEADINGS = ('stop time', 'stop distance', 'torque variation', 'slip RMS error')
#: the adaptive law in the paper's own gains, beside the searched ones
PAPER_GAINS = "adaptive, paper's gains"


@dataclass(frozen=True)
class Entry:
    """A law with gains, as the page lists it."""
    name: str
    controller: str
    config: pathlib.Path | None  #: file with its gains; None: the controller's defaults, theta0 as for all
    gain_m_s2: float | None  #: its K


def entries(folder: pathlib.Path, actuator: str) -> list[Entry]:
    import tomllib
    found = [Entry(PAPER_GAINS, 'adaptive', None, None)]
    for controller, law in LAWS.items():
        path = gains_file(folder, actuator, controller)
        table: Any = tomllib.loads(path.read_text(encoding='utf-8'))
        if law.gain is not None:
            for part in law.gain.split('.'):
                table = table[part]
        found.append(Entry('adaptive, searched' if controller == 'adaptive' else controller, controller, path,
                           None if law.gain is None else float(table)))
    return found


def arguments(entry: Entry, plant: str, actuator: str, **more: float) -> dict[str, Any]:
    law = LAWS[entry.controller]
    sets = {'experiment.start_speed_rad_s': START_SPEED_RAD_S, **ACTUATORS[actuator],
            **(law.fixed() if entry.config is None else {}), **more}
    return {'controller': entry.controller, 'plant': plant, 'set': sets,
            **({} if entry.config is None else {'config': entry.config})}


def evaluate(entry: Entry, plant: str, actuator: str, runs: int = EVALUATIONS, threads: int = 0, **more: float) -> Study:
    """The law on the evaluation's plants."""
    return simulate_many([arguments(entry, plant, actuator, **more)], vary=STANDARD_VARIATION, repeat=runs,
                         vary_seed=EVALUATION_SEED, threads=threads)


def ratio_with_interval(ours: np.ndarray, theirs: np.ndarray) -> tuple[float, float, float]:
    """Geometric mean of ours/theirs run by run, and its 95 % interval (Student's t of the logarithms)."""
    from scipy import stats
    with np.errstate(invalid='ignore', divide='ignore'):
        logarithm = np.log(ours) - np.log(theirs)
    logarithm = logarithm[np.isfinite(logarithm)]
    if len(logarithm) < 2:
        return math.nan, math.nan, math.nan
    mean = float(logarithm.mean())
    half = float(stats.t.ppf(0.975, len(logarithm) - 1) * logarithm.std(ddof=1) / math.sqrt(len(logarithm)))
    return math.exp(mean), math.exp(mean - half), math.exp(mean + half)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = '|' + '---|' * len(head)
    return '\n'.join(['| ' + ' | '.join(head) + ' |', rule, *('| ' + ' | '.join(row) + ' |' for row in rows)])


def _ratios(ours: Study, theirs: Study) -> list[str]:
    cells = []
    for name in FIGURES:
        mean, low, high = ratio_with_interval(ours[name], theirs[name])
        cells.append(f'{mean:.3f} [{low:.3f}, {high:.3f}]')
    return cells


def claim_table(folder: pathlib.Path, maps: Mapping[tuple[str, str], Map], runs: int, threads: int = 0) -> str:
    """adaptive with the paper's gains against the baselines, on the evaluation's plants."""
    rows = []
    for plant in PLANTS:
        for actuator in ACTUATORS:
            all_ = entries(folder, actuator)
            ours = evaluate(all_[0], plant, actuator, runs, threads)
            first_order = next(entry for entry in all_ if entry.controller == 'sliding-mode')
            one = maps[plant, actuator]
            for title, found in (('best on this plant', one.best()), ('median on this plant', one.median())):
                if found is None:
                    rows.append([plant, actuator, title, 'none is admissible', '', '', '', ''])
                    continue
                gain, gamma = one.gain_m_s2[found[0]], one.gamma[found[1]]
                theirs = evaluate(Entry('', 'sliding-mode', None, gain), plant, actuator, runs, threads,
                                  **{'control.sliding_mode.gain_m_s2': float(gain),
                                     'control.sliding_mode.gamma': float(gamma)})
                rows.append([plant, actuator, title, f'{gain:.3g}, {gamma:.3g}', *_ratios(ours, theirs)])
            theirs = evaluate(first_order, plant, actuator, runs, threads)
            rows.append([plant, actuator, 'searched on all plants', f'{first_order.gain_m_s2:.3g}', *_ratios(ours, theirs)])
    rows.append(['the paper', 'its rig', '', '', f'{PAPER_RATIO}', f'{PAPER_RATIO}', 'not given', 'not given'])
    return _table(['plant', 'actuator', 'sliding-mode', 'K, γ', *RATIO_HEADINGS], rows)


def laws_table(folder: pathlib.Path, plant: str, actuator: str, runs: int, threads: int = 0) -> str:
    """Median and 10th and 90th percentile of every law's figures, and the share of runs that meet the criteria."""
    rows = []
    k = slip_velocity_gain(plant)
    for entry in entries(folder, actuator):
        study = evaluate(entry, plant, actuator, runs, threads)
        shares = judge(study, entry.gain_m_s2, k).shares()
        cells = [entry.name]
        for name, digits in (('stop_time_s', 3), ('stop_distance_m', 2), ('slip_rms', 4), ('slip_overshoot', 3),
                             ('torque_total_variation_Nm', 0), ('theta_error_final', 3)):
            low, median, high = np.nanquantile(study[name], (0.1, 0.5, 0.9))
            cells.append(f'{median:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})')
        cells.append(', '.join(f'{100 * shares[name]:.0f}' for name in ('reaches', 'estimates', 'slides', 'all')))
        rows.append(cells)
    return _table(['law', 'stop time / s', 'stop distance / m', 'slip RMS error', 'slip overshoot',
                   'torque variation / N m', 'error of θ̂ at 3 m/s', 'reaches, estimates, slides, all / %'], rows)


def swing_speed_m_s(study: Mapping[str, np.ndarray]) -> np.ndarray:
    """Car speed below which (17) swings behind the brake's lag, k theta |phi'(slip_ref)| / c31, for each run."""
    slip_ref = 0.15
    B, C = study['plant.B'], study['plant.C']
    slope = B * C * np.cos(C * np.arctan(B * slip_ref)) / (1.0 + (B * slip_ref) ** 2)
    r1, r2 = study['plant.r1_m'], study['plant.r2_m']
    k = r1 ** 2 / study['plant.J1_kg_m2'] + (1.0 - slip_ref) * r2 ** 2 / study['plant.J2_kg_m2']
    return -k * study['plant.theta_N'] * slope / study['plant.c31_per_s']


Section = tuple[str, Callable[[], str]]
NUMBER = re.compile(r'[-+]?\d+\.?\d*')


def replaced(page: str, sections: Iterator[tuple[str, str]]) -> str:
    """The page with the text between each section's markers replaced. Raises ValueError for missing markers."""
    for name, text in sections:
        pattern = re.compile(f'(<!-- begin {name} -->\n).*?(<!-- end {name} -->)', re.S)
        page, count = pattern.subn(lambda found, text=text: found[1] + '\n' + text.strip() + '\n\n' + found[2], page)
        if count != 1:
            raise ValueError(f'expected the markers of {name} once, found them {count} times')
    return page


def differences(before: str, after: str, tolerance: float) -> list[str]:
    """Lines of two versions of the page whose words differ, or whose numbers differ by more than `tolerance` of their
    size plus half of their last digit."""
    found = []
    old, new = before.splitlines(), after.splitlines()
    if len(old) != len(new):
        return [f'{len(old)} lines, now {len(new)}']
    for one, two in zip(old, new):
        if NUMBER.sub('#', one) != NUMBER.sub('#', two):
            found.append(f'- {one}\n+ {two}')
            continue
        for a, b in zip(NUMBER.findall(one), NUMBER.findall(two)):
            digit = 10.0 ** -len(a.partition('.')[2])
            if abs(float(a) - float(b)) > tolerance * abs(float(a)) + 1.5 * digit:
                found.append(f'- {one}\n+ {two}')
                break
    return found


def trace(entry: Entry, plant: str) -> Any:
    """A whole experiment from rest with the real actuator."""
    made = arguments(entry, plant, 'real')
    made['set'] = {key: value for key, value in made['set'].items() if key != 'experiment.start_speed_rad_s'}
    return simulate(**made)
