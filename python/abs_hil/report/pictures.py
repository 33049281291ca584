"""Figures as picture files, for a text or a hand-in: SVG, PDF, PNG by matplotlib."""
import os
import pathlib
from functools import partial
from typing import Any

from ..files import make_folder, refuse_existing, write_whole
from .model import Curve, Figure, Panel, phase_colour

WIDTH_IN = 7.2
PX_PER_IN = 110.0
DPI = 160
_RC = {'font.family': ['Liberation Serif', 'DejaVu Serif'],  # the second has every character
       'mathtext.fontset': 'stix', 'font.size': 10, 'axes.grid': True, 'grid.color': '#e4e4e4', 'axes.axisbelow': True,
       'svg.fonttype': 'none', 'svg.hashsalt': 'abs_hil', 'path.simplify': True, 'axes.unicode_minus': True}


def _plain(text: str) -> str:
    return text.replace('$', r'\$')


def _draw_curve(axes: Any, curve: Curve, label: str) -> None:
    dash: Any = (0, tuple(length / max(curve.style.width, 0.6) for length in curve.style.dash)) if curve.style.dash else '-'
    if curve.drawn == 'line':
        axes.plot(curve.x, curve.y, color=curve.style.colour, linestyle=dash, linewidth=0.8 * curve.style.width, label=label)
        return
    marker = {'triangle': '^', 'open circle': 'o', 'circle': 'o', 'square': 's'}[curve.marker]
    if curve.drawn == 'intervals':
        axes.errorbar(curve.x, curve.y, [[y - low for (low, _), y in zip(curve.bounds, curve.y)],
                                         [high - y for (_, high), y in zip(curve.bounds, curve.y)]],
                      color=curve.style.colour, fmt=marker, markersize=4, capsize=3, linewidth=1, label=label)
        return
    axes.plot(curve.x, curve.y, color=curve.style.colour, marker=marker, linestyle='', markersize=5, label=label,
              markerfacecolor='none' if curve.marker == 'open circle' else curve.style.colour)


def _draw_panel(axes: Any, figure: Figure, panel: Panel, labelled: set[str]) -> None:
    for curve in panel.curves:
        new = curve.legend and curve.legend not in labelled
        labelled.add(curve.legend)
        _draw_curve(axes, curve, _plain(curve.legend) if new else '_')
    if panel.log:
        axes.set_xscale('log')
        axes.set_yscale('log')
    axes.set_ylabel(panel.y_label.math)
    if figure.x_range is not None:
        axes.set_xlim(*figure.x_range)
    if panel.y_range is not None:
        axes.set_ylim(*panel.y_range)
    if panel.y_tics:
        axes.set_yticks([place for place, _ in panel.y_tics], [_plain(text) for _, text in panel.y_tics])
    if panel.x_tics:
        axes.set_xticks([place for place, _ in panel.x_tics], [_plain(text) for _, text in panel.x_tics])
    if not panel.grid:
        axes.grid(False)
    low, high = figure.x_range or axes.get_xlim()
    for shade in figure.shades:
        if shade.phase != 'brake' and shade.x1 > low and shade.x0 < high:
            axes.axvspan(max(shade.x0, low), min(shade.x1, high), color=phase_colour(shade.phase), zorder=0, linewidth=0)
    for mark in figure.marks:
        if low <= mark.x <= high:
            axes.axvline(mark.x, color='#D55E00' if mark.fault else '#666666', linewidth=0.8, linestyle=(0, (4, 3)))
    for bar in panel.bars:
        axes.fill_between([bar.x0, bar.x1], bar.y0, bar.y1, facecolor=bar.colour, edgecolor='#888888', linewidth=0.5)
        if (bar.x1 - bar.x0) / max(high - low, 1e-12) > 0.014 * len(bar.text):
            axes.text(0.5 * (bar.x0 + bar.x1), 0.5 * (bar.y0 + bar.y1), _plain(bar.text), ha='center', va='center', fontsize=8)


def _mark_names(axes: Any, figure: Figure) -> None:
    """Names above the first panel; names without room are left out."""
    low, high = figure.x_range or axes.get_xlim()
    free_from = low
    for mark in sorted(figure.marks, key=lambda mark: mark.x):
        if free_from <= mark.x <= high:
            axes.annotate(_plain(mark.label), (mark.x, 1.0), xycoords=('data', 'axes fraction'), fontsize=8, va='bottom',
                          color='#D55E00' if mark.fault else '#666666')
            free_from = mark.x + (high - low) * (0.009 * len(mark.label) + 0.02)


def _drawn(figure: Figure) -> Any:
    from matplotlib.figure import Figure as Picture
    heights = [panel.height_px for panel in figure.panels]
    picture = Picture(figsize=(WIDTH_IN, sum(heights) / PX_PER_IN + 0.9), layout='constrained')
    every = picture.subplots(len(heights), 1, sharex=True, squeeze=False, gridspec_kw={'height_ratios': heights})[:, 0]
    labelled: set[str] = {''}
    for axes, panel in zip(every, figure.panels):
        _draw_panel(axes, figure, panel, labelled)
    _mark_names(every[0], figure)
    every[-1].set_xlabel(figure.x_label.math)
    if handles := [(handle, text) for axes in every for handle, text in zip(*axes.get_legend_handles_labels())]:
        every[0].legend([handle for handle, _ in handles], [text for _, text in handles], loc='lower left', ncols=3,
                        bbox_to_anchor=(0.0, 1.08 if figure.marks else 1.0), fontsize=8, frameon=False)
    return picture


def save(figure: Figure, path: pathlib.Path, kind: str) -> None:
    """Writes a figure, as the same bytes each time. Raises ValueError."""
    os.environ.setdefault('MPLBACKEND', 'agg')
    import logging

    import matplotlib
    logging.getLogger('matplotlib.font_manager').setLevel(logging.ERROR)  # the fonts' names are a wish
    stamps: dict[str, dict[str, Any]] = {'svg': {'Date': None}, 'pdf': {'CreationDate': None}}
    with matplotlib.rc_context(_RC):
        write_whole(path, partial(_drawn(figure).savefig, format=kind, dpi=DPI, metadata=stamps.get(kind, {})))


def write(figures: list[Figure], folder: pathlib.Path, kind: str, replace: bool) -> list[pathlib.Path]:
    """Writes the figures into `folder`, which it creates. Replaces an existing file only if asked. Raises ValueError."""
    make_folder(folder, '--figures')
    paths = [folder / f'{figure.id}.{kind}' for figure in figures]
    for path in paths:
        refuse_existing(path, 'folder', replace)
    for figure, path in zip(figures, paths):
        save(figure, path, kind)
    return paths
