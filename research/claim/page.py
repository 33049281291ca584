"""The tables of docs/paper.md about the claim, from fresh runs on plants that neither the search nor the map has seen. Those that
are long stand in CSV files; the page has the rows that its text speaks of."""
from __future__ import annotations

import csv
import io
import pathlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from abs_hil.merits import OVERSHOOT, heading_of

from .criteria import ACTUATORS, PLANTS, Verdict
from .laws import BASELINES, MAP_KEYS, PAPER_GAINS, Entry, entries, judge_entries, run_entries
from .map import FIGURES, PAPER_RATIO, Map, axes, draw_maps
from .parts import Parts
from .statistics import ratio_interval

#: seed of the plants on which the page's figures are measured: that of `abs_hil compare`
EVALUATION_SEED = 1
#: headings and rows
Table = tuple[list[str], list[list[str]]]
#: q of the reaching terms, 1/s; the last is ks1 of the paper's law. Size and cases of their maps.
REACHING_PER_S, REACHING_SIZE, REACHING_CASES = (8.0, 32.0), 10, 20
#: the largest brake duty that the boards' drivers send by default
CAP = {'plant.brake_duty_max': 0.7}
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


def baselines(one: Map) -> list[Entry]:
    """Those of the map that the page names."""
    cells = {'best': one.best(), 'median': one.median(), 'least favourable': one.least_favourable()}
    return [first_order(one, cell, name) for name, cell in cells.items() if cell is not None]


