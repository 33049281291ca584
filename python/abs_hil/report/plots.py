"""Figures as data for plotly.js: one dictionary a figure, which page.js draws."""
import html
import json
import math
from typing import Any

import numpy as np

from .model import DARK, Curve, Figure, Panel, phase_colour

GAP_PX = 14.0
MARKS_PX = 16.0  # a line of names of marks above the first panel
MARK_LINES = 2
TOP_PX = 6.0
BOTTOM_PX = 48.0
LEGEND_LINE_PX = 20.0
#: a mark's name needs this much of the axis; names without room are left out
LABEL_WIDTH = 0.0075
LABEL_GAP = 0.02
TIME_AXES = ('braking', 'run')
SYMBOLS = {'triangle': 'triangle-up', 'open circle': 'circle-open', 'circle': 'circle', 'square': 'square'}


def _escaped(text: str) -> str:
    """Text from a file: plotly.js reads markup."""
    return html.escape(text, quote=False)


def numbers(values: np.ndarray, kind: str = 'f8') -> np.ndarray:
    """Little-endian floats; `packed` puts them beside the JSON."""
    return np.ascontiguousarray(values, dtype='<' + kind)


def packed(plots: list[dict[str, Any]]) -> bytes:
    """All plots, for page.js: the length of a JSON text (4 bytes), the text, and behind it the numbers, each array once."""
    floats = bytearray()
    known: dict[tuple[str, bytes], int] = {}

    def reference(array: np.ndarray) -> dict[str, Any]:
        if (key := (array.dtype.str, array.tobytes())) not in known:
            known[key] = len(floats)
            floats.extend(key[1])
        return {'floats': 8 * array.dtype.itemsize, 'at': known[key], 'size': array.size,
                'columns': array.shape[1] if array.ndim == 2 else 0}

    text = json.dumps({'plots': plots, 'dark': DARK}, ensure_ascii=False, allow_nan=False, separators=(',', ':'),
                      default=reference).encode()
    return len(text).to_bytes(4, 'little') + text + bytes(floats)


def _trace(curve: Curve, panel: Panel, number: int, new_in_legend: bool) -> dict[str, Any]:
    trace: dict[str, Any] = {
        'x': numbers(curve.x), 'y': numbers(curve.y, 'f4'), 'name': _escaped(curve.legend or curve.quantity),
        'xaxis': f'x{number}', 'yaxis': f'y{number}', 'showlegend': new_in_legend, 'legendgroup': _escaped(curve.group),
        'meta': {'run': curve.run + 1, 'quantity': curve.quantity, 'points': int(np.isfinite(curve.y).sum())}}
    trace['hovertemplate'] = _escaped(f'{curve.title or panel.title} %{{y:.5~g}} {panel.unit}'.strip())
    if curve.drawn == 'line':
        dash = {'dash': ','.join(f'{length:g}px' for length in curve.style.dash)} if curve.style.dash else {}
        return {**trace, 'mode': 'lines', 'line': {'color': curve.style.colour, 'width': curve.style.width, **dash}}
    symbol = SYMBOLS[curve.marker]
    trace.update(mode='markers', marker={'color': curve.style.colour, 'symbol': symbol, 'size': 8})
    if symbol == 'square':  # explains a colour of phases
        trace['marker'].update(size=12, line={'color': '#888888', 'width': 1})
    if curve.drawn == 'intervals':
        trace['error_y'] = {'type': 'data', 'symmetric': False, 'color': curve.style.colour, 'thickness': 1.2, 'width': 4,
                            'array': [high - y for (_, high), y in zip(curve.bounds, curve.y.tolist())],
                            'arrayminus': [y - low for (low, _), y in zip(curve.bounds, curve.y.tolist())]}
    return trace


def _nothing(number: int) -> dict[str, Any]:
    """An invisible point: plotly.js draws no axes without a curve."""
    return {'x': numbers(np.zeros(1)), 'y': numbers(np.zeros(1), 'f4'), 'xaxis': f'x{number}', 'yaxis': f'y{number}',
            'mode': 'markers', 'opacity': 0, 'showlegend': False, 'hoverinfo': 'skip', 'meta': None}


def _y_axis(panel: Panel, domain: tuple[float, float], number: int) -> dict[str, Any]:
    axis: dict[str, Any] = {'title': {'text': panel.y_label.html, 'standoff': 4}, 'domain': list(domain),
                            'anchor': f'x{number}', 'showgrid': panel.grid}
    if panel.log:
        axis['type'] = 'log'
    if panel.y_range is not None:
        axis['range'] = [math.log10(value) for value in panel.y_range] if panel.log else list(panel.y_range)
    if panel.y_tics:
        axis.update(tickvals=[place for place, _ in panel.y_tics], ticktext=[_escaped(text) for _, text in panel.y_tics],
                    fixedrange=True)
    return axis


def _x_axis(figure: Figure, panel: Panel, number: int, last: bool) -> dict[str, Any]:
    axis: dict[str, Any] = {'anchor': f'y{number}', 'showticklabels': last, 'showgrid': panel.grid}
    if figure.axis in TIME_AXES:
        axis['unifiedhovertitle'] = {'text': '%{x:.4~f} s'}
    if number > 1:
        axis['matches'] = 'x'
    if last:
        axis['title'] = {'text': figure.x_label.html, 'standoff': 6}
    if panel.log:
        axis.update(type='log', dtick=1)
    if figure.x_range is not None:
        axis['range'] = [math.log10(value) for value in figure.x_range] if panel.log else list(figure.x_range)
    if panel.x_tics:
        axis.update(tickvals=[place for place, _ in panel.x_tics], ticktext=[_escaped(text) for _, text in panel.x_tics])
    return axis


