"""A report of runs: reads them once, makes figures, tables and the page."""
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..core import _core
from . import paper, tables
from .figures import Choice, Options, run_figures
from .files import FoundRuns, RunFiles, find_runs
from .model import STYLES, Figure
from .page import page
from .series import SeriesStudy, group_table, series_figure, series_table, study
from .survey import Survey
from .text import clean
from .timing import timing_figure


@dataclass
class Report:
    """figures: all of them, in the order of the page; parts: what the page shows, by the names of its template."""
    runs: list[RunFiles]
    surveys: list[Survey]
    figures: list[Figure]
    parts: dict[str, Any]

    def html(self) -> str:
        return page(**self.parts)


def _title(found: FoundRuns, of_paper: bool) -> str:
    runs = found.runs
    if of_paper:
        return 'The paper’s comparison: figures 5 to 10'
    if found.series:
        return f'Series {found.series[0].name}'
    if len(runs) == 1:
        return f'Run {runs[0].label}' if runs[0].label == runs[0].called else f'Run {runs[0].name}: {runs[0].label}'
    if len(runs) == 2:
        return f'Runs {runs[0].label} and {runs[1].label}'
    return f'{len(runs)} runs, {runs[0].label} to {runs[-1].label}'


def _lead(runs: list[RunFiles]) -> str:
    names = list(dict.fromkeys(name for run in runs if (name := run.text('experiment'))))
    lead = f'{len(runs)} run{"" if len(runs) == 1 else "s"}'
    return f'{lead}, experiment{"" if len(names) == 1 else "s"} {", ".join(names)}' if names else lead


def _groups(studies: list[SeriesStudy], runs: int, options: Options) -> None:
    """Gives runs of one series a style for each varied value, if the palette has enough colours."""
    if len(studies) != 1 or len(studies[0].groups) > STYLES or sum(len(g.runs) for g in studies[0].groups) != runs:
        return
    options.groups = [0] * runs
    for number, group in enumerate(studies[0].groups):
        options.group_labels.append(group.label)
        for run in group.runs:
            options.groups[run] = number


def make(paths: Sequence[Any], labels: Sequence[str], title: str, choice: Choice, of_paper: bool,
         progress: Callable[[int, int], None] | None = None) -> Report:
    """Reads the runs (run folders, CSV files, series folders) and makes the report. Raises ValueError for what cannot be
    used."""
    found = find_runs(paths, labels)
    runs = found.runs
    if of_paper:
        paper.order_for_paper(runs, found.notes)
    studies = [study(series, runs) for series in found.series]
    options = Options(choice, of_paper)
    _groups(studies, len(runs), options)
    surveys, figures = run_figures(runs, options, progress)
    series: list[dict[str, Any]] = [
        {'name': one.name, 'figure': series_figure(number, one, runs, surveys), 'groups': group_table(one, runs, surveys),
         'table': series_table(one, runs, surveys)} for number, one in enumerate(studies, 1)]
    timing = timing_figure(runs)
    metrics, shared = tables.metrics_table(runs, surveys)
    events, left_out = tables.events_table(runs, surveys)
    pairs = paper.pairs_of(runs, surveys) if of_paper else {}
    parts = {'title': clean(title) or _title(found, of_paper), 'version': _core.version,
             'lead': paper.lead(runs) if of_paper else _lead(runs), 'runs': len(runs), 'figures': figures, 'series': series,
             'paper': {'claims': paper.claims(pairs), 'statements': paper.statements(pairs)} if of_paper else None,
             'metrics': metrics, 'shared': shared, 'phases': tables.phases_table(runs, surveys), 'events': events,
             'events_left_out': left_out, 'differences': tables.differences_table(runs), 'timing': tables.timing_table(runs),
             'timing_figure': timing, 'environment': tables.environment_table(runs),
             'notes': tables.all_notes(runs, surveys, found.notes)}
    every: list[Figure] = [*(part['figure'] for part in series), *figures, *([timing] if timing is not None else [])]
    return Report(runs, surveys, every, parts)