class Page:
    """All evaluations behind the page."""

    def __init__(self, folder: pathlib.Path, maps: Sequence[Map], runs: int, threads: int = 0) -> None:
        self.maps = {(one.plant, one.actuator): one for one in maps}
        self.runs = runs
        self.names = [entry.name for entry in entries(folder, next(iter(ACTUATORS)))]
        self.threads = threads
        self.parts = Parts(runs, EVALUATION_SEED, threads)
        self.found: dict[tuple[str, str, str], Result] = {}
        for actuator in ACTUATORS:
            for (plant, name), result in results(entries(folder, actuator), PLANTS, actuator, runs, threads).items():
                self.found[plant, actuator, name] = result
            for plant in PLANTS:
                one = self.maps[plant, actuator]
                chosen = baselines(one)
                if chosen:
                    for (_, name), result in results(chosen, [plant], actuator, runs, threads).items():
                        self.found[plant, actuator, name] = result

    def baseline(self, plant: str, actuator: str, name: str) -> Result | None:
        """A baseline of that plant if it meets the criteria there on the evaluation's plants."""
        result = self.found.get((plant, actuator, name))
        return result if result is not None and result.counts else None

    def sections(self) -> Iterator[tuple[str, str]]:
        head, rows = self.claim()
        shown = [0, 2, 3, 4, 5, 6]
        yield 'claim', table([head[n] for n in shown], [[bare(row[n]) for n in shown] for row in rows if row[1] != 'ideal'])
        yield 'map', self.map_table('real')
        head, rows = self.parts.table()
        yield 'parts', table(head[1:], [list(map(bare, row[1:])) for row in rows if row[0] == PLANTS[0]])

    def files(self) -> Iterator[tuple[str, str]]:
        """The CSV files in docs/reference: all rows."""
        yield 'docs/reference/paper-claim.csv', csv_text(*self.claim())
        yield 'docs/reference/paper-baselines.csv', csv_text(*self.others())
        yield 'docs/reference/paper-reaching.csv', csv_text(*self.reaching())
        yield 'docs/reference/paper-capped.csv', csv_text(*self.capped())
        yield 'docs/reference/paper-parts.csv', csv_text(*self.parts.table())
        yield 'docs/reference/paper-laws.csv', csv_text(*self.laws('real'))

    def _ratios(self, ours: Result, theirs: Result) -> list[str]:
        return [ratio_interval(ours.varied(name), theirs.varied(name)).text() for name in FIGURES]

    def claim(self) -> Table:
        """adaptive in the paper's gains against the first-order baselines of the map."""
        rows = []
        for plant in PLANTS:
            for actuator in ACTUATORS:
                ours = self.found[plant, actuator, self.names[0]]
                for name in ('best', 'median', 'least favourable'):
                    theirs = self.baseline(plant, actuator, name)
                    if theirs is None:
                        rows.append([plant, actuator, name, 'none counts', *[''] * (1 + len(FIGURES))])
                        continue
                    gains = theirs.entry.gains
                    rows.append([plant, actuator, name, *(f'{gains[key]:.3g}' for key in MAP_KEYS), *self._ratios(ours, theirs)])
        rows.append(['the paper', 'its rig', '', 'not given', 'not given', f'{PAPER_RATIO}', f'{PAPER_RATIO}', 'not given',
                     'not given'])
        return ['plant', 'actuator', 'baseline', 'K / (m/s²)', 'γ / (kg² m/s³)', *FIGURES.values()], rows

    def others(self) -> Table:
        """adaptive in the paper's gains against every shipped baseline that counts, behind the real actuator."""
        rows = []
        for plant in PLANTS:
            for other in BASELINES:
                theirs = self.baseline(plant, 'real', other)
                if theirs is not None:
                    rows.append([plant, other, *self._ratios(self.found[plant, 'real', self.names[0]], theirs)])
        return ['plant', 'baseline', *FIGURES.values()], rows

    def phrases(self) -> Iterator[str]:
        """Sentences of the page with fresh numbers."""
        one = self.maps[PLANTS[0], 'real']
        (least_s, median_s, most_s), (least_m, median_m, most_m) = (one.span(name) for name in ('stop_time_s', 'stop_distance_m'))
        yield f'between {least_s:.2f} and {most_s:.2f} times the time and {least_m:.2f} and {most_m:.2f} times the distance'
        yield f'the median is {median_s:.2f} and {median_m:.2f}'
        yield from self.parts.phrases()
        for name in ('best', 'median'):
            theirs = self.baseline(PLANTS[0], 'real', name)
            if theirs is None:
                continue
            ours = self.found[PLANTS[0], 'real', self.names[0]]
            time, distance = (100.0 - 100.0 * ratio_interval(ours.varied(figure), theirs.varied(figure)).mean
                              for figure in ('stop_time_s', 'stop_distance_m'))
            yield f'{time:.1f} % less time and {distance:.1f} % less distance than the {name} baseline'

    def map_table(self, actuator: str) -> str:
        """How the ratios lie over the gains that count."""
        rows = []
        for plant in PLANTS:
            one = self.maps[plant, actuator]
            row = [plant, f'{one.admissible.sum()} of {one.admissible.size}']
            for name in ('stop_time_s', 'stop_distance_m'):
                held = one.ratio[name][one.admissible]
                held = held[np.isfinite(held)]
                row += [_span(one, name), f'{100.0 * np.mean(held <= PAPER_RATIO):.0f}' if held.size else '']
            rows.append(row)
        return table(['plant', 'gains that count', 'stop time', '≤ 0.933 / %', 'stop distance', '≤ 0.933 / %'], rows)

    def reaching(self) -> Table:
        """How the ratios lie if the baseline has a reaching term, behind the real actuator."""
        rows = []
        for q in REACHING_PER_S:
            maps = draw_maps('real', *axes(REACHING_SIZE), cases=REACHING_CASES, threads=self.threads,
                             settings={'control.sliding_mode.reaching_per_s': q})
            rows += [[one.plant, f'{q:g}', f'{one.admissible.sum()} of {one.admissible.size}',
                      *(_span(one, name) for name in FIGURES)] for one in maps]
        rows.sort(key=lambda row: PLANTS.index(row[0]))
        return ['plant', 'q / (1/s)', 'gains that count', *FIGURES.values()], rows

    def capped(self) -> Table:
        """The claim's baselines where the brake's duty is capped as the boards do."""
        rows = []
        for plant in PLANTS:
            chosen = [Entry(PAPER_GAINS, 'adaptive'), *baselines(self.maps[plant, 'real'])]
            held = results([Entry(one.name, one.controller, {**one.gains, **CAP}) for one in chosen], [plant], 'real', self.runs,
                           self.threads)
            ours = held[plant, PAPER_GAINS]
            for one in chosen:
                theirs = held[plant, one.name]
                times = ['', ''] if theirs is ours else [
                    ratio_interval(ours.varied(name), theirs.varied(name)).text() for name in ('stop_time_s', 'stop_distance_m')]
                rows.append([plant, one.name, f'{100.0 * theirs.verdict.shares()["reaches"]:.0f}',
                             'yes' if theirs.counts else 'no', *times])
        return ['plant', 'law', 'reaches the slip on / %', 'counts', 'stop time', 'stop distance'], rows

    def laws(self, actuator: str) -> Table:
        """Every law's figures: median and 10th and 90th percentile, and the shares of the criteria."""
        rows, head = [], []
        for plant in PLANTS:
            for name in self.names:
                result = self.found[plant, actuator, name]
                shares = result.verdict.shares()
                head = ['plant', 'law', 'counts', *map(heading_of, SHOWN), *(f'{criterion} / %' for criterion in shares)]
                cells = [plant, name, 'no' if name in BASELINES and not result.counts else 'yes']
                for figure, digits in SHOWN.items():
                    low, median, high = np.nanquantile(result.varied(figure), (0.1, 0.5, 0.9))
                    cells.append(f'{median:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]')
                rows.append([*cells, *(f'{100 * share:.0f}' for share in shares.values())])
        return head, rows


def _span(one: Map, name: str) -> str:
    least, _, most = one.span(name)
    return '' if np.isnan(least) else f'{least:.3f} to {most:.3f}'


def bare(cell: str) -> str:
    """Without its interval, which the CSV file has."""
    return re.sub(r' \[.*\]$', '', cell)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    rule = '|' + '---|' * len(head)
    return '\n'.join(['| ' + ' | '.join(head) + ' |', rule, *('| ' + ' | '.join(row) + ' |' for row in rows)])


def csv_text(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """CSV in which a column of "value [low, high]" is three columns."""
    found = [[re.match(r'(\S+) \[(\S+), (\S+)\]$', cell) for cell in row] for row in rows]
    three = [any(column) for column in zip(*found)]

    def wide(cells: Sequence[str], parts: Sequence[Sequence[str]]) -> list[str]:
        return [text for cell, of, is_three in zip(cells, parts, three) for text in (of if is_three else [cell])]

    text = io.StringIO()
    write = csv.writer(text, lineterminator='\n').writerow
    write(wide(head, [[name, f'{name}: low', f'{name}: high'] for name in head]))
    for row, matches in zip(rows, found):
        write(wide(row, [match.groups() if match else [cell, '', ''] for cell, match in zip(row, matches)]))
    return text.getvalue()
