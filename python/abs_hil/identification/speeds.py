"""A rig's parameters from coarse traces of wheel speeds (traces.py), where no counts are known.

The plant runs open loop under the duties of each trace, from wheels that roll on each other, and its readings are compared with
those of the trace. The sum over all readings of the soft square 2 (sqrt(1 + e^2) - 1) is least, with

    e    (reading - simulated one) / s,   s^2 = resolution^2 / 12 + (what the fit leaves)^2     of each channel

by Gauss and Newton from several starts. What such a fit leaves is the model's error more than the readings', and follows itself
from reading to reading. So an interval comes from leaving out one stretch of time after the other (delete-a-group jackknife,
Kott 2001): with estimates q_i of G such fits, variance (G - 1) / G sum (q_i - mean)^2 and Student's t of G - 1; widened by how far
the estimate moves if J1 or the tyre's knee stays at the start's value, or the lag is the other one, where that fits hardly worse.

Readings that are means do not tell a short lag from a dead time: where the fastest lag fits hardly worse, it is taken, and the
dead time holds the rest. In the same way a step whose instant is not known tells no dead time.

What the traces do not tell of the knee stays near the start: that is as good as one more reading of its logarithm, with s = 1.
Of each trace its own, and not reported: the speed at which it begins, the instant of the brake's first edge, and the scales of
slip and lower wheel, from readings before the brake where there are enough of them.
"""
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..core import _core
from ..options import PathLike, options
from .found import Estimate
from .intervals import WIDTH
from .parameters import ALL_FORMS, DEAD_TIME, Form, base_options, checked_keys
from .traces import Trace

STEP_S = 1e-3
#: an estimate is called identified if the half width of its interval is at most this share of it
LARGEST_HALF_WIDTH = 0.25
#: the longest stretch that the jackknife leaves out, and how many there are of a trace at most
STRETCH_S, MOST_STRETCHES = 0.25, 8
#: what the fit may leave, of the spread of a channel's readings about their mean
LARGEST_LEFT = 0.5
#: a fit with one number less counts as hardly worse below this factor over the cost
HARDLY_WORSE = 1.2
#: how far the brake's first edge may lie from where it is told to be
EDGE_S = 0.02
#: the fastest lag
FASTEST_PER_S = 900.0
FRICTION, FULL, LAG = 'friction_over_start', 'brake_torque_at_{:g}_Nm', 'c31_per_s'
STARTS = [{DEAD_TIME.key: dead_s, LAG: rate_per_s, FRICTION: friction}
          for dead_s in (0.004, 0.012, 0.02) for rate_per_s in (500.0, 33.0) for friction in (1.0, 0.5)]


@dataclass(frozen=True)
class Free:
    """A number that is fitted: first value and range; by its logarithm if it is above 0, else in hundredths; trace: the one that
    it belongs to, -1 for all."""
    key: str
    first: float
    least: float
    most: float
    trace: int = -1

    def to_x(self, value: float) -> float:
        return math.log(value) if self.least > 0.0 else 100.0 * value

    def value(self, x: float) -> float:
        return math.exp(x) if self.least > 0.0 else 0.01 * x


@dataclass
class SpeedsFound:
    """What identify_speeds() found. parameters: by name with unit; left: (trace, channel, RMS of what the fit leaves, unit);
    plant: its numbers by key; misfit: why there is no model, empty if there is one."""
    start: str
    form: Form
    base: Any
    parameters: dict[str, Estimate]
    traces: list[Trace]
    plant: dict[str, float]
    notes: list[str]
    left: list[tuple[str, str, float, str]] = field(default_factory=list)
    misfit: str = ''


