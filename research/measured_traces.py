#!/usr/bin/env python3
"""usage: measured_traces.py --check|--write|--draw FILE|--table [PLANT...]

Runs the experiments that were measured on a real rig (config/measured) on the simulated plants, and compares. --write puts the
table into docs/plants.md between the lines

    <!-- measured -->
    <!-- end -->

--check fails where the page says something else, --draw draws docs/figures/measured.svg (needs matplotlib), --table prints the
table, for these plants if some are named. Needs the package abs_hil of a build (PYTHONPATH=build/release/share/abs_hil/python).

What is compared. Open loop: the recorded commands drive the plant; the speed at the start and the first edge of the relay run,
and the instants of the steps and of the motor's start, are fitted, since the drawings do not give them. Closed loop: a relay
in the simulation brakes fully while the slip is below 0.1. The board's readings are made as the maker's are, every T = 10 ms:

    slip   1 - 0.9861 r1 (theta1(t) - theta1(t - T)) / (r2 (theta2(t) - theta2(t - T)))
    speed  (theta1(t - 7.6 ms) - theta1(t - 7.6 ms - T)) / T
"""
import csv
import dataclasses
import functools
import itertools
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
import numpy as np
from marked_tables import ROOT, keep  # noqa: E402

import abs_hil

DATA = ROOT / 'config' / 'measured'
PLANTS = ('measured-relay', 'measured-step', 'inteco-manual')
STEPS = ('0.65', '0.7', '0.75')
R1_M, R2_M = 0.0995, 0.0990
RPM = np.pi / 30.0

PERIOD_S, SPEED_AGE_S, SLIP_SCALE, THRESHOLD = 0.01, 0.0076, 0.9861, 0.1
#: readings that are compared: from before the brake acts until the wheels are slow
FIRST_S, LAST_S = 6.47, 8.8
#: the drawings' first readings before the brake, in which the plant only rolls
ROLLS_S = 0.03
#: from which the maker's relay brakes, rad/s
RELAY_FROM_RAD_S = 183.0
#: the first PEAKS of the slip that are higher than this; lower ones are the reading's noise
PEAKS, PEAK_ABOVE = 6, 0.3


def column(file, *names, where=None):
    with open(DATA / file, encoding='utf-8') as text:
        rows = [row for row in csv.DictReader(text) if where is None or row['wheel'] == where]
    return tuple(np.array([float(row[name]) for row in rows]) for name in names)


@functools.cache
def relay():
    return column('relay-0.1-10ms.csv', 'time_s', 'upper_rpm', 'slip_recorded')


@functools.cache
def step(duty):
    return {wheel: column(f'brake-step-{duty}.csv', 'time_s', 'rim_speed_m_s', where=wheel) for wheel in ('upper', 'lower')}


@functools.cache
def run_up():
    return column('run-up.csv', 'time_s', 'upper_rpm')


def rms(error):
    return float(np.sqrt(np.mean(np.square(error))))


class Recording:
    """A plant and its wheels' angles and speeds every millisecond."""

    def __init__(self, plant, omega2_rad_s, start_s=0.0):
        self.plant = plant
        plant.reset(omega1_rad_s=omega2_rad_s * R2_M / R1_M, omega2_rad_s=omega2_rad_s)
        self.time_s = [start_s]
        self.states = [plant.state]

    def advance(self, duration_s, **duties):
        while duration_s > 1e-9:
            part_s = min(duration_s, 1e-3)
            self.plant.advance(part_s, **duties)
            self.time_s.append(self.time_s[-1] + part_s)
            self.states.append(self.plant.state)
            duration_s -= part_s

    def of(self, name):
        return np.array([getattr(state, name) for state in self.states])

    def turned_rad(self, name, at_s):
        """In the last PERIOD_S before each instant."""
        angles = np.interp([at_s, at_s - PERIOD_S], self.time_s, self.of(name))
        return angles[0] - angles[1]

    def slips(self, at_s):
        upper, lower = (self.turned_rad(name, at_s) for name in ('angle1_rad', 'angle2_rad'))
        return np.where(lower > 0.0, 1.0 - SLIP_SCALE * R1_M * upper / (R2_M * np.maximum(lower, 1e-9)), 0.0)

    def upper_rpm(self, at_s):
        return self.turned_rad('angle1_rad', at_s - SPEED_AGE_S) / PERIOD_S / RPM


