"""What the parts of the paper's law do: rows of docs/paper.md for the law without a part, and for no law at all."""
from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from abs_hil.core import _core
from abs_hil.options import options
from abs_hil.simulation import simulate

from .criteria import PLANTS, SLIP_REF, slip_velocity_gain
from .laws import PAPER_GAINS, Entry, run_entries
from .statistics import ratio_interval

#: so small a Q that zeta' is nothing: zeta' is proportional to Q
NO_Q = {'control.adaptive.q11': 1e-9, 'control.adaptive.q22': 1e-9}
#: zeta' then has about the innovation's rate
LARGE_Q = {'control.adaptive.q11': 170.0, 'control.adaptive.q22': 170.0}
#: so small a weight that the innovation is nothing
NO_INNOVATION = {'control.adaptive.ka1': 1e-6}
#: by then `locked` has the wheel standing; and a time at which all still brake, s
STANDS_S, BRAKES_S = 0.4, 1.1

ENTRIES: Sequence[Entry] = (
    Entry(PAPER_GAINS, 'adaptive'),
    Entry('ζ(0) = 0', 'adaptive', {'control.adaptive.zeta0': 0.0}),
    Entry("ζ' = 0", 'adaptive', NO_Q),
    Entry("ζ' alone (ka1 = 0)", 'adaptive', NO_INNOVATION),
    Entry('Q = 170 I', 'adaptive', LARGE_Q),
    Entry('θ̂ = 23 N for good', 'adaptive', {**NO_Q, **NO_INNOVATION}),
    Entry('`locked`', 'locked'),
)


def _own(figures: dict[str, np.ndarray], index: int, number: int, name: str) -> np.ndarray:
    return np.asarray(figures[name][index, number, 1:], dtype=float)


class Parts:
    """Runs of all entries behind the real actuator, on the plants of the evaluation."""

    def __init__(self, runs: int, seed: int, threads: int = 0) -> None:
        self.figures = run_entries(ENTRIES, PLANTS, 'real', runs, seed, threads)

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Headings and rows."""
        return (['plant', 'law', 'stop time / s', 'stop distance / m', 'time / adaptive', 'distance / adaptive',
                 'θ̂ within 5 % after / s (plants)'], list(self._rows()))

    def _rows(self) -> Iterator[list[str]]:
        for number, plant in enumerate(PLANTS):
            for index, entry in enumerate(ENTRIES):
                own = {name: _own(self.figures, index, number, name)
                       for name in ('stop_time_s', 'stop_distance_m', 'theta_settling_s')}
                row = [plant, entry.name, f'{np.nanmedian(own["stop_time_s"]):.3f}',
                       f'{np.nanmedian(own["stop_distance_m"]):.2f}']
                for name in ('stop_time_s', 'stop_distance_m'):
                    row.append(ratio_interval(own[name], _own(self.figures, 0, number, name)).text())
                settled = own['theta_settling_s']
                share = np.isfinite(settled).mean()
                row.append(f'{np.nanmedian(settled):.3f} ({100.0 * share:.0f} %)' if share > 0.0 else 'never')
                yield row

    def phrases(self) -> Iterator[str]:
        """Sentences of the page with fresh numbers."""
        ours, locked = (index for index, entry in enumerate(ENTRIES) if entry.name in (PAPER_GAINS, '`locked`'))
        time, distance = (float(self.figures[name][locked, 0, 0]) for name in ('stop_time_s', 'stop_distance_m'))
        own_time, own_distance = (float(self.figures[name][ours, 0, 0]) for name in ('stop_time_s', 'stop_distance_m'))
        yield (f'`locked` stops after {time:.3f} s and {distance:.2f} m, the adaptive law after {own_time:.3f} s and '
               f'{own_distance:.2f} m')
        (lost, slows), (own_lost, own_slows) = (slowing(ENTRIES[index]) for index in (locked, ours))
        yield (f'In the first {STANDS_S:.1f} s `locked` takes {lost:.2f} m/s from the car and the adaptive law '
               f'{own_lost:.2f} m/s; afterwards they slow it by {slows:.1f} m/s² and {own_slows:.1f} m/s²')
        share = lyapunov_share()
        yield f"ζ' alone has {100.0 * share:.1f} % of the innovation's rate"


def lyapunov_share() -> float:
    """The rate at which zeta' alone would correct theta_hat, over that of the innovation, while the slip is held:
    k^2 phi q11 / (ks0^2 ka1). docs/paper.md derives it."""
    values = {row['name']: row['value'] for row in _core.keys(options(plant='paper-table1', controller='adaptive'))}
    gains = {name: float(values[f'control.adaptive.{name}']) for name in ('q11', 'ks0', 'ka1')}
    k = slip_velocity_gain('paper-table1')
    phi = float(np.sin(values['plant.C'] * np.arctan(values['plant.B'] * SLIP_REF)))  # (10)
    return k * k * phi * gains['q11'] / (gains['ks0'] ** 2 * gains['ka1'])


def slowing(entry: Entry) -> tuple[float, float]:
    """What a law takes from the car's speed on the rig's model until STANDS_S, m/s, and the mean deceleration from then to
    BRAKES_S, m/s^2."""
    run = simulate(entry.controller, PLANTS[0], set=entry.settings('real'))
    part = run.columns['phase'] == 'brake'
    time_s, speed_rad_s = run.columns['time_s'][part], run.columns['omega2_rad_s'][part]
    first, middle, late = (run.config['plant.r2_m'] * float(np.interp(at, time_s - time_s[0], speed_rad_s))
                           for at in (0.0, STANDS_S, BRAKES_S))
    return first - middle, (middle - late) / (BRAKES_S - STANDS_S)
