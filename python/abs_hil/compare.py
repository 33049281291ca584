"""The tables of `abs_hil compare`, from the rows of a study of one case: means, quantiles and paired differences of each
controller's runs (docs/comparison.md). `abs_hil compare` starts this program and computes the runs, since a program of one's
own has controllers that Python does not know.

On stdin: a line of JSON that says what is compared, then the study's results as CSV, with what was drawn for each run. On
stdout: the texts as JSON."""
import csv
import io
import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import parsers
from .merits import Estimate, FigureOfMerit, figures, of_difference, of_mean, of_ratio
from .options import failed

#: figures whose ratio of adaptive to sliding-mode, paired by run, stands beside the paper's claim: by their key in JSON
PAPER_FIGURES = {'stop_time': 'stop_time_s', 'stop_distance': 'stop_distance_m', 'slip_rms': 'slip_rms',
                 'torque_total_variation': 'torque_total_variation_Nm'}
#: the paper: "approximately 6.7 % less time and distance" than its sliding-mode baseline
PAPER_SAVING = 0.067
QUANTILES = {'p10': 0.1, 'median': 0.5, 'p90': 0.9}
ESTIMATE = ('n', 'mean', 'standard_deviation', 'ci95_low', 'ci95_high')
#: first keys of the JSON
HEAD = ('plant', 'experiment', 'start_speed_rad_s', 'end_speed_m_s', 'slip_ref', 'repeat', 'seed', 'vary')
Cells = list[list[str]]


@dataclass
class Column:
    """One controller. runs: the columns of its rows as texts, in the order of the plants. The others by compared figure: values,
    NaN for runs that a fault ended; differences from the first controller, paired by plant, none for the first."""
    facts: dict[str, Any]
    runs: dict[str, tuple[str, ...]]
    values: dict[str, np.ndarray]
    means: dict[str, Estimate]
    quantiles: dict[str, dict[str, float]]
    differences: dict[str, Estimate]
    faults: int
    locked: int  # runs in which the wheel locked

    @property
    def count(self) -> int:
        return len(self.runs['result'])


def compared() -> list[FigureOfMerit]:
    return [figure for figure in figures().values() if figure.compared]


def _values(runs: dict[str, tuple[str, ...]], figure: FigureOfMerit) -> np.ndarray:
    """Of a figure that should be near zero the size counts: errors of both signs must not cancel."""
    values = np.array(runs[figure.name], dtype=float)
    return np.where(np.array(runs['result']) == 'completed', np.abs(values) if figure.better == 'nearer zero' else values, np.nan)


def _quantiles(values: np.ndarray) -> dict[str, float]:
    known = values[~np.isnan(values)]
    return {name: float(np.quantile(known, q)) if len(known) else math.nan for name, q in QUANTILES.items()}


def columns_of(facts: dict[str, Any], names: Sequence[str], rows: Sequence[Sequence[str]]) -> list[Column]:
    """names, rows: the study's results as texts."""
    found: list[Column] = []
    for controller in facts['controllers']:
        own = (row for row in rows if row[names.index('controller')] == controller['name'])
        runs = dict(zip(names, zip(*own)))
        values = {figure.name: _values(runs, figure) for figure in compared()}
        found.append(Column(
            controller, runs, values, {name: of_mean(one) for name, one in values.items()},
            {name: _quantiles(one) for name, one in values.items()},
            {name: of_difference(values[name], base) for name, base in found[0].values.items()} if found else {},
            sum(result != 'completed' for result in runs['result']), sum(float(one) > 0.0 for one in runs['time_locked_s'])))
    return found


def paper_ratios(columns: list[Column]) -> dict[str, Estimate]:
    """By the keys of PAPER_FIGURES; empty unless both controllers of the paper are compared."""
    values = {column.facts['name']: column.values for column in columns}
    if not {'adaptive', 'sliding-mode'} <= values.keys():
        return {}
    return {key: of_ratio(values['adaptive'][name], values['sliding-mode'][name]) for key, name in PAPER_FIGURES.items()}


def number(value: float) -> str:
    """The shortest text that reads back bit-exactly."""
    return repr(float(value)).removesuffix('.0')