def least(cost, start, widths, near):
    """The least cost around the start, by steps that get finer; the widths span its surroundings. near: from an earlier search, so
    that a narrow one does."""
    around = [(s, w * np.arange(-1, 2) / 4.0 if near else w * np.arange(-2, 3)) for s, w in zip(near or start, widths)]
    best = min((cost(*x), x) for x in itertools.product(*(s + steps for s, steps in around)))
    for halving in range(3 if near else 1, 7):
        tried = itertools.product(*(b + w * 0.5 ** halving * np.array((-1, 1)) for b, w in zip(best[1], widths)))
        best = min([best, *((cost(*x), x) for x in tried)])
    return best[1]


# Each experiment: (times, measured, simulated) for each curve of it, and what was fitted. near: that of an earlier search.

def relay_open(plant, near=None):
    time_s, rpm, slip = relay()
    rows = np.flatnonzero((time_s > FIRST_S - ROLLS_S - 1e-9) & (time_s < LAST_S + 1e-9))
    compared = rows[time_s[rows] > FIRST_S - 1e-9]

    def run(start_rpm, edge_s):
        record = Recording(plant, start_rpm * RPM * R1_M / R2_M, time_s[rows[0]])
        for row in rows:
            late_s = min(max(edge_s - time_s[row], 0.0), PERIOD_S) if slip[row] < THRESHOLD else PERIOD_S
            record.advance(late_s)
            record.advance(PERIOD_S - late_s, brake_duty=1.0)
        at_s = time_s[compared]
        return (at_s, rpm[compared], record.upper_rpm(at_s)), (at_s, slip[compared], record.slips(at_s))

    def cost(*free):
        speed, slips = run(*free)
        return (rms(speed[2] - speed[1]) / 25.0) ** 2 + (rms(slips[2] - slips[1]) / 0.03) ** 2

    free = least(cost, (1730.0, 6.458), (20.0, 0.004), near)
    return run(*free), free


def relay_closed(plant):
    """The slips that a relay reads, every PERIOD_S, the way and the time of the stop."""
    record = Recording(plant, RELAY_FROM_RAD_S)
    slips = [0.0]
    while plant.state.omega2_rad_s * R2_M > 0.1 and len(slips) < 1000:
        record.advance(PERIOD_S, brake_duty=float(slips[-1] < THRESHOLD))
        slips.append(float(record.slips(np.array([record.time_s[-1]]))[0]))
    return np.array(slips), plant.state.angle2_rad * R2_M, record.time_s[-1]


def peaks(slips):
    inner = slips[1:-1]
    return inner[(inner >= slips[:-2]) & (inner > slips[2:]) & (inner > PEAK_ABOVE)][:PEAKS]


def brake_step(plant, duty, near=None):
    measured = step(duty)

    def run(edge_s):
        record = Recording(plant, measured['lower'][1][0] / R2_M)
        record.advance(edge_s)
        record.advance(0.85 - edge_s, brake_duty=float(duty))
        radius = {'upper': ('omega1_rad_s', R1_M), 'lower': ('omega2_rad_s', R2_M)}
        return tuple((at_s, speed, np.interp(at_s, record.time_s, r_m * record.of(name)))
                     for (at_s, speed), (name, r_m) in ((measured[wheel], radius[wheel]) for wheel in ('upper', 'lower')))

    def cost(edge_s):
        upper, lower = run(edge_s)
        return (rms(upper[2] - upper[1]) / 0.3) ** 2 + (rms(lower[2] - lower[1]) / 0.1) ** 2

    free = least(cost, (0.15,), (0.02,), near)
    return run(*free), free


def motor_run(plant, near=None):
    time_s, rpm = run_up()

    def run(late_s):
        record = Recording(plant, 0.0)
        record.advance(time_s[-1], motor_duty=1.0)
        return ((time_s, rpm, np.interp(time_s - late_s, record.time_s, record.of('omega1_rad_s')) / RPM),)

    free = least(lambda late_s: rms(run(late_s)[0][2] - rpm), (0.05,), (0.02,), near)
    return run(*free), free


@dataclasses.dataclass
class Compared:
    """A measured experiment and its simulation."""
    title: str
    curves: tuple  #: (time_s, measured, simulated) each
    errors: tuple  #: RMS of each curve
    free: tuple  #: what the drawings do not give
    words: str


#: trace -> (title, how it is run, RMS errors in words)
TRACES = {'relay': ('relay at slip 0.1, recorded commands', relay_open, '{:.0f} rpm, slip {:.3f}'),
          **{duty: (f'step of duty to {duty}', functools.partial(brake_step, duty=duty), '{:.2f}, {:.2f} m/s')
             for duty in STEPS},
          'run-up': ('run-up to 1,700 rpm', motor_run, '{:.0f} rpm')}
