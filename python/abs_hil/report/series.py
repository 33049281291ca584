"""Series of runs: groups of equal values of what was varied, their means, and the figure over them."""
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ..merits import Estimate, FigureOfMerit, figures, number_in, of_mean
from .files import RunFiles, differing_keys
from .model import Curve, Figure, Label, Panel, Style
from .survey import Survey, merits_shown, value_of
from .tables import Table
from .text import DASH, clean, shown

MOST_KEYS_IN_LABEL = 3
LABEL_CHARACTERS = 36
MOST_TICS = 12
SHOWN = {'stop_time_s': 'stop time / s', 'stop_distance_m': 'distance / m', 'slip_rms': 'slip RMS error',
         'torque_total_variation_Nm': 'torque var. / (N m)'}


@dataclass
class Group:
    """Runs of a series that share the values of the varied keys."""
    label: str
    runs: list[int]
    value: float  # of the first varied key; NaN if it is no number


@dataclass
class SeriesStudy:
    name: str
    keys: list[str]  # varied keys, except the seed
    groups: list[Group] = field(default_factory=list)

    @property
    def by_value(self) -> bool:
        """True if the groups stand at their values on the x axis, false if at 1, 2, 3, ..."""
        return len(self.keys) == 1 and len(self.groups) > 1 and all(math.isfinite(group.value) for group in self.groups)


def study(name: str, numbers: list[int], runs: list[RunFiles]) -> SeriesStudy:
    found = SeriesStudy(name, [key for key in differing_keys([runs[number] for number in numbers]) if key != 'run.seed'])
    known: dict[tuple[str, ...], Group] = {}
    for number in numbers:
        if (values := tuple(runs[number].config.get(key, DASH) for key in found.keys)) not in known:
            parts = [f'{key.rpartition(".")[2]} = {value}' for key, value in zip(found.keys, values)][:MOST_KEYS_IN_LABEL]
            label = ', '.join(parts + (['…'] if len(found.keys) > MOST_KEYS_IN_LABEL else []))
            known[values] = Group(clean(label, LABEL_CHARACTERS) if label else 'all runs', [],
                                  number_in(runs[number].config, found.keys[0], math.nan) if values else math.nan)
        known[values].runs.append(number)
    found.groups = list(known.values())
    if all(math.isfinite(group.value) for group in found.groups):
        found.groups.sort(key=lambda group: group.value)
    return found


def _values(metric: FigureOfMerit, group: Group, runs: list[RunFiles], surveys: list[Survey]) -> list[float]:
    return [value_of(metric, runs[number], surveys[number]) for number in group.runs]


def _estimates(found: SeriesStudy, runs: list[RunFiles], surveys: list[Survey],
               ) -> Iterator[tuple[FigureOfMerit, list[Estimate]]]:
    """Each figure of merit with number, mean, standard deviation and 95 % interval of the mean of each group."""
    for metric in merits_shown():
        if metric.name != 'brake_start_s':
            yield metric, [of_mean(_values(metric, group, runs, surveys)) for group in found.groups]


def group_table(found: SeriesStudy, runs: list[RunFiles], surveys: list[Survey]) -> Table:
    """One row a group: the means of the figures of merit that the runs have."""
    header, columns = ['group', 'runs'], []
    for metric, estimates in _estimates(found, runs, surveys):
        if any(n for n, *_ in estimates):
            header.append(metric.heading)
            columns.append([shown(mean, metric.decimals) + (f' ± {shown(0.5 * (high - low), metric.decimals)}' if n > 1 else '')
                            if n else DASH for n, mean, _, low, high in estimates])
    return Table('groups', header, [[group.label, str(len(group.runs)), *(cells[number] for cells in columns)]
                                    for number, group in enumerate(found.groups)])


def series_table(found: SeriesStudy, runs: list[RunFiles], surveys: list[Survey]) -> Table:
    """Mean, standard deviation and 95 % confidence interval of each figure of merit by group."""
    rows = []
    for metric, estimates in _estimates(found, runs, surveys):
        digits = metric.decimals + 1
        rows += [[metric.heading, group.label, str(n), shown(mean, digits), shown(deviation, digits),
                  DASH if n < 2 else f'{shown(low, digits)} to {shown(high, digits)}']
                 for group, (n, mean, deviation, low, high) in zip(found.groups, estimates) if n]
    return Table('series', ['figure', ', '.join(found.keys) or 'only the seed varies', 'runs', 'mean', 'standard deviation',
                            '95 % interval of the mean'], rows)


def series_figure(number: int, found: SeriesStudy, runs: list[RunFiles], surveys: list[Survey]) -> Figure:
    places = [group.value if found.by_value else float(place) for place, group in enumerate(found.groups, 1)]
    room = 0.06 * (max(places) - min(places)) if max(places) > min(places) else 0.5
    x_range = (min(places) - room, max(places) + room)
    beside = 0.012 * (x_range[1] - x_range[0])
    panels = []
    for key, label in SHOWN.items():
        values = [_values(figures()[key], group, runs, surveys) for group in found.groups]
        every = [(place + beside, value) for place, some in zip(places, values) for value in some if math.isfinite(value)]
        means = [(place, mean, low, high) for place, (n, mean, _, low, high) in zip(places, map(of_mean, values)) if n > 1]
        if not every:
            continue
        panel = Panel(Label.plain(label), height_px=130.0)
        if means:
            x, y, low, high = np.array(means).T
            panel.curves.append(Curve(0, f'mean of {key}', Style('#000000', (), 1.2), x, y, 'intervals', group='means',
                                      legend='mean, 95 % interval', bounds=list(zip(low, high))))
        x, y = np.array(every).T
        panel.curves.append(Curve(0, key, Style('#0072B2', (), 1.0), x, y, 'markers', 'open circle', 'runs', 'runs'))
        if not found.by_value and len(found.groups) <= MOST_TICS:
            panel.x_tics = [(place, str(n)) for n, place in enumerate(places, 1)]
        panels.append(panel)
    caption = ('Circles: runs, drawn a little to the right; dots with bars: mean of the runs with the same values and its 95 % '
               'confidence interval.')
    if not found.by_value:
        groups = [f'{n}: {group.label}' for n, group in enumerate(found.groups[:MOST_TICS], 1)]
        caption += f' Groups: {"; ".join(groups)}.'
    return Figure(f'series{number}', 'Figures of merit over the varied keys',
                  Label.plain(found.keys[0] if found.by_value else 'group'), panels, caption, x_range, f'series{number}')
