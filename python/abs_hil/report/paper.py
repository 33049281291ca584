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
    def change(self) -> str:
        """Of the adaptive controller against its baseline."""
        return _signed(100.0 * (self.values[0] / self.values[1] - 1.0) if self.values[1] else math.nan)

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
        if (controller := run.text('controller')) != wanted:
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
        ['stop time, adaptive against sliding mode', claim, time.change],
        ['stop distance, adaptive against sliding mode', claim, distance.change],
        ['stop time of the adaptive controller / s', f'about {shown(PLOTTED_STOP_S, 1)}', time[0]],
        ['runs of each controller', '1', '1']])
