"""Figures of a study's results: curves over one factor, maps over two. Drawn by matplotlib as SVG."""
from __future__ import annotations

import itertools
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..figures import heading_of
from ..report.model import run_style
from .results import StudyResults, _binned

if TYPE_CHECKING:
    import pandas

MOST_BINS, LEAST_BINS = 16, 4
#: points in a part of a curve
POINTS_IN_BIN = 8
MOST_FACTORS, MOST_PAIRS, MOST_CURVES = 6, 3, 7


@dataclass
class Drawing:
    id: str
    heading: str
    caption: str
    svg: bytes


def numeric_factors(results: StudyResults) -> list[str]:
    """Factors that have more than one value and are numbers."""
    columns = results.columns(results.factors)
    return [name for name in results.factors if np.issubdtype(columns[name].dtype, np.number) and columns[name].nunique() > 1]


def _points(results: StudyResults) -> int:
    return int(results.columns(['point'])['point'].nunique())


def _bins(wanted: float) -> int:
    return int(np.clip(wanted, LEAST_BINS, MOST_BINS))


def curve_names(results: StudyResults) -> list[str]:
    """What tells curves apart: plants, experiments, controllers, and levels that are no numbers."""
    numbers = set(numeric_factors(results))
    return [name for name in results.groups if name not in numbers]


def groups_of(frame: pandas.DataFrame, by: list[str]) -> list[tuple[str, pandas.DataFrame]]:
    """(name, rows) of each group; one of all rows without columns."""
    if not by:
        return [('', frame)]
    return [(', '.join(str(value) for value in (key if isinstance(key, tuple) else (key,))), part)
            for key, part in frame.groupby(by if len(by) > 1 else by[0], observed=True, sort=False)]


def _svg(picture: Any) -> bytes:
    import io
    file = io.BytesIO()
    picture.savefig(file, format='svg', metadata={'Date': None})
    return file.getvalue()


def _picture(width: float, height: float) -> Any:
    os.environ.setdefault('MPLBACKEND', 'agg')
    from matplotlib.figure import Figure
    return Figure(figsize=(width, height), layout='constrained')


def curves(results: StudyResults, metric: str) -> Drawing | None:
    """Medians over each factor, and between which values 80 % of the runs lie; None without factors."""
    factors = numeric_factors(results)[:MOST_FACTORS]
    by = curve_names(results)
    frame = results.completed([*by, *factors, metric])
    if not factors or not frame[metric].notna().any():
        return None
    groups = groups_of(frame, by)[:MOST_CURVES]
    bins = _bins(_points(results) / POINTS_IN_BIN)
    columns = min(3, len(factors))
    rows = -(-len(factors) // columns)
    picture = _picture(3.4 * columns, 2.6 * rows + 0.4)
    every = picture.subplots(rows, columns, squeeze=False, sharey=True)
    for axes, factor in itertools.zip_longest(every.flat, factors):
        if factor is None:
            axes.set_visible(False)
            continue
        for number, (name, part) in enumerate(groups):
            found = part.groupby(_binned(part[factor], bins))[metric].quantile([0.1, 0.5, 0.9]).unstack()
            style = run_style(number)
            axes.plot(found.index, found[0.5], color=style.colour, marker='.', label=name or None)
            axes.fill_between(found.index, found[0.1], found[0.9], color=style.colour, alpha=0.15, linewidth=0)
        axes.set_xlabel(factor)
        axes.grid(True, color='#e4e4e4')
    for axes in every[:, 0]:
        axes.set_ylabel(heading_of(metric))
    handles, names = every[0, 0].get_legend_handles_labels()
    if len(groups) > 1:
        every[0, 0].legend(handles, names, loc='lower left', bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize=8)
    return Drawing(f'curves-{metric}', heading_of(metric),
                   'Median over each factor, whatever the others are; 80 % of the runs lie in the band.', _svg(picture))


def maps(results: StudyResults, metric: str) -> Drawing | None:
    """Medians over pairs of factors, a row of maps for each controller; None with fewer than two factors."""
    pairs = list(itertools.combinations(numeric_factors(results), 2))[:MOST_PAIRS]
    by = curve_names(results)
    frame = results.completed([*dict.fromkeys([*by, *itertools.chain(*pairs)]), metric])
    if not pairs or not frame[metric].notna().any():
        return None
    groups = groups_of(frame, by)[:MOST_CURVES]
    bins = _bins(np.sqrt(_points(results) / 2))
    picture = _picture(3.6 * len(pairs) + 0.4, 2.8 * len(groups))
    every = picture.subplots(len(groups), len(pairs), squeeze=False)
    low, high = frame[metric].quantile([0.02, 0.98])
    drawn = None
    for row, (name, part) in zip(every, groups):
        for axes, (x, y) in zip(row, pairs):
            table = part.groupby([_binned(part[y], bins), _binned(part[x], bins)])[metric].median().unstack()
            drawn = axes.pcolormesh(table.columns, table.index, table.to_numpy(), vmin=low, vmax=high,
                                    cmap='viridis', shading='nearest', rasterized=True)
            axes.set_xlabel(x)
            axes.set_ylabel(y)
            axes.set_title(name, fontsize=9)
    picture.colorbar(drawn, ax=every, label=heading_of(metric))
    return Drawing(f'maps-{metric}', heading_of(metric),
                   'Median over two factors, whatever the others are. White: no run was completed there.', _svg(picture))
