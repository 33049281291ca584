"""The figures of runs over time: the time histories, the counterparts of the paper's figures 5 to 10, the signals; and the
histograms of the cycle's timing."""
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Union

import numpy as np

from ..run import Run, stretches
from .files import PARTS, RunFiles
from .model import STYLES, Bar, Curve, Figure, Label, Mark, Panel, Shade, Style, axis_around, phase_colour, run_style, thinned
from .survey import JUDGED_M_S, Survey, survey
from .text import short_names

BESIDE_BRAKE_S = 0.2
#: more than two points per pixel are invisible; with many curves fewer are enough
MOST_STRETCHES = 1400
STRETCHES_OF_ALL_RUNS = 9000
LEAST_STRETCHES = 80
MOST_LEGEND_ENTRIES = 12
MOST_MARKS = 200
MOST_STRIPS = 12
STRIP_CHARACTERS = 16
MOST_BARS = 60  # of a run; more would be unreadable
DOUBLE_PX = 165.0
MOST_DRAWN = 1e30  # axes are drawn in single precision
PX_A_MARK = 34.0
BINS_A_DECADE = 10.0  # of histograms
REFERENCE, SECOND = Style('#000000', (2, 3), 1.1), Style('#D55E00', (7, 4), 1.3)
TIME = Label('time since the start of the run, <i>t</i> / s', 'time since the start of the run, $t$ / s')
#: which part of the runs the figures show: 'brake', braking with a margin; 'run', all; or seconds of the run
Choice = Union[str, tuple[float, float]]


@dataclass
class Options:
    choice: Choice = 'brake'
    paper_colours: bool = False
    groups: Sequence[int] = ()  # of each run; runs of one group share a style. Empty: none
    group_labels: Sequence[str] = ()


@dataclass
class Window:
    from_s: float  # in the run's own time
    to_s: float
    zero_s: float  # run time of the axis' zero


@dataclass
class Profile:
    """A thinned curve, and its least and greatest value while the car brakes above 3 m/s."""
    x: np.ndarray
    y: np.ndarray
    relevant: tuple[float, float] = (math.inf, -math.inf)


def window_of(found: Survey, choice: Choice, braking: bool) -> Window:
    if not isinstance(choice, str):
        return Window(*choice, 0.0)
    if choice == 'brake' and braking:
        return Window(found.brake_from_s - BESIDE_BRAKE_S, found.brake_to_s + BESIDE_BRAKE_S, found.brake_from_s)
    return Window(found.from_s, found.to_s, 0.0)


def _requests(found: Survey, window: Window) -> Iterator[tuple[str, str, str, bool, Window]]:
    """(name, column, column to subtract, only in braking, window) of every curve. Truth where a run has it."""
    def best(truth: str, estimate: str) -> str:
        return truth if truth in found.known else estimate
    whole = Window(found.from_s, found.to_s, 0.0)
    braking = found.brakes
    slip = best('slip', 'slip_est')
    for wheel in '12':
        speed = best(f'omega{wheel}_rad_s', f'omega{wheel}_est_rad_s')
        yield f'profile_omega{wheel}', speed, '', False, whole
        yield f'omega{wheel}', speed, '', False, window
        yield f'omega{wheel}_est', f'omega{wheel}_est_rad_s', '', False, window
    yield 'slip', slip, '', braking, window
    yield 'slip_ref', 'slip_ref', '', braking, window
    yield 'slip_error', slip, 'slip_ref', braking, window
    yield 'torque_ref', 'brake_torque_ref_Nm', '', False, window
    yield 'torque', best('brake_torque_Nm', 'brake_torque_est_Nm'), '', False, window
    yield 'theta_est', 'theta_est_N', '', False, window
    yield 'theta', 'theta_N', '', braking, window
    yield 'theta_error', 'theta_N', 'theta_est_N', braking, window
    yield 'distance', 'distance_m', '', False, window
    for signal in found.signals:
        yield f'signal {signal}', signal, '', False, window


