"""The page that abs_report makes of a study: quantiles, curves over one factor, maps over two, distributions, Sobol indices."""
import argparse
import html
import itertools
import pathlib
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pandas

from ..core import _core
from ..merits import figures, heading_of, with_unit
from ..messages import REASONS
from ..report.model import run_style
from ..report.page import render
from ..report.plots import numbers
from ..report.tables import Table
from ..report.text import DASH, rounded, significant
from .results import StudyResults, _binned, load_study

_FOLDER = pathlib.Path(__file__).parent
WORST = 3  # runs of each metric
#: whose curves and maps the page shows, if no metric is asked for
SHOWN = ('stop_distance_m', 'slip_rms', 'torque_total_variation_Nm')
#: options of abs_report that are about the rows of runs
_OF_RUNS = ('labels', 'paper', 'figures', 'format', 'merits', 'columns')
LEAST_BINS, MOST_BINS, MOST_BINS_OF_CURVE = 4, 60, 16
#: levels up to this many are cells of their own: a map is as fine as its design
MOST_LEVELS = 400
#: points in a part of a curve
POINTS_IN_BIN = 8
MOST_FACTORS, MOST_PAIRS, MOST_CURVES = 6, 3, 7
BINS_OF_DISTRIBUTION = 40
CELL_PX, TOP_PX, BOTTOM_PX = 260.0, 46.0, 56.0


@dataclass
class Cell:
    """One pair of axes. title: of the runs that it shows."""
    traces: list[dict[str, Any]]
    x: str
    y: str
    title: str = ''
    log: tuple[bool, bool] = (False, False)


@cache
def title_of(key: str) -> str:
    """What a factor is, with its unit: "peak tyre force / N". A key without a meaning is its own title."""
    meaning, unit = next(((row['meaning'], row['unit']) for row in _core.keys({}) if row['name'] == key), ('', ''))
    short = meaning.removeprefix('simulation: ').partition(',')[0].partition(';')[0].partition(':')[0].strip()
    return with_unit(short, unit) or key


def numeric_factors(results: StudyResults) -> list[str]:
    """Factors that have more than one value and are numbers."""
    columns = results.columns(results.factors)
    return [name for name in results.factors if np.issubdtype(columns[name].dtype, np.number) and columns[name].nunique() > 1]


def curve_names(results: StudyResults) -> list[str]:
    """What tells curves apart: plants, experiments, controllers, and levels that are no numbers."""
    numeric = set(numeric_factors(results))
    return [name for name in results.groups if name not in numeric]


def groups_of(frame: pandas.DataFrame, by: list[str]) -> list[tuple[str, pandas.DataFrame]]:
    """(name, rows) of each group; one of all rows without columns."""
    if not by:
        return [('', frame)]
    return [(', '.join(str(value) if '.' not in name else f'{title_of(name)} = {value}'
                       for name, value in zip(by, key if isinstance(key, tuple) else (key,))), part)
            for key, part in frame.groupby(by if len(by) > 1 else by[0], observed=True, sort=False)]


def _told_apart(frame: pandas.DataFrame, by: list[str]) -> list[tuple[str, pandas.DataFrame]]:
    """The groups that have a curve, their names as plotly.js reads them."""
    return [(html.escape(name, quote=False), part) for name, part in groups_of(frame, by)[:MOST_CURVES]]


def _bins(results: StudyResults, factor: str, wanted: float, most: int) -> int:
    """Cells along a factor: its levels, or as many parts of its range as the runs can fill."""
    return MOST_LEVELS if factor in results.levels else int(np.clip(wanted, LEAST_BINS, most))


def _is_log(values: np.ndarray) -> bool:
    values = np.sort(np.unique(values))
    if len(values) < 3 or values[0] <= 0.0:
        return False
    steps = np.diff(np.log(values))
    return bool(np.allclose(steps, steps[0], rtol=1e-3) and steps[0] > 1e-3 and values[-1] / values[0] > 3.0
                and not np.allclose(np.diff(values), values[1] - values[0], rtol=1e-3))


