"""The paper's comparison page: its statements beside what two runs give."""
import math
from dataclasses import dataclass

from .files import RunFiles
from .survey import Survey, merits_shown, value_of
from .tables import Table
from .text import DASH, shown

#: the paper's claim: "approximately 6.7 % less time and distance"
CLAIMED_PER_CENT = -6.7
#: the paper's plots show braking from 6.2 to 7.4 s
PLOTTED_STOP_S = 1.2


@dataclass
class Pair:
    """A figure of merit of the adaptive controller and of its baseline."""
    values: tuple[float, float]
    decimals: int

    def __getitem__(self, run: int) -> str:
        return shown(self.values[run], self.decimals)

    @property
    def per_cent(self) -> float:
        return 100.0 * (self.values[0] / self.values[1] - 1.0) if self.values[1] else math.nan

    @property
    def verdict(self) -> str:
        if not all(math.isfinite(value) for value in self.values):
            return 'Cannot be judged'
        return 'Holds' if self.values[0] < self.values[1] else 'Does not hold'


def _signed(value: float) -> str:
    return f'{"+" if value > 0.0 else ""}{shown(value, 1)} %' if math.isfinite(value) else DASH


def order_for_paper(runs: list[RunFiles], notes: list[str]) -> None:
    """Puts the adaptive controller's run first. Raises ValueError unless there are two runs."""
    if len(runs) != 2:
        raise ValueError(f'--paper compares two runs, adaptive and sliding-mode; give two runs: {len(runs)} '
                         f'{"was" if len(runs) == 1 else "were"} given')
    if runs[1].text('controller') == 'adaptive' and runs[0].text('controller') != 'adaptive':
        runs.reverse()
    for run, wanted in zip(runs, ('adaptive', 'sliding-mode')):
        controller = run.text('controller')
        if controller != wanted:
            notes.append(f'{run.called} is shown as {wanted}, but its controller is {controller or "not known"}')
    if runs[0].text('plant') != runs[1].text('plant'):
        notes.append('the two runs have different plants')


def lead(runs: list[RunFiles]) -> str:
    backend = runs[0].text('backend')
    return (f'Black: {runs[0].label}. Grey: {runs[1].label}. Plant: {runs[0].text("plant") or "unknown"}, '
            f'{"simulated" if backend == "sim" else "backend " + backend}.')


def pairs_of(runs: list[RunFiles], surveys: list[Survey]) -> dict[str, Pair]:
    return {metric.name: Pair((value_of(metric, runs[0], surveys[0]), value_of(metric, runs[1], surveys[1])),
                             metric.decimals) for metric in merits_shown()}


def claims(pairs: dict[str, Pair]) -> Table:
    time, distance, claim = pairs['stop_time_s'], pairs['stop_distance_m'], _signed(CLAIMED_PER_CENT)
    return Table('claims', ['', 'the paper', 'these runs'], [
        ['stop time, adaptive against sliding mode', claim, _signed(time.per_cent)],
        ['stop distance, adaptive against sliding mode', claim, _signed(distance.per_cent)],
        ['stop time of the adaptive controller / s', f'about {shown(PLOTTED_STOP_S, 1)}', time[0]],
        ['runs of each controller', '1', '1']])


def statements(pairs: dict[str, Pair]) -> dict[str, tuple[str, str]]:
    """For each of the paper's figures: a paraphrase of its statement, and the result of these two runs."""
    time, distance, rms, settling = (pairs[key] for key in ('stop_time_s', 'stop_distance_m', 'slip_rms', 'slip_settling_s'))
    variation, theta = pairs['torque_total_variation_Nm'], pairs['theta_error_final']
    settled = ['never settles within 0.02' if settling[run] == DASH else f'settles after {settling[run]} s'
               for run in range(2)]
    wheels = 'Both controllers decelerate; the proposed one stops a few tenths of a second earlier.'
    times = f'{time.verdict}: stop times {time[0]} s and {time[1]} s.'
    return {
        'fig5': (wheels, times),
        'fig6': (wheels, times),
        'fig7': ('The proposed controller reaches the slip 0.15 faster and stays closer to it. Towards standstill the '
                 'performance is no longer relevant.',
                 f'{rms.verdict}: RMS errors {rms[0]} and {rms[1]}; the first {settled[0]}, the second {settled[1]}.'),
        'fig8': ('No chattering, which the sliding mode shows.',
                 f'{variation.verdict}: the torque references vary by {variation[0]} N m and {variation[1]} N m in total.'),
        'fig9': ('Estimates of both controllers; unreliable at the end of braking.',
                 f'Relative errors of the estimates at 3 m/s: {theta[0]} and {theta[1]}.'),
        'fig10': (f'About {shown(-CLAIMED_PER_CENT, 1)} % less time and distance.',
                  f'Time {_signed(time.per_cent)}, distance {_signed(distance.per_cent)} against the sliding mode.')}
