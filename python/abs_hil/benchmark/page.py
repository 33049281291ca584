"""The result of the benchmark as text, Markdown and JSON, and as one HTML page that needs no network."""
import dataclasses
import json
import math
import pathlib
from collections.abc import Sequence

import numpy as np

from ..compare import in_markdown
from ..core import _core
from ..report.model import STYLES, Curve, Figure, Label, Panel, run_style
from ..report.page import render, view
from ..report.tables import Table
from . import bounds, cases
from .cases import VERSION
from .score import Result, Score

_COLUMNS = [field for field in dataclasses.fields(Score) if field.metadata]
HEADINGS = tuple(field.metadata['heading'] for field in _COLUMNS)
_FOLDER = pathlib.Path(__file__).parent
_MARKERS = ('circle', 'triangle', 'open circle')
#: excess beyond this is drawn at the edge
_MOST_EXCESS = 0.5


def _cell(value: float, scale: float, decimals: int, **_: object) -> str:
    return '–' if math.isnan(value) else f'{scale * value:.{decimals}f}'


def ranked(results: Sequence[Result], group: str = 'all') -> list[tuple[str, Score]]:
    """The controllers' scores: the best mean excess first, those with failed runs last."""
    scores = [(result.entry.label, next(score for score in result.scores if score.group == group)) for result in results]
    scores.sort(key=lambda pair: (pair[1].failed > 0, math.inf if math.isnan(pair[1].excess_mean) else pair[1].excess_mean))
    return scores


def cells(results: Sequence[Result], group: str = 'all') -> list[list[str]]:
    """The rows of a table: a controller's name and its figures."""
    return [[name, *(_cell(getattr(score, field.name), **field.metadata) for field in _COLUMNS)]
            for name, score in ranked(results, group)]


def table(results: Sequence[Result], group: str = 'all') -> str:
    """A Markdown table with a row for each controller."""
    return in_markdown([['controller', *HEADINGS], *([f'`{name}`', *figures] for name, *figures in cells(results, group))])


def title(whole: bool) -> str:
    return f'abs_hil benchmark, version {VERSION}' + ('' if whole else ' (a part of the set: no score of the benchmark)')


def text(results: Sequence[Result], whole: bool) -> str:
    """A page in Markdown: all cases, then each group, then each controller's worst case."""
    parts = [f'# {title(whole)}\n', table(results)]
    for score in results[0].scores[:-1]:
        parts += [f'## {score.group}\n', table(results, score.group)]
    parts += ['## Worst cases\n', '\n'.join(f'- `{result.entry.label}`: {result.total.worst_case}' for result in results) + '\n']
    return '\n'.join(parts)


def as_json(results: Sequence[Result], whole: bool, program: str) -> str:
    document = {'benchmark': 'abs_hil', 'version': VERSION, 'set': cases.checksum(), 'bounds': bounds.checksum(bounds.stored()),
                'whole': whole, 'program': program, 'controllers': [
        {'name': result.entry.name, 'warm': result.entry.warm, 'settings': dict(result.entry.settings),
         'scores': [vars(score) for score in result.scores], 'runs': result.rows} for result in results]}
    known = json.loads(json.dumps(document), parse_constant=lambda _: None)  # JSON has no NaN
    return json.dumps(known, indent=1, ensure_ascii=False) + '\n'


def _standing(results: Sequence[Result]) -> Figure:
    curves = []
    for number, (name, score) in enumerate(ranked(results)):
        if not np.isnan(score.excess_mean):
            curves.append(Curve(0, name, run_style(number), np.array([max(score.variation_median_Nm, 1.0)]),
                                np.array([max(100.0 * score.excess_mean, 0.1)]), drawn='markers',
                                marker=_MARKERS[number // STYLES % len(_MARKERS)], legend=name, group=name))
    return Figure('standing', 'Distance and what it costs the brake', Label.plain('torque variation in the median, N m'),
                  [Panel(Label.plain('mean excess, %'), curves, height_px=360.0, log=True)],
                  caption='Braking distance over the causal optimum, and the variation of the commanded torque in a stop. '
                          'Lower left is better.')


def _shares(results: Sequence[Result]) -> Figure:
    by_name = {result.entry.label: result for result in results}
    curves = []
    for number, (name, _) in enumerate(ranked(results)):
        excess = np.array([row['excess'] for row in by_name[name].rows])
        excess = np.sort(np.where(np.isnan(excess), np.inf, excess))
        share = 100.0 * (np.arange(len(excess)) + 1.0) / len(excess)
        seen = excess <= _MOST_EXCESS
        curves.append(Curve(0, name, run_style(number), 100.0 * excess[seen], share[seen], legend=name, group=name))
    return Figure('shares', 'Share of the runs', Label.plain('excess, %'),
                  [Panel(Label.plain('share of the runs within it, %'), curves, height_px=320.0, y_range=(0.0, 100.0))],
                  caption='How many runs stop within an excess of the causal optimum. Runs that fail stay out of reach.',
                  x_range=(0.0, 100.0 * _MOST_EXCESS))


def html(results: Sequence[Result], whole: bool) -> str:
    """Raises Unavailable without plotly.js."""
    figures = [_standing(results), _shares(results)]
    header = ['controller', *HEADINGS]
    groups = [(score.group, Table(f'group-{score.group}', header, cells(results, score.group)))
              for score in results[0].scores[:-1]]
    worst = Table('worst', ['controller', 'worst case', 'excess %'],
                  [[name, score.worst_case, '–' if np.isnan(score.excess_worst) else f'{100.0 * score.excess_worst:.1f}']
                   for name, score in ranked(results)])
    return render('benchmark.html.j2', figures, _FOLDER, version=_core.version, title=title(whole),
                  all=Table('all', header, cells(results)), groups=groups, worst=worst,
                  settings=[(result.entry.label, ', '.join(f'{key} = {value}' for key, value in result.entry.settings.items()))
                            for result in results if result.entry.settings],
                  figures=[view(figure) for figure in figures])
