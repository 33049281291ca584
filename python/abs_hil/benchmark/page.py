"""The result of the benchmark as text, Markdown and JSON."""
from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from typing import Any

from . import bounds, cases
from .cases import VERSION
from .score import Result, Score

_COLUMNS = [field for field in dataclasses.fields(Score) if field.metadata]
HEADINGS = tuple(field.metadata['heading'] for field in _COLUMNS)


def _number(value: float, decimals: int) -> str:
    return '–' if math.isnan(value) else f'{value:.{decimals}f}'


def _cells(score: Score) -> list[str]:
    return [_number(field.metadata['scale'] * getattr(score, field.name), field.metadata['decimals']) for field in _COLUMNS]


def ranked(results: Sequence[Result], group: str = 'all') -> list[tuple[str, Score]]:
    """The controllers' scores: the best mean excess first, those with failed runs last."""
    scores = [(result.entry.label, next(score for score in result.scores if score.group == group)) for result in results]
    scores.sort(key=lambda pair: (pair[1].failed > 0, math.inf if math.isnan(pair[1].excess_mean) else pair[1].excess_mean))
    return scores


def cells(results: Sequence[Result], group: str = 'all') -> list[list[str]]:
    """The rows of a table: a controller's name and its figures."""
    return [[name, *_cells(score)] for name, score in ranked(results, group)]


def table(results: Sequence[Result], group: str = 'all') -> str:
    """A Markdown table with a row for each controller."""
    lines = ['| controller | ' + ' | '.join(HEADINGS) + ' |', '|---' + '|---:' * len(HEADINGS) + '|']
    lines += [f'| `{name}` | ' + ' | '.join(figures) + ' |' for name, *figures in cells(results, group)]
    return '\n'.join(lines) + '\n'


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
    def known(value: Any) -> Any:
        return None if isinstance(value, float) and math.isnan(value) else value

    document = {'benchmark': 'abs_hil', 'version': VERSION, 'set': cases.checksum(), 'bounds': bounds.checksum(bounds.stored()),
                'whole': whole, 'program': program, 'controllers': [
        {'name': result.entry.name, 'warm': result.entry.warm, 'settings': dict(result.entry.settings),
         'scores': [{key: known(value) for key, value in score.as_row().items()} for score in result.scores],
         'runs': [{key: known(value) for key, value in row.items()} for row in result.rows]} for result in results]}
    return json.dumps(document, indent=1, ensure_ascii=False) + '\n'