def _band(colour: str) -> str:
    return f'rgba({", ".join(str(int(colour[at:at + 2], 16)) for at in (1, 3, 5))}, 0.15)'


def _drawing(id_: str, heading: str, caption: str, cells: list[Cell], columns: int, **layout: Any) -> dict[str, Any]:
    """What the template shows of cells beside and below each other, each with axes of its own."""
    rows = -(-len(cells) // columns)
    legend = 22.0 if any(trace.get('showlegend') for cell in cells for trace in cell.traces) else 0.0
    height = rows * (CELL_PX + TOP_PX + BOTTOM_PX) + legend
    layout.update(hovermode='closest', annotations=[], shapes=[], margin={'l': 0, 'r': 90, 't': legend, 'b': 0},
                  legend={'orientation': 'h', 'x': 0.05, 'y': 1, 'yanchor': 'bottom'})
    data = []
    for number, cell in enumerate(cells, 1):
        suffix = str(number) if number > 1 else ''
        row, column = divmod(number - 1, columns)
        left, top = (column + 0.2) / columns, 1.0 - (row + TOP_PX / (CELL_PX + TOP_PX + BOTTOM_PX)) / rows
        bottom = 1.0 - (row + 1.0 - BOTTOM_PX / (CELL_PX + TOP_PX + BOTTOM_PX)) / rows
        for letter, other, domain, title, log in (('x', 'y', [left, (column + 0.95) / columns], cell.x, cell.log[0]),
                                                  ('y', 'x', [bottom, top], cell.y, cell.log[1])):
            layout[f'{letter}axis{suffix}'] = {'domain': domain, 'anchor': f'{other}{suffix}', 'type': 'log' if log else 'linear',
                                               'title': {'text': title, 'standoff': 6, 'font': {'size': 13}}}
        if cell.title:
            layout['annotations'].append({'x': left, 'y': top, 'xref': 'paper', 'yref': 'paper', 'yanchor': 'bottom',
                                          'xanchor': 'left', 'text': cell.title, 'showarrow': False, 'font': {'size': 13}})
        data += [{**trace, 'xaxis': f'x{suffix}', 'yaxis': f'y{suffix}'} for trace in cell.traces]
    told = '; '.join(dict.fromkeys(f'{cell.y} over {cell.x}{" of " if cell.title else ""}{cell.title}' for cell in cells))
    return {'id': id_, 'heading': heading, 'caption': caption, 'alternative': f'{heading}: {told}', 'height': height,
            'plot': {'id': id_, 'axis': id_, 'height': height, 'data': data, 'layout': layout}}


def curves(results: StudyResults, metric: str) -> dict[str, Any] | None:
    """Medians over each factor, and between which values 80 % of the runs lie; None without factors."""
    factors = numeric_factors(results)[:MOST_FACTORS]
    by = curve_names(results)
    frame = results.completed([*by, *factors, metric])
    if not factors or not frame[metric].notna().any():
        return None
    groups = _told_apart(frame, by)
    points = int(results.columns(['point'])['point'].nunique())
    cells = []
    for factor in factors:
        cell = Cell([], title_of(factor), heading_of(metric), log=(_is_log(frame[factor].to_numpy()), False))
        bins = _bins(results, factor, points / POINTS_IN_BIN, MOST_BINS_OF_CURVE)
        for number, (name, part) in enumerate(groups):
            found = part.groupby(_binned(part[factor], bins))[metric].quantile([0.1, 0.5, 0.9]).unstack()
            x, style = numbers(found.index.to_numpy()), run_style(number)
            shared = {'x': x, 'legendgroup': name, 'mode': 'lines', 'hoverinfo': 'skip', 'showlegend': False}
            line = {'width': 0, 'color': style.colour}
            cell.traces += [
                {**shared, 'y': numbers(found[0.1].to_numpy()), 'line': line},
                {**shared, 'y': numbers(found[0.9].to_numpy()), 'line': line, 'fill': 'tonexty',
                 'fillcolor': _band(style.colour)},
                {'x': x, 'y': numbers(found[0.5].to_numpy()), 'mode': 'lines+markers', 'name': name, 'legendgroup': name,
                 'line': {'color': style.colour, 'simplify': False}, 'marker': {'size': 4, 'color': style.colour},
                 'showlegend': len(groups) > 1 and factor == factors[0],
                 'hovertemplate': f'{name} {heading_of(metric)}: %{{y:.4~g}}<br>{title_of(factor)}: %{{x:.4~g}}<extra></extra>'}]
        cells.append(cell)
    return _drawing(f'curves-{metric}', heading_of(metric),
                    'Median over each factor, whatever the others are; 80 % of the runs lie in the band.', cells,
                    min(3, len(cells)))


def maps(results: StudyResults, metric: str) -> dict[str, Any] | None:
    """Medians over pairs of factors, a row of maps for each controller; None with fewer than two factors."""
    pairs = list(itertools.combinations(numeric_factors(results), 2))[:MOST_PAIRS]
    by = curve_names(results)
    frame = results.columns([*dict.fromkeys([*by, *itertools.chain(*pairs)]), 'result', metric])
    if not pairs or not frame[metric].notna().any():
        return None
    groups = _told_apart(frame, by)
    wanted = np.sqrt(len(frame) / len(groups) / 2)
    cells = []
    for (name, part), (x, y) in itertools.product(groups, pairs):
        place = [_binned(part[y], _bins(results, y, wanted, MOST_BINS)), _binned(part[x], _bins(results, x, wanted, MOST_BINS))]
        success = (part['result'] == 'completed').astype(float).groupby(place).mean().unstack()
        table = part[metric].where(part['result'] == 'completed').groupby(place).median().unstack()
        at = {'x': numbers(table.columns.to_numpy()), 'y': numbers(table.index.to_numpy())}
        traces: list[dict[str, Any]] = [
            {**at, 'type': 'heatmap', 'z': numbers(table.to_numpy(), 'f4'), 'coloraxis': 'coloraxis', 'hoverongaps': False,
             'hovertemplate': f'{heading_of(metric)}: %{{z:.4~g}}<br>{title_of(x)}: %{{x:.4~g}}<br>{title_of(y)}: %{{y:.4~g}}'
                              '<extra></extra>'}]
        if min(success.shape) > 1 and np.nanmin(success) < 0.5 <= np.nanmax(success):
            traces.append({**at, 'type': 'contour', 'z': numbers(success.to_numpy(), 'f4'), 'hoverinfo': 'skip',
                           'showscale': False, 'showlegend': False,
                           'contours': {'start': 0.5, 'end': 0.5, 'size': 1.0, 'coloring': 'none'},
                           'name': 'border of success', 'line': {'color': '#D55E00', 'width': 2.5, 'smoothing': 0}})
        cells.append(Cell(traces, title_of(x), title_of(y), name, (_is_log(part[x].to_numpy()), _is_log(part[y].to_numpy()))))
    low, high = frame[metric].quantile([0.02, 0.98])
    drawing = _drawing(f'maps-{metric}', heading_of(metric),
                    'Median over two factors, whatever the others are. Empty: no run was completed there. Outside the orange '
                    'line, where there is one, fewer than half of the runs were completed.', cells, len(pairs),
                    coloraxis={'cmin': float(low), 'cmax': float(high), 'colorscale': 'Viridis',
                               'colorbar': {'title': {'text': heading_of(metric), 'side': 'right'}, 'thickness': 14}})
    # The scale stands beside the maps and ends with them: above them are the buttons.
    layout = drawing['plot']['layout']
    ends = [end for name, axis in layout.items() if name.startswith('yaxis') for end in axis['domain']]
    layout['coloraxis']['colorbar'].update(y=(min(ends) + max(ends)) / 2, len=max(ends) - min(ends))
    return drawing


def distributions(results: StudyResults, metrics: list[str]) -> dict[str, Any] | None:
    """How often each value of the metrics occurs; None if they have one value each."""
    by = curve_names(results)
    cells: list[Cell] = []
    for metric in metrics:
        frame = results.completed([*by, metric])
        values = frame[metric].dropna()
        if values.nunique() < 2:
            continue
        edges = np.linspace(values.min(), values.max(), int(np.clip(np.sqrt(len(values)), 5, BINS_OF_DISTRIBUTION)) + 1)
        cell = Cell([], heading_of(metric), 'runs')
        for number, (name, part) in enumerate(_told_apart(frame, by)):
            counts = np.histogram(part[metric].dropna(), edges)[0]
            cell.traces.append({
                'x': numbers(np.concatenate([edges[:1], 0.5 * (edges[:-1] + edges[1:]), edges[-1:]])),
                'y': numbers(np.concatenate([[0], counts, [0]])), 'mode': 'lines', 'name': name, 'legendgroup': name,
                'line': {'shape': 'hvh', 'color': run_style(number).colour}, 'showlegend': bool(name) and not cells,
                'hovertemplate': f'{name}: %{{y}} runs around {heading_of(metric)} = %{{x:.4~g}}<extra></extra>'})
        cells.append(cell)
    if not cells:
        return None
    return _drawing('distributions', 'Distributions', 'How many runs have which value.', cells, min(3, len(cells)))


def quantile_table(results: StudyResults) -> Table:
    """Median and, in brackets, 10th and 90th percentile of each metric; a column for each group."""
    results.columns(results.facts['columns'])  # all of them in one reading of the file
    by = curve_names(results)
    every = dict(groups_of(results.columns([*by, 'result']), by))
    rows = []
    for metric in results.metrics:
        complete = {name: part[metric].dropna() for name, part in groups_of(results.completed([*by, metric]), by)}
        cells = dict.fromkeys(every, DASH)
        for name, values in complete.items():
            if len(values):
                low, median, high = values.quantile([0.1, 0.5, 0.9])
                cells[name] = '{} [{}, {}]'.format(*rounded([median, low, high], high - low))
        rows.append([heading_of(metric), *cells.values()])
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
    rows = [[heading_of(metric), significant(row[metric], 4),
             *(value if isinstance(value := row[name], str) else f'{value:.5g}' for name in names)]
            for metric in metrics if metric in figures() and figures()[metric].better == 'less'
            for _, row in results.completed([*names, metric]).nlargest(WORST, metric).iterrows()]
    return Table('worst', ['of', 'value', *(title_of(name) for name in names)], rows, False)


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
    """The page as HTML that needs no network. Raises ValueError for a metric that the study lacks."""
    metrics = [name for names in o.metrics for name in names.split(',')] or [name for name in SHOWN if name in results.metrics]
    for name in metrics:
        if name not in results.metrics:
            raise ValueError(f'--metric {name}: the study has {", ".join(results.metrics)}')
    sobol, notes = Table('sobol', [], []), list[str]()
    if results.facts['design'] == 'saltelli':
        sobol, notes = sobol_table(results, metrics)
    drawings = [drawing for metric in metrics for drawing in (curves(results, metric), maps(results, metric)) if drawing]
    if not numeric_factors(results) and (drawing := distributions(results, results.metrics)):
        drawings.append(drawing)
    return render('study.html.j2', [drawing['plot'] for drawing in drawings], _FOLDER,
                  version=_core.version, title=o.title or f'Study {results.facts["study"]}', facts=results.facts,
                  description=results.facts['description'], quantiles=quantile_table(results), sobol=sobol,
                  worst=worst_table(results, metrics), reasons=reasons_table(results), drawings=drawings, notes=notes)
