"""A figure as data, which the page (plotly) and the picture files (matplotlib) draw alike."""
import math
from dataclasses import dataclass, field
from typing import Self

import numpy as np


@dataclass(frozen=True)
class Style:
    colour: str = '#000000'
    dash: tuple[float, ...] = ()  # lengths of strokes and gaps in px; empty: solid
    width: float = 1.4


#: Okabe, Ito: "Color Universal Design" (2008), without its yellow. Each entry has its own dash pattern.
_RUN_STYLES = (Style('#0072B2', (), 1.5), Style('#E69F00', (14, 3), 1.5), Style('#009E73', (7, 3), 1.5),
               Style('#D55E00', (12, 3, 2, 3), 1.5), Style('#CC79A7', (4, 2), 1.5),
               Style('#56B4E9', (12, 3, 2, 3, 2, 3), 1.5), Style('#000000', (2, 2), 1.5))
STYLES = len(_RUN_STYLES)
_PHASE_COLOURS = {'idle': '#f1f1f1', 'accelerate': '#d9ecd9', 'coast': '#e2e2f0', 'brake': '#fdfdfd', 'hold': '#e6e6e6',
                  'stopped': '#f3f3f2', 'fault': '#f7d9cc'}
#: what page.js draws instead of each colour on a dark page
DARK = {'#000000': '#f4f4f4', '#1a1a1a': '#e6e6e6', '#ffffff': '#15171a', '#333333': '#9a9a9a', '#e4e4e4': '#33373c',
        '#666666': '#a6a6a6', '#888888': '#777777', '#0072B2': '#4aa8e0', '#D55E00': '#f0803c', '#909090': '#8c8c8c',
        '#f1f1f1': '#1e2125', '#d9ecd9': '#1f3524', '#e2e2f0': '#272740', '#fdfdfd': '#16181b', '#e6e6e6': '#2b2f34',
        '#f3f3f2': '#222529', '#f7d9cc': '#57301f', '#ececec': '#303439'}


def run_style(run: int) -> Style:
    return _RUN_STYLES[run % STYLES]


def phase_colour(phase: str) -> str:
    """Background colour of a phase; white for braking, the phase of interest."""
    return _PHASE_COLOURS.get(phase, '#ececec')


@dataclass(frozen=True)
class Label:
    """Text of an axis: fixed text with markup, once for each way of drawing."""
    html: str
    math: str  # with matplotlib's $...$

    @classmethod
    def plain(cls, text: str) -> Self:
        """Text from a file, without markup."""
        return cls(text.replace('&', '&amp;').replace('<', '&lt;').replace('>', '&gt;'), text.replace('$', r'\$'))


@dataclass
class Curve:
    run: int
    quantity: str  # the column that it shows, or a name for a computed quantity
    style: Style
    x: np.ndarray
    y: np.ndarray
    drawn: str = 'line'  # line, markers, intervals
    marker: str = 'circle'
    legend: str = ''     # text of its legend entry: plain text; only in the first curve with this text
    group: str = ''      # curves of one group are hidden and shown together
    title: str = ''      # what the pointer calls it; plain text; else its panel's title
    bounds: list[tuple[float, float]] = field(default_factory=list)  # of intervals


@dataclass
class Bar:
    """A rectangle in a panel's coordinates that shows a phase of a run."""
    x0: float
    x1: float
    y0: float
    y1: float
    colour: str
    text: str  # plain text, shown in the middle if it fits


@dataclass
class Panel:
    y_label: Label
    curves: list[Curve] = field(default_factory=list)
    y_range: tuple[float, float] | None = None
    height_px: float = 180.0
    log: bool = False  # both axes
    y_tics: list[tuple[float, str]] = field(default_factory=list)  # instead of numbers; plain text
    x_tics: list[tuple[float, str]] = field(default_factory=list)
    bars: list[Bar] = field(default_factory=list)
    grid: bool = True
    title: str = ''  # of its quantity, for the pointer and the text alternative; plain text
    unit: str = ''


@dataclass
class Shade:
    x0: float
    x1: float
    phase: str


@dataclass
class Mark:
    """A vertical line at an instant."""
    x: float
    label: str  # plain text
    fault: bool = False


@dataclass
class Figure:
    """A picture of panels in a column with a common x axis. Figures of one `axis` zoom together."""
    id: str
    heading: str  # plain text
    x_label: Label
    panels: list[Panel]
    caption: str = ''  # plain text
    x_range: tuple[float, float] | None = None
    axis: str = ''
    shades: list[Shade] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    paper: int = 0  # number of the paper's figure that it repeats; 0: none


def axis_around(low: float, high: float, wanted: int) -> tuple[float, float]:
    """The range widened to whole steps of 1, 2 or 5 times a power of ten, so that curves do not touch the frame."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return 0.0, 1.0
    size = max(abs(low), abs(high))
    if not high - low > 1e-9 * size:
        room = 0.5 * size if size > 0.0 else 0.5  # a constant curve gets space above and below
        low, high = low - room, high + room
    rough = (high - low) / wanted
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= 0.999 * rough)
    margin = 0.02 * (high - low)
    top = step * math.ceil((high + margin) / step)
    # An axis that begins at zero keeps zero as its end; a tiny negative value must not add a whole step.
    if 0.0 <= low < margin:
        return 0.0, top
    if -2.0 * margin < low < 0.0:
        return low - 0.5 * margin, top
    return step * math.floor((low - margin) / step), top


def thinned(x: np.ndarray, y: np.ndarray, most_stretches: int) -> tuple[np.ndarray, np.ndarray]:
    """At most `most_stretches` stretches of equal numbers of rows; of each remain the first, least, greatest and last value.

    This is the aggregation M4 of Jugel et al. (VLDB 2014), by rows instead of pixels: if a stretch is not wider than a
    pixel, the thinned line covers the same pixels as the full one. NaN breaks the curve; there are none at the ends.
    A stretch with a value has no break.
    """
    y = np.where(np.isfinite(y), y, np.nan)
    size = 1
    while -(-len(y) // size) > most_stretches:
        size *= 2
    if size > 1:
        chunks = -(-len(y) // size)
        padded = np.full(chunks * size, np.nan)
        padded[:len(y)] = y
        grid = padded.reshape(chunks, size)
        known = ~np.isnan(grid)
        kept = np.stack([known.argmax(1), np.where(known, grid, np.inf).argmin(1), np.where(known, grid, -np.inf).argmax(1),
                         size - 1 - known[:, ::-1].argmax(1)], axis=1)
        kept[~known.any(1)] = 0  # a stretch without a value is one break
        kept += np.arange(chunks)[:, None] * size
        places = np.unique(kept)
        x, y = x[places], y[places]
    unknown = np.isnan(y)
    repeated = unknown & np.concatenate(([True], unknown))[:-1]
    x, y = x[~repeated], y[~repeated]
    if len(y) and np.isnan(y[-1]):
        x, y = x[:-1], y[:-1]
    return x, y