def _interval(e: Estimate, runs: int, decimals: int, sign: str = '') -> str:
    """"2.331 ± 0.012", followed by the number of runs if some have no value."""
    half = f' ± {e.half_width:.{decimals}f}' if e.n > 1 else ''
    return f'{e.mean:{sign}.{decimals}f}{half}' + (f' ({e.n} runs)' if e.n < runs else '') if e.n else '-'


def _spread(q: dict[str, float], decimals: int) -> str:
    return '-' if math.isnan(q['median']) else '{median:.{d}f} [{p10:.{d}f}, {p90:.{d}f}]'.format(**q, d=decimals)


def _cells(corner: str, columns: Sequence[Column], cell: Callable[[Column, str, int], str]) -> Cells:
    """A row for each figure. cell: (column, name of the figure, decimals)"""
    cells = [[corner, *(column.facts['name'] for column in columns)]]
    for figure in compared():
        title = figure.title + (', size' if figure.better == 'nearer zero' else '')
        cells.append([f'{title} / {figure.unit}' if figure.unit else title,
                      *(cell(column, figure.name, figure.decimals) for column in columns)])
    return cells


def aligned(cells: Cells, indent: str = '  ', gap: str = '   ') -> str:
    first, *widths = (max(map(len, column)) for column in zip(*cells))
    return ''.join(indent + gap.join([row[0].ljust(first), *map(str.rjust, row[1:], widths)]).rstrip() + '\n' for row in cells)


def in_markdown(cells: Cells) -> str:
    head, *lines = (f'| {" | ".join(row)} |\n' for row in cells)
    return head + '|---|' + '---:|' * (len(cells[0]) - 1) + '\n' + ''.join(lines)


def _heading(facts: dict[str, Any]) -> str:
    start, runs = facts['start_speed_rad_s'], facts['repeat']
    lines = [f'Plant {facts["plant"]}, experiment {facts["experiment"]}, '
             f'{f"braking from {number(start)} rad/s" if start > 0.0 else "from standstill"} to {number(facts["end_speed_m_s"])} '
             f'm/s, slip reference {number(facts["slip_ref"])}.']
    if facts['model_differs']:
        lines.append(f'The model differs from the plant: {facts["model_differs"]}.')
    lines += [f'{one["name"]} is {one["controller"]} with '  # what the labels stand for
              f'{", ".join(f"{key} = {value}" for key, value in one["settings"])}.'
              for one in facts['controllers'] if one['settings'] and '{' not in one['name']]
    lines.append(f'{runs} run{"s" if runs > 1 else ""} of each controller, seed {facts["seed"]}, plants varied by {facts["vary"]}'
                 f'{"; mean ± half of the 95 % confidence interval" if runs > 1 else ""}.')
    return ''.join(f'{line}\n' for line in lines)


def _ratio_line(ratios: dict[str, Estimate]) -> str:
    shown = ', '.join(f'{figures()[PAPER_FIGURES[key]].title} ' + ('-' if not e.n else f'{e.mean:.4f}' if e.n == 1 else
                      f'{e.mean:.4f} [{e.low:.4f}, {e.high:.4f}]') for key, e in ratios.items())
    return (f'adaptive / sliding-mode: {shown}; the paper: {1.0 - PAPER_SAVING:.3f} for time and distance '
            f'({100.0 * PAPER_SAVING:.1f} % less).\n')


def _page(facts: dict[str, Any], columns: list[Column], in_format: Callable[[Cells], str], differences: str) -> str:
    """differences: what stands above the table of differences."""
    means = _cells('', columns, lambda column, name, decimals: _interval(column.means[name], column.count, decimals))
    means += [['runs ended by a fault', *(str(column.faults) for column in columns)],
              ['runs that locked', *(str(column.locked) for column in columns)]]
    text = f'{_heading(facts)}\n{in_format(means)}'
    if facts['repeat'] > 1:
        text += '\n' + in_format(_cells('median [10 %, 90 %]', columns,
                                        lambda column, name, decimals: _spread(column.quantiles[name], decimals)))
    if len(columns) > 1:
        text += differences + in_format(_cells(
            f'difference from {columns[0].facts["name"]}', columns[1:],
            lambda column, name, decimals: _interval(column.differences[name], column.count, decimals, '+')))
    ratios = paper_ratios(columns)
    return text + (f'\n{_ratio_line(ratios)}' if ratios else '')


