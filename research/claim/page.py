"""The tables of docs/paper.md about the claim, from fresh runs on plants that neither the search nor the map has seen."""
from __future__ import annotations

import pathlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from abs_hil.figures import OVERSHOOT, heading_of

from .criteria import ACTUATORS, PLANTS, Verdict
from .laws import BASELINES, MAP_KEYS, Entry, entries, judge_entries, run_entries
from .map import FIGURES, PAPER_RATIO, Map
from .statistics import ratio_interval

#: seed of the plants on which the page's figures are measured: that of `abs_hil compare`
EVALUATION_SEED = 1
#: columns of the tables of all laws, with their digits
SHOWN = {'stop_time_s': 3, 'stop_distance_m': 2, 'slip_rms': 4, OVERSHOOT: 3, 'torque_total_variation_Nm': 0,
         'theta_error_final': 3}


@dataclass(frozen=True)
class Result:
    """Figures of one law on one kind of plant, shape (1 + runs,): the nominal plant first."""
    entry: Entry
    figures: Mapping[str, np.ndarray]
    verdict: Verdict

    def varied(self, name: str) -> np.ndarray:
        return np.asarray(self.figures[name][1:], dtype=float)

    @property
    def counts(self) -> bool:
        return bool(self.verdict.admissible())


def results(all_: Sequence[Entry], plants: Sequence[str], actuator: str, runs: int,
            threads: int = 0) -> dict[tuple[str, str], Result]:
    """The laws on the evaluation's plants, by plant and name of the entry."""
    found: dict[tuple[str, str], Result] = {}
    figures = run_entries(all_, plants, actuator, runs, EVALUATION_SEED, threads)
    for index, entry in enumerate(all_):
        for number, plant in enumerate(plants):
            own = {name: values[index:index + 1, number:number + 1] for name, values in figures.items()}
            verdict = judge_entries(own, [entry], [plant])
            found[plant, entry.name] = Result(
                entry, {name: values[0, 0] for name, values in own.items()},
                Verdict(*(held[0, 0] for held in (verdict.stops, verdict.reaches, verdict.estimates, verdict.slides))))
    return found


def first_order(one: Map, found: tuple[int, int], name: str) -> Entry:
    """The sliding-mode law of a cell of the map."""
    return Entry(name, 'sliding-mode', dict(zip(MAP_KEYS, (float(one.gain_m_s2[found[0]]), float(one.gamma[found[1]])))))


