"""What a run's rows say as a whole: phases, braking, figures of merit, changes of the simulated rig."""
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ..core import _core
from ..merits import PAPER_R2_M, FigureOfMerit, figures, figures_of, number_in, r2_m
from ..rows import TEXTS
from ..run import Run, signals_of
from .files import RunFiles
from .text import significant

#: car speed above which slip and its estimates are judged
JUDGED_M_S = 3.0
#: a run has a handful
MOST_PHASES = 2000
MOST_BRAKINGS = 60
#: a brake that asked for no torque for so long ends a pulse; laws that switch release it for less
RELEASED_S = 0.2
#: a wanted slip that stands, changes by this much in a cycle and stands again begins a pulse; laws that seek theirs drift
SLIP_STEP = 0.01
_PROFILES = ('friction', 'brake_torque', 'motor_torque', 'upper_bearing', 'lower_bearing')


def merits_shown() -> list[FigureOfMerit]:
    """The figures of merit of a report: those of a run's summary."""
    return [figure for figure in figures().values() if figure.in_summary]


@dataclass
class Phase:
    phase: str
    from_s: float
    to_s: float
    name: str = ''  # the experiment's own name of the phase; empty if it has none but the kind's

    @property
    def shown(self) -> str:
        return self.name or self.phase


@dataclass
class Change:
    """A change of the simulated rig during the run."""
    time_s: float
    label: str


@dataclass
class Survey:
    rows: int
    from_s: float
    to_s: float
    phases: list[Phase] = field(default_factory=list)
    brake_from_s: float = math.nan
    brake_to_s: float = math.nan
    changes: list[Change] = field(default_factory=list)
    truncated: bool = False
    known: set[str] = field(default_factory=set)
    signals: list[str] = field(default_factory=list)
    metrics: dict[str, float] = field(default_factory=dict)
    # (phase and pulse, figures) of each, if there are several
    brakings: list[tuple[str, dict[str, float]]] = field(default_factory=list)
    r2_m: float = PAPER_R2_M

    @property
    def brakes(self) -> bool:
        return not math.isnan(self.brake_from_s)


def survey(run: RunFiles, rows: Run) -> Survey:
    time, braking = rows.columns['time_s'], rows.columns['phase'] == 'brake'
    found = Survey(len(time), float(time[0]), float(time[-1]), truncated=rows.truncated, r2_m=r2_m(run.config))
    kinds = rows.columns['phase']
    names = rows.columns.get('phase_name', kinds)
    starts = np.flatnonzero(np.append(True, (kinds[1:] != kinds[:-1]) | (names[1:] != names[:-1])))
    for start, end in zip(starts[:MOST_PHASES], [*starts[1:], len(time) - 1]):
        kind, name = kinds[start], names[start]
        found.phases.append(Phase(kind, float(time[start]), float(time[end]), '' if name == kind else name))
    if len(starts) > MOST_PHASES:
        found.phases[-1].to_s = float(time[-1])
    if braking.any():
        places = np.flatnonzero(braking)
        found.brake_from_s = float(time[places[0]])
        found.brake_to_s = float(time[min(places[-1] + 1, len(time) - 1)])
    found.known = {name for name in rows.columns if name in TEXTS or not np.isnan(rows.columns[name]).all()}
    found.signals = [name for name in signals_of(rows.columns) if name in found.known]
    found.metrics = figures_of(rows.columns, run.config)
    brakings = [(int(place), pulse) for start, end in zip(starts.tolist(), [*starts[1:].tolist(), len(time)]) if braking[start]
                for pulse, place in enumerate([start, *_pulses(rows, start, end)], 1)][:MOST_BRAKINGS]
    if len(brakings) > 1:
        ends = [place for place, _ in brakings[1:]] + [len(time)]
        for number, ((first, pulse), last) in enumerate(zip(brakings, ends), 1):
            name = next(phase.shown for phase in reversed(found.phases) if phase.from_s <= time[first])
            found.brakings.append((f'{number}: {name}{f", pulse {pulse}" if pulse > 1 else ""}',
                                   figures_of(rows.columns, run.config, first, last)))
    found.changes = [*_changes(run, rows, found.r2_m)]
    return found