def _csv(header: str, rows: Iterable[Sequence[Any]]) -> str:
    text = io.StringIO(f'{header}\n')
    text.seek(0, io.SEEK_END)
    csv.writer(text, lineterminator='\n').writerows(rows)
    return text.getvalue()


def _table_csv(columns: list[Column]) -> str:
    """One row for each controller and figure."""
    return _csv(f'controller,metric,{",".join(ESTIMATE)},difference,difference_ci95_low,difference_ci95_high,'
                f'{",".join(QUANTILES)}',
                ([column.facts['name'], name, mean.n, *map(number, (*mean[1:], d.mean, d.low, d.high,
                                                                    *column.quantiles[name].values()))]
                 for column in columns for name, mean in column.means.items()
                 for d in [column.differences.get(name, of_mean([]))]))


def _runs_csv(columns: list[Column]) -> str:
    """One row for each controller and run, with what was drawn for it: the study's own texts."""
    known = list(columns[0].runs)
    names = [*columns[0].values, *known[known.index(list(figures())[-1]) + 1:]]
    return _csv(','.join(('controller', 'run', 'result', *names)),
                (row for column in columns for row in zip(*(column.runs[name] for name in ('controller', 'repetition', 'result',
                                                                                           *names)))))


def _json(facts: dict[str, Any], columns: list[Column]) -> str:
    def of(e: Estimate) -> dict[str, Any]:
        return dict(zip(ESTIMATE, e))
    root = {key: facts[key] for key in HEAD}
    root['controllers'] = [{
        **column.facts, 'settings': dict(column.facts['settings']), 'runs': column.count, 'faults': column.faults,
        'locked': column.locked,
        'metrics': {name: of(e) | column.quantiles[name] for name, e in column.means.items()},
        'difference_from_first': {name: of(e) for name, e in column.differences.items()} or None} for column in columns]
    if ratios := paper_ratios(columns):
        root['adaptive_over_sliding_mode'] = {key: of(e) for key, e in ratios.items()} | {'paper': 1.0 - PAPER_SAVING}
    root['config'] = facts['config']
    known = json.loads(json.dumps(root), parse_constant=lambda _: None)  # JSON has no NaN
    return json.dumps(known, indent=2, ensure_ascii=False) + '\n'


def texts_of(facts: dict[str, Any], names: Sequence[str], rows: Sequence[Sequence[str]]) -> dict[str, str]:
    """What `abs_hil compare` prints and writes."""
    columns = columns_of(facts, names, rows)
    brake, first = facts['config']['experiment'], columns[0].runs
    facts.update(plant=first['plant'][0], experiment=first['experiment'][0], start_speed_rad_s=brake['start_speed_rad_s'],
                 end_speed_m_s=brake['end_speed_m_s'], slip_ref=facts['config']['control']['slip_ref'])
    return {'text': _page(facts, columns, aligned, '\nDifferences, paired by plant:\n'),
            'markdown': _page(facts, columns, in_markdown, '\n'), 'csv': _table_csv(columns), 'runs': _runs_csv(columns),
            'json': _json(facts, columns)}


def main(arguments: list[str]) -> int:
    parsers.compare_tables().parse_args(arguments)
    if sys.stdin.isatty():
        return failed('abs_compare_tables', '`abs_hil compare` starts this program by itself')
    told = io.TextIOWrapper(sys.stdin.buffer, encoding='utf-8', newline='')
    head = told.readline()
    names, *rows = [*csv.reader(told)] or [[]]
    if not rows or len(rows) < json.loads(head)['repeat'] * len(json.loads(head)['controllers']):
        return 1  # abs_hil has ended, and has said why
    json.dump(texts_of(json.loads(head), names, rows), sys.stdout)
    return 0