class Page:
    """All evaluations behind the page."""

    def __init__(self, folder: pathlib.Path, maps: Sequence[Map], runs: int, threads: int = 0) -> None:
        self.maps = {(one.plant, one.actuator): one for one in maps}
        self.runs = runs
        self.names = [entry.name for entry in entries(folder, next(iter(ACTUATORS)))]
        self.found: dict[tuple[str, str, str], Result] = {}
        for actuator in ACTUATORS:
            for (plant, name), result in results(entries(folder, actuator), PLANTS, actuator, runs, threads).items():
                self.found[plant, actuator, name] = result
            for plant in PLANTS:
                one = self.maps[plant, actuator]
                chosen = [first_order(one, cell, name) for name, cell in (('best', one.best()), ('median', one.median()))
                          if cell is not None]
                if chosen:
                    for (_, name), result in results(chosen, [plant], actuator, runs, threads).items():
                        self.found[plant, actuator, name] = result

    def baseline(self, plant: str, actuator: str, name: str) -> Result | None:
        """A baseline of that plant if it meets the criteria there on the evaluation's plants."""
        result = self.found.get((plant, actuator, name))
        return result if result is not None and result.counts else None

    def sections(self) -> Iterator[tuple[str, str]]:
        yield 'claim', self.claim()
        yield 'others', self.others()
        yield 'map', self.map_table()
        for plant in PLANTS:
            yield f'laws {plant} real', self.laws(plant, 'real')

    def _ratios(self, ours: Result, theirs: Result) -> list[str]:
        return [ratio_interval(ours.varied(name), theirs.varied(name)).text() for name in FIGURES]

    def claim(self) -> str:
        """adaptive in the paper's gains against the first-order baselines of the map."""
        rows = []
        for plant in PLANTS:
            for actuator in ACTUATORS:
                ours = self.found[plant, actuator, self.names[0]]
                for name in ('best', 'median'):
                    theirs = self.baseline(plant, actuator, name)
                    if theirs is None:
                        rows.append([plant, actuator, name, 'none counts', *[''] * (1 + len(FIGURES))])
                        continue
                    gains = theirs.entry.gains
                    rows.append([plant, actuator, name, *(f'{gains[key]:.3g}' for key in MAP_KEYS), *self._ratios(ours, theirs)])
        rows.append(['the paper', 'its rig', '', 'not given', 'not given', f'{PAPER_RATIO}', f'{PAPER_RATIO}', 'not given',
                     'not given'])
        return table(['plant', 'actuator', 'baseline', 'K / (m/s²)', 'γ / (kg² m/s³)', *FIGURES.values()], rows)

    def others(self) -> str:
        """adaptive in the paper's gains against every shipped baseline that counts, behind the real actuator."""
        rows = []
        for plant in PLANTS:
            for other in BASELINES:
                theirs = self.baseline(plant, 'real', other)
                if theirs is not None:
                    rows.append([plant, other, *self._ratios(self.found[plant, 'real', self.names[0]], theirs)])
        return table(['plant', 'baseline', *FIGURES.values()], rows)

    def phrases(self) -> Iterator[str]:
        """Sentences of the page with fresh numbers."""
        for name in ('best', 'median'):
            theirs = self.baseline(PLANTS[0], 'real', name)
            if theirs is None:
                continue
            ours = self.found[PLANTS[0], 'real', self.names[0]]
            time, distance = (100.0 - 100.0 * ratio_interval(ours.varied(figure), theirs.varied(figure)).mean
                              for figure in ('stop_time_s', 'stop_distance_m'))
            yield f'{time:.1f} % less time and {distance:.1f} % less distance than the {name} baseline'

    def map_table(self) -> str:
        """How the ratios lie over the gains that count."""
        rows = []
        for plant in PLANTS:
            for actuator in ACTUATORS:
                one = self.maps[plant, actuator]
                row = [plant, actuator, f'{one.admissible.sum()} of {one.admissible.size}']
                for name in ('stop_time_s', 'stop_distance_m', 'torque_total_variation_Nm', 'slip_rms'):
                    held = one.ratio[name][one.admissible]
                    held = held[np.isfinite(held)]
                    row.append(f'{held.min():.3f} to {held.max():.3f}' if held.size else '')
                    if name in ('stop_time_s', 'stop_distance_m'):
                        row.append(f'{100.0 * np.mean(held <= PAPER_RATIO):.0f}' if held.size else '')
                rows.append(row)
        return table(['plant', 'actuator', 'gains that count', 'stop time', '≤ 0.933 / %', 'stop distance', '≤ 0.933 / %',
                      'torque variation', 'slip RMS error'], rows)

    def laws(self, plant: str, actuator: str) -> str:
        """Every law's figures: median and 10th and 90th percentile."""
        rows, missing = [], []
        for name in self.names:
            result = self.found[plant, actuator, name]
            shares = ', '.join(f'{100 * share:.0f}' for share in result.verdict.shares().values())
            if name in BASELINES and not result.counts:
                missing.append(f'{name} ({shares})')
                continue
            cells = [name]
            for figure, digits in SHOWN.items():
                values = result.varied(figure)
                low, median, high = np.nanquantile(values, (0.1, 0.5, 0.9))
                cells.append(f'{median:.{digits}f} ({low:.{digits}f}…{high:.{digits}f})')
            rows.append([*cells, shares])
        text = table(['law', *map(heading_of, SHOWN), 'criteria held / %'], rows)
        return text + ('\n\nDo not count here (criteria held / %): ' + '; '.join(missing) + '.' if missing else '')


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = '|' + '---|' * len(head)
    return '\n'.join(['| ' + ' | '.join(head) + ' |', rule, *('| ' + ' | '.join(row) + ' |' for row in rows)])
