"""The command line of abs_report: reads the runs once, makes figures, tables and the page."""
import argparse
import contextlib
import io
import pathlib
import re
import sys
from collections.abc import Callable, Sequence
from typing import Any

from .. import parsers
from ..compare import aligned
from ..core import _core
from ..files import refuse_existing, write_text, write_whole
from ..options import failed
from ..parsers import EXPORTS
from ..places import misfit
from ..simulation import progress_shown
from . import paper, pictures, tables
from .export import Exporter
from .figures import Choice, Options, run_figures, timing_figure
from .files import FoundRuns, RunFiles, find_runs
from .model import STYLES, Figure
from .page import PAGE_MARK, page
from .series import SeriesStudy, group_table, series_figure, series_table, study
from .survey import Survey
from .tables import Table, merits
from .text import clean

MOST_NOTES = 10
_MARK_BYTES = 4096


def _title(found: FoundRuns, of_paper: bool) -> str:
    runs = found.runs
    if of_paper:
        return 'The paper’s comparison: figures 5 to 10'
    if found.series:
        return f'Series {found.series[0][0]}'
    if len(runs) == 1:
        return f'Run {runs[0].label}' if runs[0].label == runs[0].called else f'Run {runs[0].name}: {runs[0].label}'
    if len(runs) == 2:
        return f'Runs {runs[0].label} and {runs[1].label}'
    return f'{len(runs)} runs, {runs[0].label} to {runs[-1].label}'


def _lead(runs: list[RunFiles]) -> str:
    names = list(dict.fromkeys(name for run in runs if (name := run.text('experiment'))))
    lead = f'{len(runs)} run{"" if len(runs) == 1 else "s"}'
    return f'{lead}, experiment{"" if len(names) == 1 else "s"} {", ".join(names)}' if names else lead


def _groups(studies: list[SeriesStudy], runs: int) -> tuple[list[int], list[str]]:
    """Of runs of one series: a style for each varied value, if the palette has enough colours; and what each style means."""
    if len(studies) != 1 or len(studies[0].groups) > STYLES or sum(len(g.runs) for g in studies[0].groups) != runs:
        return [], []
    style_of = {run: number for number, group in enumerate(studies[0].groups) for run in group.runs}
    return [style_of[run] for run in range(runs)], [group.label for group in studies[0].groups]


def make(paths: Sequence[Any], labels: Sequence[str], title: str, choice: Choice, of_paper: bool,
         progress: Callable[[int, int], None] | None = None) -> tuple[list[RunFiles], list[Survey], list[Figure], dict[str, Any]]:
    """Reads the runs (run folders, CSV files, series folders). Returns them, what their rows say, all figures in the order of the
    page, and what the page shows, by the names of its template. Raises ValueError for what cannot be used."""
    found = find_runs(paths, labels)
    runs = found.runs
    if of_paper:
        paper.order_for_paper(runs, found.notes)
    studies = [study(*series, runs) for series in found.series]
    surveys, figures = run_figures(runs, Options(choice, of_paper, *_groups(studies, len(runs))), progress)
    series: list[dict[str, Any]] = [
        {'name': one.name, 'figure': series_figure(number, one, runs, surveys), 'groups': group_table(one, runs, surveys),
         'table': series_table(one, runs, surveys)} for number, one in enumerate(studies, 1)]
    timing = timing_figure(runs)
    metrics, shared = tables.metrics_table(runs, surveys)
    events, left_out = tables.events_table(runs, surveys)
    pairs = paper.pairs_of(runs, surveys) if of_paper else {}
    parts = {'title': clean(title) or _title(found, of_paper), 'version': _core.version,
             'lead': paper.lead(runs) if of_paper else _lead(runs), 'runs': len(runs), 'figures': figures, 'series': series,
             'paper': {'claims': paper.claims(pairs), 'less': f'{-paper.CLAIMED_PER_CENT:g} %', **pairs} if of_paper else None,
             'metrics': metrics, 'shared': shared, 'phases': tables.phases_table(runs, surveys), 'events': events,
             'events_left_out': left_out, 'differences': tables.differences_table(runs), 'timing': tables.timing_table(runs),
             'timing_figure': timing, 'environment': tables.environment_table(runs),
             'notes': tables.all_notes(runs, surveys, found.notes)}
    return runs, surveys, [*(part['figure'] for part in series), *figures, *([timing] if timing is not None else [])], parts


def _choice(text: str) -> Choice:
    if text in ('brake', 'run'):
        return text
    number = r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'
    if (found := re.fullmatch(f'({number}):({number})', text)) and float(found[1]) < float(found[2]):
        return float(found[1]), float(found[2])
    raise ValueError(f'--window {text}: give brake, run, or FROM:TO in seconds with FROM < TO')