class Model:
    """Readings of all traces, by `channels` with their trace's number, for numbers x, one for each of `free`; the first ones,
    `shared`, are of the rig."""

    def __init__(self, traces: Sequence[Trace], start: PathLike, fix: Mapping[str, float | None],
                 check: Callable[[], None]) -> None:
        given = _core.PlantOptions(options(plant=start)).values()
        self.traces, self.start, self.check = list(traces), str(start), check
        self.channels = [(number, one) for number, trace in enumerate(traces) for one in trace.channels]
        self.form = next(one for one in ALL_FORMS if one.settings == {f'plant.{key}': given[key] for key in ('tyre', 'load')})
        self.base = base_options(self.form, start)
        self.given = {key: float(given[key]) for key in ('J2_kg_m2', 'r2_m', *(p.key for p in self.form.parameters))}
        self.given.update({key: value for key, value in fix.items() if value is not None})
        self.radii = {'upper': self.given['r1_m'], 'lower': self.given['r2_m']}
        self.knee = 'mu_a' if 'mu_a' in self.given else 'B'
        self.duties = sorted({float(u) for trace in traces for u in trace.brake_pwm if u > 0.0})
        if not self.duties:
            raise ValueError('in no trace does the brake act; give one with a brake duty')
        shared = [Free(DEAD_TIME.key, 0.01, 0.0, DEAD_TIME.most), Free(LAG, 20.0, 3.0, FASTEST_PER_S),
                  Free(FRICTION, 1.0, 0.1, 5.0)]
        for key, value, factor in (('J1_kg_m2', self.given['J1_kg_m2'], 2.5), (self.knee, max(self.given[self.knee], 1e-12), 50.0),
                                   *((FULL.format(duty), max(self.given['b1_Nm'] * duty + self.given['b2_Nm'], 0.1), 10.0)
                                     for duty in {self.duties[0], self.duties[-1]})):
            shared.append(Free(key, value, value / factor, value * factor))
        self.shared = [one for one in shared if one.key not in fix]
        self.free = self.shared + [one for number, trace in enumerate(traces) for one in self._own(number, trace)]

    def _own(self, number: int, trace: Trace) -> list[Free]:
        """Of one trace alone."""
        first = next(one for one in trace.channels if one.kind != 'slip')
        begins = float(np.median(first.value[:3])) / (self.radii[first.kind] if first.at_rim else 1.0)
        kinds = {one.kind for one in trace.channels}
        return ([Free('begins', begins, 0.5 * begins, 1.5 * begins, trace=number)]
                + [Free('edge', 0.0, -EDGE_S, EDGE_S, number)] * trace.edge_fitted
                + [Free(f'scale_{kind}', 1.0, 0.9, 1.1, trace=number) for kind in ('slip', 'lower')
                   if kind in kinds and len(kinds) > 1 and kind not in trace.scales])

    def plant_values(self, x: np.ndarray) -> dict[str, float]:
        """The plant of x."""
        numbers = {one.key: one.value(at) for one, at in zip(self.shared, x)}
        values = self.given | {key: value for key, value in numbers.items() if key in self.base.values()}
        for key in self.form.road:
            values[key] *= numbers.get(FRICTION, 1.0)
        torques = [(duty, numbers[FULL.format(duty)]) for duty in self.duties if FULL.format(duty) in numbers]
        if len(torques) == 2:
            (u, low), (v, high) = torques
            values['b1_Nm'] = max((high - low) / (v - u), 0.1)
            values['b2_Nm'] = high - values['b1_Nm'] * v
            values['u0'] = float(np.clip(-values['b2_Nm'] / values['b1_Nm'], 0.0, u))
        elif torques:
            factor = torques[0][1] / max(values['b1_Nm'] * torques[0][0] + values['b2_Nm'], 0.1)
            values['b1_Nm'], values['b2_Nm'] = values['b1_Nm'] * factor, values['b2_Nm'] * factor
        return values

    def estimated(self, x: np.ndarray) -> dict[str, float]:
        """What is told of the rig, by name."""
        values, named = self.plant_values(x), {one.key: one.value(at) for one, at in zip(self.shared, x)}
        told = (DEAD_TIME.key, LAG, 'b1_Nm', 'b2_Nm', 'u0', 'J1_kg_m2', self.knee, *self.form.road)
        return ({key: values[key] for key in told if key in values} | {FRICTION: named.get(FRICTION, 1.0)}
                | {FULL.format(duty): values['b1_Nm'] * duty + values['b2_Nm'] for duty in self.duties})

    def left(self, x: np.ndarray) -> list[np.ndarray]:
        """Readings less simulated ones, of each channel."""
        plant = self.plant_values(x)
        return [left for number, trace in enumerate(self.traces) for left in self._left(
            trace, plant, {one.key: one.value(at) for one, at in zip(self.free, x) if one.trace == number})]

    def _left(self, trace: Trace, plant: Mapping[str, float], own: Mapping[str, float]) -> Iterator[np.ndarray]:
        keys, radii, changes = trace.keys, self.radii, trace.duty_time_s.copy()
        if 'edge' in own:
            first = int(np.argmax(trace.brake_pwm > 0.0))
            after = changes[first + 1] - 1e-6 if first + 1 < len(changes) else np.inf
            changes[first] = min(changes[first] + own['edge'], after)
        ages = {kind: keys.get(f'{kind}_age_s', 0.0) for kind in ('speed', 'slip')}
        window = keys.get('window_s', 0.0) or STEP_S
        begin = trace.begin_s - max(ages.values()) - window - STEP_S
        time_s = np.unique(np.concatenate([np.arange(begin, trace.end_s + STEP_S, STEP_S),
                                           changes[(changes > begin) & (changes < trace.end_s)]]))
        at = np.searchsorted(changes, time_s, 'right') - 1
        brake, motor = (np.where(at >= 0, duty[np.maximum(at, 0)], 0.0) for duty in (trace.brake_pwm, trace.motor_pwm))
        rolls = own['begins'] * radii[next(one.kind for one in trace.channels if one.kind != 'slip')]  # m/s at both rims
        angles = _core.trajectory(self.base, list(plant.items()), {
            'time_s': time_s, 'brake_pwm': brake, 'motor_pwm': motor, 'wheels_apart': np.zeros(len(time_s))},
            np.array([0.0, 0.0, rolls / radii['upper'], rolls / radii['lower'], 0.0]))

        def speed(wheel: str, ends: np.ndarray) -> np.ndarray:
            of = angles[:, 0 if wheel == 'upper' else 1]
            return (np.interp(ends, time_s, of) - np.interp(ends - window, time_s, of)) / window
        for one in trace.channels:
            scale = trace.scales.get(one.kind, own.get(f'scale_{one.kind}', 1.0))
            if one.kind == 'slip':
                upper, lower = (radii[wheel] * speed(wheel, one.time_s - ages['slip']) for wheel in radii)
                read = 1.0 - scale * upper / np.maximum(lower, 1e-3)
            else:
                read = scale * (radii[one.kind] if one.at_rim else 1.0) * speed(one.kind, one.time_s - ages['speed'])
            yield one.value - read