def _shapes(figure: Figure) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Shades and marks over all panels, bars of phases in their panel, and their names."""
    shapes: list[dict[str, Any]] = []
    texts: list[dict[str, Any]] = []
    low, high = figure.x_range or (0.0, 1.0)
    width = max(high - low, 1e-12)
    for shade in figure.shades:
        if shade.phase != 'brake' and shade.x1 > low and shade.x0 < high:
            shapes.append({'type': 'rect', 'xref': 'x', 'yref': 'paper', 'x0': shade.x0, 'x1': shade.x1, 'y0': 0, 'y1': 1,
                           'fillcolor': phase_colour(shade.phase), 'line': {'width': 0}, 'layer': 'below'})
    free_from = [-math.inf] * MARK_LINES
    for mark in sorted((mark for mark in figure.marks if low <= mark.x <= high), key=lambda mark: mark.x):
        colour = '#D55E00' if mark.fault else '#666666'
        shapes.append({'type': 'line', 'xref': 'x', 'yref': 'paper', 'x0': mark.x, 'x1': mark.x, 'y0': 0, 'y1': 1,
                       'line': {'color': colour, 'width': 1, 'dash': '4px,3px'}})
        place = (mark.x - low) / width
        line = next((line for line, free in enumerate(free_from) if place >= free), None)
        if line is None:
            continue
        over_the_edge = place + LABEL_WIDTH * len(mark.label) > 1.0
        free_from[line] = place + LABEL_WIDTH * len(mark.label) + LABEL_GAP
        texts.append({'x': mark.x, 'xref': 'x', 'y': 1, 'yref': 'paper', 'text': _escaped(mark.label), 'showarrow': False,
                      'xanchor': 'right' if over_the_edge else 'left', 'yanchor': 'bottom', 'yshift': MARKS_PX * line,
                      'font': {'size': 11, 'color': colour}})
    for number, panel in enumerate(figure.panels, 1):
        for bar in panel.bars:
            shapes.append({'type': 'rect', 'xref': f'x{number}', 'yref': f'y{number}', 'x0': bar.x0, 'x1': bar.x1,
                           'y0': bar.y0, 'y1': bar.y1, 'fillcolor': bar.colour, 'line': {'color': '#888888', 'width': 0.5},
                           'layer': 'below'})
            if (bar.x1 - bar.x0) / width > LABEL_WIDTH * len(bar.text):
                texts.append({'x': 0.5 * (bar.x0 + bar.x1), 'y': 0.5 * (bar.y0 + bar.y1), 'xref': f'x{number}',
                              'yref': f'y{number}', 'text': _escaped(bar.text), 'showarrow': False, 'font': {'size': 11}})
    return shapes, texts


def plot(figure: Figure) -> dict[str, Any]:
    """The figure as {id, axis, height, data, layout}."""
    inner = sum(panel.height_px for panel in figure.panels) + GAP_PX * (len(figure.panels) - 1)
    shapes, texts = _shapes(figure)
    layout: dict[str, Any] = {'shapes': shapes, 'annotations': []}
    data = []
    seen: set[str] = set()
    top = 1.0
    for number, panel in enumerate(figure.panels, 1):
        bottom = max(top - panel.height_px / inner, 0.0)
        layout[f'xaxis{number if number > 1 else ""}'] = _x_axis(figure, panel, number, number == len(figure.panels))
        layout[f'yaxis{number if number > 1 else ""}'] = _y_axis(panel, (bottom, top), number)
        if panel.y_label.html and 1 < len(figure.panels) < 6:
            layout['annotations'].append({'x': 0.004, 'xref': 'paper', 'xanchor': 'left', 'showarrow': False, 'y': top,
                                          'yref': 'paper', 'yanchor': 'top', 'text': f'({"abcdef"[number - 1]})',
                                          'font': {'size': 12}})
        top = bottom - GAP_PX / inner
        if not panel.curves:
            data.append(_nothing(number))
        for curve in panel.curves:
            new = bool(curve.legend) and curve.legend not in seen
            seen.add(curve.legend)
            data.append(_trace(curve, panel, number, new))
    layout['annotations'] += texts
    names = len(seen - {''})
    legend_px = LEGEND_LINE_PX * (1 + (names - 1) // 3) if names else 0.0
    above = TOP_PX + (MARKS_PX * MARK_LINES if figure.marks else 0.0)
    # The buttons of plotly.js stand in the first line too.
    named = max([len(text) for panel in figure.panels for _, text in panel.y_tics], default=0)
    margin = {'l': max(74, 20 + 8 * named), 'r': 12, 't': above + max(legend_px, LEGEND_LINE_PX), 'b': BOTTOM_PX}
    layout.update(margin=margin, legend={'orientation': 'h', 'x': 0, 'y': 1 + above / inner, 'yanchor': 'bottom',
                                         'font': {'size': 12}})
    return {'id': figure.id, 'axis': figure.axis, 'height': inner + margin['t'] + margin['b'], 'data': data, 'layout': layout}