def profiles_of(rows: Run, found: Survey, window: Window, most_stretches: int) -> dict[str, Profile]:
    """Every curve of a run, thinned."""
    time, braking = rows.columns['time_s'], rows.columns['phase'] == 'brake'
    speed = rows.columns['omega2_rad_s' if 'omega2_rad_s' in found.known else 'omega2_est_rad_s']
    with np.errstate(invalid='ignore'):
        judged = braking & (found.r2_m * speed > JUDGED_M_S)
    profiles = {}
    for name, column, minus, braking_only, part in _requests(found, window):
        inside = slice(int(np.searchsorted(time, part.from_s)), int(np.searchsorted(time, part.to_s, 'right')))
        values = rows.columns[column][inside]
        if minus:
            with np.errstate(over='ignore', invalid='ignore'):
                values = values - rows.columns[minus][inside]
        values = np.where(np.abs(values) < MOST_DRAWN, values, np.nan)
        if braking_only:
            values = np.where(braking[inside], values, np.nan)
        relevant = values[judged[inside] & np.isfinite(values)]
        ends = [(float(relevant.min()), float(relevant.max()))] if len(relevant) else []
        profiles[name] = Profile(*thinned(time[inside] - part.zero_s, values, most_stretches), *ends)
    return profiles


class FigureMaker:
    def __init__(self, runs: list[RunFiles], surveys: list[Survey], windows: list[Window],
                 profiles: list[dict[str, Profile]], options: Options, braking: bool) -> None:
        self.runs, self.surveys, self.windows, self.profiles, self.options = runs, surveys, windows, profiles, options
        text = 'time since the start of braking' if braking else 'time'
        self.x_label = Label(f'{text}, <i>t</i> / s', f'{text}, $t$ / s')
        self.x_range = (min(w.from_s - w.zero_s for w in windows), max(w.to_s - w.zero_s for w in windows))
        self.axis = 'braking' if braking else 'run'
        self.shades = [Shade(p.from_s - windows[0].zero_s, p.to_s - windows[0].zero_s, p.phase)
                       for p in surveys[0].phases[:MOST_MARKS]]
        self.marks: list[Mark] = []
        self._add_marks()

    def figures(self) -> list[Figure]:
        made = [self._braking(), self._profile(), self._speed(1), self._speed(2), self._slip(), self._torque(), self._theta(),
                self._distance()]
        signals = self._signals()
        return [*made, signals] if signals.panels else made

    # ---- what the figures share

    def _style(self, run: int) -> Style:
        group = self.options.groups[run] if self.options.groups else run
        style = run_style(group)
        if self.options.paper_colours:
            style = Style('#000000' if group == 0 else '#9a9a9a')
        return Style(style.colour, style.dash, 0.6) if len(self.runs) > MOST_LEGEND_ENTRIES else style

    def _legend(self, run: int) -> tuple[str, str]:
        """(legend text, group) of a run's curves; no text with too many runs."""
        if self.options.groups:
            group = self.options.groups[run]
            return self.options.group_labels[group], f'group {group}'
        return (self.runs[run].label if len(self.runs) <= MOST_LEGEND_ENTRIES else ''), f'run {run}'

    def _add_marks(self) -> None:
        for number in range(min(len(self.runs), MOST_LEGEND_ENTRIES)):
            found, run, zero = self.surveys[number], self.runs[number], self.windows[number].zero_s
            self.marks += [Mark(p.from_s - zero, 'fault', True) for p in found.phases if p.phase == 'fault']
            self.marks += [Mark(event.time_s - zero, event.event, event.event == 'fault') for event in run.events
                           if event.unusual and event.phase != 'fault']
            if number == 0:  # as the background
                self.marks += [Mark(p.from_s - zero, p.name) for p in found.phases if p.name]
            for change in found.changes:  # runs of one experiment change alike
                mark = Mark(change.time_s - zero, change.label)
                if not any(m.label == mark.label and abs(m.x - mark.x) < 1e-6 for m in self.marks):
                    self.marks.append(mark)
        del self.marks[MOST_MARKS:]

    def _begin(self, id_: str, heading: str, caption: str, panels: list[Panel], paper: int = 0) -> Figure:
        return Figure(id_, heading, self.x_label, panels, caption.strip(), self.x_range, self.axis, self.shades, self.marks, paper)

    def _add(self, panel: Panel, run: int, quantity: str, style: Style, legend: str = '', group: str = '',
             title: str = '') -> None:
        profile = self.profiles[run].get(quantity)
        if profile is not None and len(profile.x):
            panel.curves.append(Curve(run, quantity.removeprefix('signal '), style, profile.x, profile.y, legend=legend,
                                      group=group, title=title))

    def _add_all(self, panel: Panel, quantity: str) -> None:
        for run in range(len(self.runs)):
            legend, group = self._legend(run)
            self._add(panel, run, quantity, self._style(run), legend, group)

    def _panel(self, quantity: str, label: Label, height_px: float = DOUBLE_PX, **more: Any) -> Panel:
        panel = Panel(label, height_px=height_px, **more)
        self._add_all(panel, quantity)
        return panel

    def _add_reference(self, panel: Panel, quantity: str, legend: str) -> None:
        """A quantity that most runs share, as a thin dotted line: each different curve once."""
        drawn: list[np.ndarray] = []
        for run in range(len(self.runs)):
            values = self.profiles[run][quantity].y
            values = values[np.concatenate(([True], values[1:] != values[:-1]))] if len(values) else values
            if not any(np.array_equal(values, other, equal_nan=True) for other in drawn):
                drawn.append(values)
                self._add(panel, run, quantity, REFERENCE, legend, legend, f'{legend} of {panel.title}')

    def _relevant(self, quantities: tuple[str, ...], least: tuple[float, float]) -> tuple[float, float] | None:
        """Range of y above 3 m/s; towards standstill slip and its estimates diverge."""
        ranges = [profiles[name].relevant for profiles in self.profiles for name in quantities]
        ranges = [(low, high) for low, high in ranges if low <= high]
        if not ranges:
            return None
        return axis_around(min(least[0], *(low for low, _ in ranges)), max(least[1], *(high for _, high in ranges)),
                           int(DOUBLE_PX / PX_A_MARK))

    def _estimated(self, column: str) -> str:
        known = all(column in found.known for found in self.surveys)
        return '' if known else ' Runs without true values show estimates from the encoders.'

    # ---- the figures

    def _braking(self) -> Figure:
        speeds = Panel(Label('<i>ω</i> / (rad/s)', r'$\omega$ / (rad/s)'), height_px=180.0, unit='rad/s')
        for run in range(len(self.runs)):
            legend, group = self._legend(run)
            style = self._style(run)
            self._add(speeds, run, 'omega1', style, legend, group, 'ω₁')
            self._add(speeds, run, 'omega2', Style(style.colour, (1, 3), style.width), legend, group, 'ω₂')
        caption = ('(a) speeds of the upper wheel ω₁, which brakes, and dotted of the lower wheel ω₂, the road; (b) slip and its '
                   'reference (dotted), over the range above 3 m/s; (c) the torque that the controller asks for. ')
        of_run = '' if len(self.runs) == 1 else f' of {self.runs[0].label}'
        caption += (f'The background of all figures has the colours of the phases{of_run}: braking has none, the time '
                    'history names the others.')
        return self._begin('braking', 'Braking', caption + self._estimated('omega1_rad_s'),
                           [speeds, self._slip_panel(), self._asked_panel('torque / (N m)')])

    def _speed(self, wheel: int) -> Figure:
        name, upper = f'omega{wheel}', wheel == 1
        label = Label(f'<i>ω</i><sub>{wheel}</sub> / (rad/s)', rf'$\omega_{{{wheel}}}$ / (rad/s)')
        panel = Panel(label, height_px=240.0, title=f'ω{"₁" if upper else "₂"}', unit='rad/s')
        if len(self.runs) == 1 and f'{name}_rad_s' in self.surveys[0].known:
            self._add(panel, 0, name, self._style(0), 'wheel', 'wheel')
            self._add(panel, 0, f'{name}_est', SECOND, 'estimate', 'estimate')
        else:
            self._add_all(panel, name)
        return self._begin(f'fig{4 + wheel}', f'{"Upper" if upper else "Lower"} wheel speed', self._estimated(f'{name}_rad_s'),
                           [panel], 4 + wheel)

    def _slip_panel(self) -> Panel:
        panel = self._panel('slip', Label('slip <i>λ</i>', r'slip $\lambda$'), title='slip',
                            y_range=self._relevant(('slip', 'slip_ref'), (0.0, 0.2)))
        self._add_reference(panel, 'slip_ref', 'reference')
        return panel

    def _asked_panel(self, label: str) -> Panel:
        return self._panel('torque_ref', Label.plain(label), title='torque asked for', unit='N m')

    def _slip(self) -> Figure:
        error = self._panel('slip_error', Label('<i>λ</i> − <i>λ</i><sub>ref</sub>', r'$\lambda - \lambda_\mathrm{ref}$'),
                            y_range=self._relevant(('slip_error',), (-0.05, 0.05)), title='slip minus reference')
        return self._begin('fig7', 'Wheel slip and tracking error',
                           '(a) slip and its reference (dotted), (b) slip minus reference. The axes cover the range above '
                           '3 m/s; slip diverges towards standstill.' + self._estimated('slip'), [self._slip_panel(), error], 7)

    def _torque(self) -> Figure:
        acting = self._panel('torque', Label.plain('acting / (N m)'), title='acting torque', unit='N m')
        return self._begin('fig8', 'Brake torque',
                           "(a) the controller's torque reference, (b) the torque that acts behind the brake's lag."
                           + self._estimated('brake_torque_Nm'), [self._asked_panel('reference / (N m)'), acting], 8)

    def _theta(self) -> Figure:
        truth = any('theta_N' in found.known for found in self.surveys)
        caption = ("(a) estimate, and the plant's θ (dotted), (b) θ minus its estimate. The axes cover the range above 3 m/s."
                   if truth else 'Estimate only: these runs have no true θ, so the error is unknown.')
        if not any('theta_est_N' in found.known for found in self.surveys):
            caption += ' No controller of these runs estimates θ.'
        theta = self._panel('theta_est', Label('<i>θ</i> / N', r'$\theta$ / N'), DOUBLE_PX if truth else 240.0, title='θ estimate',
                            unit='N', y_range=self._relevant(('theta_est', 'theta'), (0.0, 1.0)))
        panels = [theta]
        if truth:
            self._add_reference(theta, 'theta', "plant's value")
            panels.append(self._panel('theta_error', Label('error of <i>θ</i> / N', r'error of $\theta$ / N'),
                                      y_range=self._relevant(('theta_error',), (-1.0, 1.0)), title='error of θ', unit='N'))
        return self._begin('fig9', 'Estimate of the friction parameter θ', caption, panels, 9)

    def _distance(self) -> Figure:
        panel = self._panel('distance', Label.plain('distance / m'), 240.0, title='distance', unit='m')
        return self._begin('fig10', 'Braking distance', 'Distance of the car since the start of braking.', [panel], 10)

    def _signals(self) -> Figure:
        panels = [self._panel(f'signal {name}', Label.plain(name), max(110.0, 9.0 * len(name)), title=name)
                  for name in dict.fromkeys(name for found in self.surveys for name in found.signals)]
        return self._begin('signals', "The controllers' own signals",
                           'Each panel shows one signal of the runs whose controller reports it.', panels)

    def _profile(self) -> Figure:
        one = len(self.runs) == 1
        speeds = Panel(Label.plain('speed / (rad/s)'), height_px=200.0, title='speed', unit='rad/s')
        if one:
            self._add(speeds, 0, 'profile_omega2', self._style(0), 'lower wheel ω₂ (the road)', 'lower')
            self._add(speeds, 0, 'profile_omega1', Style('#909090', (3, 3), 1.0), 'upper wheel ω₁ (braked)', 'upper')
        else:
            self._add_all(speeds, 'profile_omega2')
        for curve in speeds.curves:
            curve.quantity = curve.quantity.removeprefix('profile_')
        caption = '(a) Speeds of both wheels. ' if one else '(a) Speed of the lower wheel, the road. '
        caption += (f'(b) Phases of the run{"" if one else "s"}, in the colours of the legend; a triangle marks an '
                    'event other than a change of phase.')
        if len(self.runs) > MOST_STRIPS:
            caption += f' Only the first {MOST_STRIPS} of {len(self.runs)} runs are shown.'
        return Figure('profile', 'Time history of the run' if one else 'Time histories of the runs', TIME,
                      [speeds, self._strips()], caption,
                      (min(found.from_s for found in self.surveys), max(found.to_s for found in self.surveys)), 'run')

    def _strips(self) -> Panel:
        """One strip a run with its phases, and marks at unusual events."""
        strips = min(len(self.runs), MOST_STRIPS)
        panel = Panel(Label.plain(''), y_range=(0.0, float(strips)), height_px=max(30.0, 24.0 * strips), grid=False)
        names = short_names([run.label if strips > 1 else '' for run in self.runs[:strips]], STRIP_CHARACTERS)
        for number in range(strips):
            run, found, bottom = self.runs[number], self.surveys[number], float(strips - 1 - number)
            panel.y_tics.append((bottom + 0.5, '' if strips == 1 else names[number]))
            panel.bars += [Bar(p.from_s, p.to_s, bottom + 0.12, bottom + 0.88, phase_colour(p.phase), p.shown)
                           for p in found.phases[:MOST_BARS]]
            times = [event.time_s for event in run.events if event.unusual]
            if not run.events:
                times += [p.from_s for p in found.phases if p.phase == 'fault']
            times = (times + [change.time_s for change in found.changes])[:MOST_BARS]
            if times:
                panel.curves.append(Curve(number, 'events', Style('#D55E00'), np.array(times),
                                          np.full(len(times), bottom + 0.5), 'markers', 'triangle', title='event'))
        for kind in dict.fromkeys(p.phase for found in self.surveys[:strips] for p in found.phases[:MOST_BARS]):
            panel.curves.append(Curve(0, 'phase', Style(phase_colour(kind)), np.zeros(1), np.full(1, np.nan), 'markers', 'square',
                                      legend=kind, group=f'phase {kind}'))
        return panel