def _least(model: Model, x0: np.ndarray, sizes: Sequence[float], most: int, held: str = '',
           without: tuple[int, float, float] = (-1, 0.0, 0.0)) -> tuple[np.ndarray, float]:
    """The least sum of soft squares from x0: (x, its half). held: key that stays; without: a trace and the stretch that is left
    out of it."""
    import scipy.optimize
    moves = np.array([one.key != held for one in model.free])
    low, high = (np.array([one.to_x(getattr(one, edge)) for one in model.free])[moves] for edge in ('least', 'most'))
    number, begin, end = without
    kept = np.concatenate([~((i == number) & (one.time_s >= begin) & (one.time_s < end)) for i, one in model.channels])
    scale = np.repeat(sizes, [len(one.value) for _, one in model.channels])
    knees = [(i, one.to_x(one.first)) for i, one in enumerate(model.free) if one.key == model.knee]
    x = x0.copy()

    def residual(part: np.ndarray) -> np.ndarray:
        model.check()
        x[moves] = part
        try:
            left = np.concatenate(model.left(x))
        except ValueError:  # this friction would wedge the lever
            left = 100.0 * scale
        return np.append((left / scale)[kept], [x[i] - to for i, to in knees])
    best = scipy.optimize.least_squares(residual, np.clip(x0[moves], low + 1e-6, high - 1e-6), bounds=(low, high), loss='soft_l1',
                                        max_nfev=most, diff_step=1e-4, x_scale='jac')
    x[moves] = best.x
    return x, float(best.cost)


def identify_speeds(traces: Sequence[Trace], start: PathLike = 'inteco-manual', *, fix: Mapping[str, float | None] | None = None,
                    say: Callable[[str], None] = lambda _: None, check: Callable[[], None] = lambda: None) -> SpeedsFound:
    """Estimates brake, friction and J1 from coarse traces (load_trace), with intervals of 95 %. All else is the start's.

    start: plant with the radii, J2, bearings and the form of tyre and load; `friction_over_start` refers to its friction
    fix:   parameters to leave alone: at their start value (None) or at the given one
    say, check: as for `identify`

    Raises ValueError for unknown keys, and for traces in which no brake acts."""
    fix = dict(fix or {})
    checked_keys({key: value for key, value in fix.items() if key != DEAD_TIME.key}, start)
    model = Model(traces, start, fix, check)
    say(f'{model.form.meaning}: {len(STARTS)} starts')
    spans = [max(float(np.ptp(one.value)) / 10.0, one.resolution) for _, one in model.channels]
    begun = sorted((_least(model, np.array([one.to_x(first.get(one.key, one.first)) for one in model.free]), spans, 8)
                    for first in STARTS), key=lambda one: one[1])
    say('fit')
    x, _ = min((_least(model, one, spans, 40) for one, _ in begun[:3]), key=lambda one: one[1])
    for _ in range(2):
        sizes = [float(np.hypot(one.resolution / np.sqrt(12.0), 1.4826 * np.median(np.abs(left)))) + 1e-9
                 for (_, one), left in zip(model.channels, model.left(x))]
        x, cost = _least(model, x, sizes, 40)
    say('intervals')
    shared, keys = len(model.shared), [one.key for one in model.free]
    estimates = np.array([_least(model, x, sizes, 10, without=stretch)[0][:shared] for stretch in _stretches(traces)])
    groups = len(estimates)
    covariance = (groups - 1)**2 / groups * np.cov(estimates.T, ddof=1).reshape(shared, shared)
    found, moves = x, []
    for key, value in (('J1_kg_m2', model.given['J1_kg_m2']), (model.knee, model.given[model.knee]), (LAG, FASTEST_PER_S)):
        if key in keys:
            held = x.copy()
            held[keys.index(key)] = model.free[keys.index(key)].to_x(value)
            other, worse = _least(model, held, sizes, 20, key)
            if worse < HARDLY_WORSE * cost:
                moves.append(other[:shared] - x[:shared])
                found = other if key == LAG else found
    return _assembled(model, found, covariance, groups, moves)