#: plant -> traces that it was fitted to
FITTED = {'measured-relay': ('relay', 'run-up'), 'measured-step': (*STEPS, 'run-up')}


def compared(plant, traces=tuple(TRACES), near=None):
    """The measured experiments on a plant, in order; name -> Compared. plant: an abs_hil.Plant, which is reset."""
    found = {}
    for trace in traces:
        title, run, words = TRACES[trace]
        curves, free = run(plant, near=(near or {}).get(trace))
        errors = tuple(rms(simulated - measured) for _, measured, simulated in curves)
        found[trace] = Compared(title, curves, errors, free, words.format(*errors))
    return found


def closed_words(plant):
    slips, way_m, time_s = relay_closed(plant)
    return ' '.join(f'{peak:.2f}' for peak in peaks(slips)) or f'none above {PEAK_ABOVE}', f'{way_m:.1f} m, {time_s:.2f} s'


def measured_peaks():
    return ' '.join(f'{peak:.2f}' for peak in peaks(relay()[2][relay()[0] > FIRST_S]))


def table(names=PLANTS):
    found = {name: compared(abs_hil.Plant(name)) for name in names}
    closed = {name: closed_words(abs_hil.Plant(name)) for name in names}
    lines = ['| RMS error; upper, lower wheel | ' + ' | '.join(f'`{name}`' for name in names) + ' |',
             '|---' * (1 + len(names)) + '|']
    for trace, (title, _, _) in TRACES.items():
        cells = [found[name][trace].words + (' (fitted)' if trace in FITTED.get(name, ()) else '') for name in names]
        lines.append(f'| {title} | ' + ' | '.join(cells) + ' |')
    lines += [f'| relay in the simulation: slip\'s first peaks (measured {measured_peaks()}) | ' +
              ' | '.join(closed[name][0] for name in names) + ' |',
              '| and its stop (measured 26.8 m, 3.01 s) | ' + ' | '.join(closed[name][1] for name in names) + ' |']
    return '\n'.join(lines) + '\n'


def draw(path, names=('inteco-manual', 'measured-relay', 'measured-step')):
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot
    pyplot.rcParams.update({'svg.hashsalt': 'abs_hil', 'svg.fonttype': 'none', 'font.size': 9})
    colours = dict(zip(names, ('#b35900', '#0550ae', '#116329')))
    figure, axes = pyplot.subplots(2, 3, figsize=(11, 6), layout='constrained')
    panels = {('relay', 0): axes[0, 0], ('relay', 1): axes[1, 0], ('run-up', 0): axes[0, 1],
              **{(duty, 0): axis for duty, axis in zip(STEPS, (axes[0, 2], axes[1, 1], axes[1, 2]))}}
    words = {'relay': ('upper wheel / (1/min)', 'slip'), 'run-up': ('upper wheel / (1/min)',)}
    for name in names:
        found = compared(abs_hil.Plant(name))
        for (trace, curve), axis in panels.items():
            one = found[trace]
            # Both wheels share a panel: the lower one is the upper curve.
            for time_s, measured, simulated in (one.curves if trace in STEPS else one.curves[curve:curve + 1]):
                if name == names[0]:
                    axis.plot(time_s, measured, '.', color='#8c959f', markersize=3)
                axis.plot(time_s, simulated, color=colours[name], linewidth=1)
            axis.set_title(one.title, fontsize=9)
            axis.set_xlabel('time / s')
            axis.set_ylabel(words.get(trace, ('rim speeds / (m/s)',))[curve])
    axes[1, 0].set_ylim(-0.05, 1.05)
    handles = [pyplot.Line2D([], [], color='#8c959f', marker='.', linestyle='', label='measured')]
    handles += [pyplot.Line2D([], [], color=colours[name], label=name) for name in names]
    axes[0, 1].legend(handles=handles, loc='lower right')
    figure.savefig(path, metadata={'Date': None})
    pyplot.close(figure)


def main():
    mode, names = sys.argv[1] if len(sys.argv) > 1 else '', tuple(sys.argv[2:])
    if mode == '--table':
        print(table(names or PLANTS), end='')
    elif mode == '--draw' and len(names) == 1:
        draw(names[0])
    elif mode in ('--check', '--write') and not names:
        return keep(mode, [('plants.md', 'measured', table)])
    else:
        print(__doc__, file=sys.stderr)
        return 2
    return 0


if __name__ == '__main__':
    sys.exit(main())