def _pulses(rows: Run, start: int, end: int) -> np.ndarray:
    """The rows within a phase of braking, from `start` to before `end`, at which another pulse begins: the brake acts again
    after a release, or the wanted slip steps to another value."""
    acts = np.flatnonzero(rows.columns['brake_torque_ref_Nm'][start:end] > 0.0)
    again = acts[1:][np.diff(rows.columns['time_s'][start + acts]) > RELEASED_S]
    change = np.abs(np.diff(rows.columns['slip_ref'][start:end]))
    stands = change == 0.0
    steps = np.flatnonzero((change[1:-1] >= SLIP_STEP) & stands[:-2] & stands[2:]) + 2
    return start + np.union1d(again, steps)


def _changes(run: RunFiles, rows: Run, r2_m: float) -> Iterator[Change]:
    """When the parameters of the simulated rig changed according to the configuration; only what the run reached.

    Unknown distances reach nothing. A profile that cannot be read, as of another version, is left out.
    """
    time, braking = rows.columns['time_s'], rows.columns['phase'] == 'brake'
    rolled = None
    for what in _PROFILES:
        key = f'plant.{what}_profile'
        if not run.config.get(key):
            continue
        try:
            axis, from_braking, pieces = _core.profile_of(run.config[key], key)
        except ValueError:
            continue
        if from_braking and not braking.any():
            continue
        first = int(np.argmax(braking)) if from_braking else 0
        if axis == 'distance' and rolled is None:
            speed = r2_m * rows.columns['omega2_rad_s']
            rolled = np.concatenate(([0.0], np.cumsum(0.5 * np.diff(time) * (speed[1:] + speed[:-1]))))
        along = time if axis == 'time' else rolled
        assert along is not None
        origin = along[first] if from_braking else 0.0
        for begin, value, slope in pieces[1:]:
            with np.errstate(invalid='ignore'):
                reached = np.flatnonzero(along[first:] - origin >= begin)
            if not len(reached):
                break
            at = origin + begin if axis == 'time' else time[first + reached[0]]
            yield Change(float(at), what.replace('_', ' ') + (f' × {value:.3g}' if slope == 0.0 else ' drifts'))


def value_of(metric: FigureOfMerit, run: RunFiles, found: Survey) -> float:
    """The summary's value, else the value computed from the rows."""
    said = run.number(metric.name)
    return said if math.isfinite(said) else found.metrics[metric.name]


def contradictions(run: RunFiles, found: Survey) -> list[str]:
    """Notes about what differs between summary and rows: then the files belong to different runs."""
    tolerance = 1e-6  # rounding stays below it; a missing row exceeds it
    why = 'rows are missing, or the files belong to different runs'
    notes, unknown = [], []
    cycles, rows = run.number('cycles'), found.rows + found.truncated
    lost = sum(run.number(name) for name in ('telemetry_drops', 'csv_rows_lost') if run.number(name) > 0)
    every = max(1.0, number_in(run.config, 'telemetry.decimation', 1.0))
    logged = math.ceil(cycles / every) if math.isfinite(cycles) else rows  # the CSV may be made of an event log
    if not cycles - lost <= rows <= cycles and rows != logged:
        notes.append(f'the summary counts {cycles:.0f} cycles but the CSV has {found.rows} rows; {why}')
    for metric in merits_shown():
        said, computed = run.number(metric.name), found.metrics[metric.name]
        if math.isfinite(said) and not math.isfinite(computed):
            unknown.append(metric.name)
        elif abs(said - computed) > tolerance * max(1.0, abs(said)):
            notes.append(f'{metric.name}: the summary says {significant(said, 6)} but the CSV gives '
                         f'{significant(computed, 6)}; {why}')
    return notes + ([f'{", ".join(unknown)}: in the summary, but the CSV does not give them; {why}'] if unknown else [])