def _stretches(traces: Sequence[Trace]) -> Iterator[tuple[int, float, float]]:
    for number, trace in enumerate(traces):
        count = int(np.clip(round((trace.end_s - trace.begin_s) / STRETCH_S), 1 if len(traces) > 1 else 2, MOST_STRETCHES))
        edges = np.linspace(trace.begin_s, trace.end_s + 1e-6, count + 1).tolist()
        yield from ((number, begin, end) for begin, end in zip(edges, edges[1:]))


def _assembled(model: Model, x: np.ndarray, covariance: np.ndarray, groups: int, moves: Sequence[np.ndarray]) -> SpeedsFound:
    import scipy.stats
    width = float(scipy.stats.t.ppf(0.975, groups - 1))
    units = {p.key: p.unit for p in (*model.form.parameters, DEAD_TIME)}
    steps = [model.estimated(x + 1e-4 * one) for one in np.eye(len(x))[:len(model.shared)]]
    found = SpeedsFound(model.start, model.form, model.base, {}, model.traces, model.plant_values(x), [])
    for key, value in model.estimated(x).items():
        unit = units.get(key, 'N m' if key.endswith('_Nm') else '1')
        gradient = np.array([(step[key] - value) / 1e-4 for step in steps])
        reach = float(np.sqrt(width**2 * max(gradient @ covariance @ gradient, 0.0) + sum((gradient @ move)**2 for move in moves)))
        if reach == 0.0:
            found.parameters[key] = Estimate.fixed(value, unit)
            continue
        e = found.parameters[key] = Estimate.normal(value, reach / WIDTH, unit, reach <= LARGEST_HALF_WIDTH * abs(value))
        own = next((one for one in model.shared if one.key == key), None)
        if own is not None and own.least > 0.0:
            e.low, e.high = value * math.exp(-reach / value), value * math.exp(reach / value)
        if own is not None and e.low is not None and e.high is not None:
            e.low = max(e.low, own.least)
            if e.high >= own.most:
                e.status, e.high = 'bounded', None
                found.notes.append(f'the traces do not tell a largest {key}')
    doubted: list[tuple[tuple[str, ...], str]] = []
    if all(trace.edge_fitted and np.sum(np.diff(trace.brake_pwm, prepend=0.0) > 0.0) < 2 for trace in model.traces):
        doubted.append(((DEAD_TIME.key,), 'when the brake began, and so no dead time'))
    if len(model.duties) == 1:
        doubted.append((('b1_Nm', 'b2_Nm'), "how the brake's torque depends on its duty: they have one"))
    for keys, what in doubted:
        if 'fixed' not in [found.parameters[key].status for key in keys]:
            found.notes.append(f'the traces do not tell {what}')
            for key in keys:
                found.parameters[key].withdraw()
    worst = LARGEST_LEFT
    for (number, one), left in zip(model.channels, model.left(x)):
        name, rms, spread = model.traces[number].name, float(np.sqrt(np.mean(left**2))), float(np.std(one.value))
        found.left.append((name, one.kind, rms, '1' if one.kind == 'slip' else 'm/s' if one.at_rim else 'rad/s'))
        if rms > worst * spread:
            worst = rms / max(spread, 1e-300)
            found.misfit = (f'the fit did not get there: it leaves {rms:.3g} RMS of {name}, {one.kind}, whose readings spread by '
                            f'{spread:.3g}. Does --reading say how they were read, and when the brake began?')
    if found.misfit:
        found.parameters = {key: e for key, e in found.parameters.items() if e.status == 'fixed'}
    return found