def run_figures(runs: list[RunFiles], options: Options,
                progress: Callable[[int, int], None] | None) -> tuple[list[Survey], list[Figure]]:
    """The surveys and figures of all runs. Each CSV is read once, and again only if some runs do not brake."""
    surveys, windows, profiles = [], [], []
    shown = False
    most_stretches = min(max(STRETCHES_OF_ALL_RUNS // max(len(runs), 1), LEAST_STRETCHES), MOST_STRETCHES) // 2 * 2
    for number, run in enumerate(runs, 1):
        rows = run.rows()
        found = survey(run, rows)
        surveys.append(found)
        windows.append(window_of(found, options.choice, found.brakes))
        time_s = rows.columns['time_s']
        shown |= bool(((time_s >= windows[-1].from_s) & (time_s <= windows[-1].to_s)).any())
        profiles.append(profiles_of(rows, found, windows[-1], most_stretches))
        if progress is not None:
            progress(number, len(runs))
    if not shown:
        raise ValueError(f'--window {windows[0].from_s:g}:{windows[0].to_s:g} holds no row; give seconds within '
                         f'{min(found.from_s for found in surveys):g}:{max(found.to_s for found in surveys):g}')
    braking = options.choice == 'brake' and all(found.brakes for found in surveys)
    if options.choice == 'brake' and not braking:
        for number, found in enumerate(surveys):
            if found.brakes:
                windows[number] = window_of(found, options.choice, False)
                profiles[number] = profiles_of(runs[number].rows(), found, windows[number], most_stretches)
    return surveys, FigureMaker(runs, surveys, windows, profiles, options, braking).figures()


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
    if not (histograms := dict(itertools.islice(timed, STYLES))):
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
                panel.curves.append(Curve(number, name, run_style(number), x, y, legend=runs[number].label, group=f'run {number}'))
        panels.append(panel)
    caption = ('Share of the cycles by duration: (a) lateness of the wake-up, (b) reading the board, (c) control, (d) writing, '
               '(e) the whole cycle. Bins are about a tenth of a decade wide and hold whole microseconds; the first bin holds '
               'all durations below 1 µs. The axis ends below one cycle.')
    if overflows > 0:
        caption += f" {overflows} durations beyond the histograms' range are not shown."
    return Figure('timing', 'Timing of the control cycle', Label.plain('duration / µs'), panels, caption,
                  (0.5, 10.0 ** math.ceil(math.log10(last_us))), 'timing')
