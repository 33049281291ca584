"""Histograms of the cycle's timing."""
import itertools
import math

import numpy as np

from ..run import stretches
from .files import PARTS, RunFiles
from .model import STYLES, Curve, Figure, Label, Panel, run_style

BINS_A_DECADE = 10.0


def _edges(last_us: int) -> np.ndarray:
    """Lower edges, in whole us, of bins of about equal width on a logarithmic axis: 0, 1, 2, ..."""
    bins = math.ceil(BINS_A_DECADE * (math.log10(last_us + 1) + 1.0))
    edges = np.unique(np.append(0, np.rint(10.0 ** (np.arange(bins) / BINS_A_DECADE)).astype(int)))
    return edges[:np.searchsorted(edges, last_us, 'right') + 1]


def outline(counts: np.ndarray, total: float, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """Share of the cycles by duration as the outline of a bar chart; no outline over empty bins."""
    edges = _edges(len(counts))
    ends = np.maximum(edges, 0.5)
    shares = np.array([counts[first:last].sum() for first, last in zip(edges, edges[1:])]) / total
    bars = stretches(shares > 0.0)
    x = [np.append(np.repeat(ends[a:b + 1], 2), ends[b]) for a, b in bars]
    y = [np.concatenate([[floor], np.repeat(shares[a:b], 2), [floor, math.nan]]) for a, b in bars]
    return np.concatenate(x)[:-1], np.concatenate(y)[:-1]


def timing_figure(runs: list[RunFiles]) -> Figure | None:
    """None if no run has a histogram."""
    timed = ((number, run.histogram) for number, run in enumerate(runs) if run.histogram is not None)
    histograms = dict(itertools.islice(timed, STYLES))
    if not histograms:
        return None
    columns = [counts for histogram in histograms.values() for counts in histogram.counts]
    greatest = max([1.0, *(float(counts.sum()) for counts in columns)])
    last_us = max([10, *(len(counts) for counts in columns)])
    floor = 10.0 ** math.floor(math.log10(0.9 / greatest))
    panels = []
    overflows = 0
    for part, name in enumerate(PARTS):
        panel = Panel(Label.plain('share'), y_range=(floor, 1.0), height_px=105.0, log=True)
        for number, histogram in histograms.items():
            overflows += histogram.overflows[part]
            total = float(histogram.counts[part].sum())
            if total > 0.0:
                x, y = outline(histogram.counts[part], total, floor)
                panel.curves.append(Curve(number, name, run_style(number), x, y, legend=runs[number].label,
                                          group=f'run {number}'))
        panels.append(panel)
    caption = ('Share of the cycles by duration: (a) lateness of the wake-up, (b) reading the board, (c) control, (d) writing, '
               '(e) the whole cycle. Bins are about a tenth of a decade wide and hold whole microseconds; the first bin holds '
               'all durations below 1 µs. The axis ends below one cycle.')
    if overflows > 0:
        caption += f" {overflows} durations beyond the histograms' range are not shown."
    return Figure('timing', 'Timing of the control cycle', Label.plain('duration / µs'), panels, caption,
                  (0.5, 10.0 ** math.ceil(math.log10(last_us))), 'timing')
