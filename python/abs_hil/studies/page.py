"""The page that abs_report makes of a study: quantiles, curves, maps, Sobol indices."""
import argparse
import pathlib

from ..core import _core
from ..figures import figures, heading_of
from ..messages import REASONS
from ..report.page import render
from ..report.tables import Table
from ..report.text import DASH, rounded, significant
from .figures import curve_names, curves, distributions, groups_of, maps, numeric_factors, title_of
from .results import StudyResults, load_study

_FOLDER = pathlib.Path(__file__).parent
WORST = 3  # runs of each metric
#: whose curves and maps the page shows, if no metric is asked for
SHOWN = ('stop_distance_m', 'slip_rms', 'torque_total_variation_Nm')
#: options of abs_report that are about the rows of runs
_OF_RUNS = ('labels', 'paper', 'figures', 'format', 'merits', 'columns')


def quantile_table(results: StudyResults) -> Table:
    """Median and, in brackets, 10th and 90th percentile of each metric; a column for each group."""
    results.columns(results.facts['columns'])  # all of them in one reading of the file
    by = curve_names(results)
    every = dict(groups_of(results.columns([*by, 'result']), by))
    rows = []
    for metric in results.metrics:
        row = [heading_of(metric)]
        complete = dict(groups_of(results.completed([*by, metric]), by))
        for name in every:
            values = complete[name][metric].dropna() if name in complete else None
            if values is None or values.empty:
                row.append(DASH)
                continue
            low, median, high = values.quantile([0.1, 0.5, 0.9])
            texts = rounded([median, low, high], high - low)
            row.append(f'{texts[0]} [{texts[1]}, {texts[2]}]')
        rows.append(row)
    for title, result in (('runs ended by a fault', 'fault'), ('runs that could not begin', 'refused')):
        rows.append([title, *(str(int((part['result'] == result).sum())) for part in every.values())])
    rows.append(['runs', *(str(len(part)) for part in every.values())])
    return Table('quantiles', ['median [10 %, 90 %]', *(name or results.facts['study'] for name in every)], rows)


def sobol_table(results: StudyResults, metrics: list[str]) -> tuple[Table, list[str]]:
    """First-order and total index of each factor, for each metric and controller; and what could not be computed."""
    rows, notes = [], []
    by = results.groups
    for metric in metrics:
        for name, part in groups_of(results.columns(by), by):
            where = {key: part[key].iloc[0] for key in by}
            try:
                found = results.sobol_indices(metric, where)
            except ValueError as error:
                notes.append(f'{", ".join(filter(None, (heading_of(metric), name)))}: {error}')
                continue
            for factor, row in found.iterrows():
                rows.append([heading_of(metric), name or DASH, title_of(str(factor)),
                             *(' ± '.join(rounded([row[index], row[f'{index}_conf']], row[f'{index}_conf']))
                               for index in ('S1', 'ST'))])
    return Table('sobol', ['metric', 'of', 'factor', 'first order', 'total'], rows, False), notes


def reasons_table(results: StudyResults) -> Table:
    counts = results.columns(['reason'])['reason'].value_counts()
    words = {row['name']: row['text'] for row in REASONS.values()}
    return Table('reasons', ['reason', 'runs'], [[words.get(str(reason), str(reason)), str(count)]
                                                 for reason, count in counts.items() if reason])


def worst_table(results: StudyResults, metrics: list[str]) -> Table:
    """The completed runs with the largest values of metrics of which less is better."""
    names = ['run', *curve_names(results), *numeric_factors(results)]
    rows = []
    for metric in metrics:
        if metric in figures() and figures()[metric].better == 'less':
            for _, row in results.completed([*names, metric]).nlargest(WORST, metric).iterrows():
                rows.append([heading_of(metric), significant(row[metric], 4),
                             *(value if isinstance(value := row[name], str) else f'{value:.5g}' for name in names)])
    return Table('worst', ['of', 'value', *(title_of(name) for name in names)], rows, False)


def page(results: StudyResults, metrics: list[str], title: str = '') -> str:
    """The page as HTML that needs no network. metrics: whose curves and maps it shows."""
    sobol, notes = Table('sobol', [], []), list[str]()
    if results.facts['design'] == 'saltelli':
        sobol, notes = sobol_table(results, metrics)
    drawings = [drawing for metric in metrics for drawing in (curves(results, metric), maps(results, metric)) if drawing]
    if not numeric_factors(results) and (drawing := distributions(results, results.metrics)):
        drawings.append(drawing)
    return render('study.html.j2', [drawing.plot for drawing in drawings], _FOLDER,
                  version=_core.version, title=title or f'Study {results.facts["study"]}', facts=results.facts,
                  description=results.facts['description'], quantiles=quantile_table(results), sobol=sobol,
                  worst=worst_table(results, metrics), reasons=reasons_table(results), drawings=drawings, notes=notes)


def results_of(o: argparse.Namespace) -> StudyResults:
    """The one study of the command line. Raises ValueError."""
    if len(o.runs) != 1:
        raise ValueError('a study has a page of its own; give its folder alone')
    for name in _OF_RUNS:
        if getattr(o, name):
            raise ValueError(f'--{name.removesuffix("s") if name == "labels" else name}: a study has no rows of single runs; '
                             'leave it out, or record a run with `abs_hil study FILE --run K`')
    if o.export not in (None, 'parquet'):
        raise ValueError(f'--{o.export}: the results of a study are compressed CSV as they are; --parquet makes Parquet of them')
    return load_study(o.runs[0])


def page_of(o: argparse.Namespace, results: StudyResults) -> str:
    metrics = [name for names in o.metrics for name in names.split(',')] or [name for name in SHOWN if name in results.metrics]
    for name in metrics:
        if name not in results.metrics:
            raise ValueError(f'--metric {name}: the study has {", ".join(results.metrics)}')
    return page(results, metrics, o.title)