def _say(notes: list[str]) -> None:
    more = [f'and {len(notes) - MOST_NOTES} more'] * (len(notes) > MOST_NOTES)
    for note in notes[:MOST_NOTES] + more:
        print(f'abs_report: note: {clean(note, 1000)}', file=sys.stderr)


def _check_replaceable(path: pathlib.Path, replace: bool) -> None:
    if replace or not path.is_file():  # a device or a pipe keeps nothing
        return
    with open(path, 'rb') as file:
        if PAGE_MARK.encode() in file.read(_MARK_BYTES):
            return
    raise ValueError(f'"{path}" exists and is not a report of abs_report; give another --out, or --force to replace it')


def _export(o: argparse.Namespace, columns: list[str]) -> None:
    exporter = Exporter(find_runs(o.runs, o.labels).runs, columns)
    if o.output:
        path = pathlib.Path(o.output)
        refuse_existing(path, '--out', o.force)

        def write(name: str) -> None:
            with open(name, 'wb') as file:
                exporter.write(o.export, file)
        write_whole(path, write)
    else:
        if o.export in ('octave', 'parquet') and sys.stdout.isatty():
            raise ValueError(f'--{o.export} writes a binary file: give --out FILE or redirect stdout')
        whole = io.BytesIO()  # a MAT-file is not written in one go
        exporter.write(o.export, whole)
        with contextlib.suppress(OSError):  # abs_hil.programs tells it
            sys.stdout.buffer.write(whole.getbuffer())
            sys.stdout.buffer.flush()
    _say(exporter.notes)


def _plain(table: Table) -> str:
    return aligned([table.header, *table.rows], '', '  ')


def _report(o: argparse.Namespace) -> None:
    path = pathlib.Path(o.output or 'report.html')
    choice = _choice(o.window)
    if not o.table:
        _check_replaceable(path, o.force)
    if o.merits:
        refuse_existing(o.merits, '--merits', o.force)
    with progress_shown(sys.stderr.isatty()) as progress:
        runs, surveys, figures, parts = make(o.runs, o.labels, o.title, choice, o.paper, progress)
    if o.merits:
        write_whole(o.merits, lambda name: merits(runs, surveys).to_csv(name, index=False, na_rep='NaN'))
    if o.table:
        print(*(_plain(table) for table in (*(part['groups'] for part in parts['series']), parts['metrics'])), sep='\n', end='')
    else:
        write_text(path, page(**parts))
    _say(parts['notes'])
    for made in [str(path)] * (not o.table) + [o.merits] * bool(o.merits):
        print(made, file=sys.stderr if '-' in (str(path), o.merits) else sys.stdout)  # "-" is stdout
    if o.figures:
        print(*pictures.write(figures, pathlib.Path(o.figures), o.format or 'svg', o.force), sep='\n')


def _report_study(o: argparse.Namespace) -> None:
    from ..studies import page as of_study
    results = of_study.results_of(o)
    if o.table:
        print(_plain(of_study.quantile_table(results)), end='')
        return
    path = pathlib.Path(o.output or ('study.parquet' if o.export else 'report.html'))
    if o.export:
        refuse_existing(path, '--out', o.force)
        results.to_parquet(path)
    else:
        _check_replaceable(path, o.force)
        write_text(path, of_study.page_of(o, results))
    print(path)


def main(arguments: list[str]) -> int:
    o = parsers.report().parse_args(arguments)
    of_study = any((pathlib.Path(run) / 'study.json').exists() or run.endswith('results.csv.gz') for run in o.runs)
    columns = [name for names in o.columns for name in names.split(',') if name]
    try:
        if columns and not o.export:
            raise ValueError('--columns selects columns to export: also give '
                             + ', '.join(f'--{name}' for name in EXPORTS[:-1]) + f' or --{EXPORTS[-1]}')
        if o.columns and not columns:
            raise ValueError('--columns names none: give names of columns, or leave it out to export all')
        if o.format and not o.figures:
            raise ValueError('--format is the format of the figures: also give --figures')
        if o.export and (o.paper or o.figures or o.table or o.merits):
            raise ValueError('--paper, --figures, --table and --merits show runs; --csv, --json, --octave and --parquet '
                             'export rows; give one kind only')
        if o.output and not o.table:
            parsers.to_write({None: '.html', 'octave': '.mat'}.get(o.export, f'.{o.export}'))(o.output)
        if o.metrics and not of_study:
            raise ValueError('--metric: only the page of a study has curves and maps of metrics')
        if of_study:
            _report_study(o)
        elif o.export:
            _export(o, columns)
        else:
            _report(o)
    except (ValueError, OSError, argparse.ArgumentTypeError) as error:
        return failed('abs_report', error if misfit(error) else clean(error, 4000))
    return 0
