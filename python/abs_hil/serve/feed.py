"""From LCM's packets, live or of a log, to the history and the facts of runs."""
import math
import os
import pathlib
import time
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any

import numpy as np

from ..core import _core
from ..messages import MOST_SIGNALS, PHASES, decode, messages_of, type_of
from ..recording import LOG, kind_of, load, named
from .runs import COLUMNS, DERIVED_PLACE, FIELDS, LONGEST_S, MESSAGES, MOST_RUNS, MOST_TEXT, PLACE, WIDTH, History, RunFacts

Packet = tuple[str, bytes]
#: a listener gets the run and its new rows, of shape (cycles, WIDTH)
Listener = Callable[[RunFacts, np.ndarray], None]
#: no message for this time: the bin that grows is shown
IDLE_S = 0.2
MOST_PACKETS = 5000
#: networks may deliver a few messages out of order; a cycle further back belongs to another run
LATE_CYCLES = 16
#: cycles of 60 ms at 10 kHz
MOST_IN_WINDOW = 600
_MODEL = ('r1_m', 'r2_m', 'J2_kg_m2', 'd2_Nms_rad', 'M20_Nm')
BRAKE = PHASES.index('brake')


class Feed:
    """Takes packets, in the order in which they came. `runs` has the newest runs, the current one last."""

    def __init__(self, history: History, prefix: str) -> None:
        self.history = history
        self.runs: dict[int, RunFacts] = {}
        self.listeners: list[Listener] = []
        self.message_listeners: list[Callable[[Any], None]] = []  # each gets every message as it came
        self.damaged = 0
        self._prefix = prefix
        self._rows: list[tuple[float, ...]] = []
        self._phase_names: list[str] = []
        self._names = ''
        self._last_cycle = -1
        self._heard = 0.0
        self._run: RunFacts | None = None
        self._early: dict[str, object] = {}  # the next cycle says whether it belongs to the present run or the next
        self._get = attrgetter(*FIELDS)
        self._later = COLUMNS[len(FIELDS):]

    def take(self, packets: list[Packet]) -> None:
        now = time.monotonic()
        for channel, data in packets:
            if channel.startswith(self._prefix):
                self._one(data)
        self._flush()
        if packets:
            self._heard = now
        elif now > self._heard + IDLE_S:
            self.history.close_bin()

    def _one(self, data: bytes) -> None:
        try:
            message = decode(data)
        except ValueError:
            self.damaged += 1
            return
        for listener in self.message_listeners:
            listener(message)
        kind = type(message).__name__
        if kind == 'telemetry_t':
            self._cycle(message)
            return
        if kind not in MESSAGES:
            return
        self._flush()
        if kind == 'experiment_t' or self._run is None:
            self._early[kind] = message
        else:
            self._run.take(message)

    def _cycle(self, message: Any) -> None:
        cycle, names = message.cycle, message.names
        if not (0.0 <= message.time_s <= LONGEST_S and 0 <= cycle < 1 << 53):
            self.damaged += 1  # nothing of abs_hil sends this
            return
        if 0 < cycle <= self._last_cycle < cycle + LATE_CYCLES:
            return  # out of order, or twice
        run = self._run if self._run is not None and cycle > self._last_cycle else self._begin()
        if names != self._names:
            self._flush()
            self._names = names
            run.own = tuple(filter(_core.is_signal_name, dict.fromkeys(names.split(','))))[:MOST_SIGNALS]
        for early in self._early.values():
            run.take(early)
        self._early.clear()
        self._last_cycle = cycle
        values = dict(zip(names.split(','), message.values))
        tail = [values.get(name, math.nan) for name in (*self._later, *run.own)]
        self._rows.append((*self._get(message), *tail, *([math.nan] * (WIDTH - len(COLUMNS) - len(run.own)))))
        self._phase_names.append(message.phase_name[:MOST_TEXT])

    def _begin(self) -> RunFacts:
        self._flush()
        number = self._run.number + 1 if self._run is not None else 0
        self._run = RunFacts(number, time.time())
        self._names = ''
        self.runs[number] = self._run
        while len(self.runs) > MOST_RUNS:
            del self.runs[next(iter(self.runs))]
        return self._run

    def _flush(self) -> None:
        if not self._rows or self._run is None:
            return
        rows = np.array(self._rows, dtype=np.float64)
        names, self._phase_names = self._phase_names, []
        self._rows.clear()
        self._add_force(self._run, rows)
        self._run.take_rows(rows, names)
        self.history.add(self._run.number, rows)
        for listener in list(self.listeners):
            listener(self._run, rows)

    def _add_force(self, run: RunFacts, rows: np.ndarray) -> None:
        """A point for each bin of these rows: that of the window that ends with the bin's last row."""
        if (rows[:, PLACE['phase']] != BRAKE).all():
            return
        cycles = self.history.cycles
        before = cycles.places(cycles.head - MOST_IN_WINDOW, cycles.head)
        known = np.concatenate((cycles.values[before[cycles.run[before] == run.number]], rows))
        time_s = known[:, PLACE['time_s']]
        ends = np.flatnonzero(np.diff(self.history.bin_numbers(time_s), append=-1))
        for last in ends[ends >= len(known) - len(rows)].tolist():
            first = int(np.searchsorted(time_s, time_s[last] - 2 * _core.FRICTION_HALF_WINDOW_S))
            if (found := force_point(known[first:last + 1], run.config)) is not None:
                rows[last - len(known), DERIVED_PLACE:] = found


def force_point(rows: np.ndarray, config: dict[str, Any]) -> tuple[float, float] | None:
    """(slip, force in N) from the cycles of one window, by the program's own friction curve (analysis/friction_curve.hpp); None
    where it cannot be known.

    config: the run's effective configuration. The model's parameters count, on the real rig the only ones.
    """
    model = {**config.get('plant', {}), **config.get('model', {})}
    samples = rows[:, [PLACE[name] for name in ('sample_time_s', 'upper_counts', 'lower_counts')]]
    if (rows[:, PLACE['phase']] != BRAKE).any() or not np.isfinite(samples).all():
        return None
    try:
        return _core.friction_point(samples, [float(model[name]) for name in _MODEL], int(model['encoder_counts_per_rev']))
    except (KeyError, TypeError, ValueError):
        return None


class Played:
    """Packets of a recording, at the pace at which they were recorded, times `speed`; 0: at once. Raises ValueError for what
    is no recording, and for one of several rigs at once of which none is named."""

    def __init__(self, name: str, speed: float, prefix: str = '') -> None:
        self._events = recorded_packets(name, prefix)
        self._next = next(self._events, None)
        if self._next is None:
            raise ValueError(f'"{name}" holds no message of abs_hil; `abs_hil log info {name}` lists what it holds')
        self._speed = speed
        self._first_us = self._next[0]
        self._began = time.monotonic()

    def waiting(self) -> list[Packet]:
        found: list[Packet] = []
        until_us = self._first_us + (time.monotonic() - self._began) * self._speed * 1e6
        while self._next is not None and len(found) < MOST_PACKETS and (self._speed == 0 or self._next[0] <= until_us):
            found.append(self._next[1:])
            self._next = next(self._events, None)
        return found


def recorded_packets(name: str, prefix: str = '') -> Iterator[tuple[int, str, bytes]]:
    """(time in us, channel, data) of our messages of this prefix in an event log, up to the first place that is damaged; of
    another recording those that its rows and events make."""
    place, number = named(name)
    place = place / 'run.lcmlog' if (place / 'run.lcmlog').is_file() else place
    if kind_of(place) != LOG:
        yield from messages_of(load(name))
        return
    runs = {run: channel for run, *_, channel, _ in _events(place) if channel.endswith('TELEMETRY')}
    if number or len({channel for channel in runs.values() if channel.startswith(prefix)}) > 1:
        number = _core.chosen_run(os.fsencode(name), max(runs, default=-1) + 1) + 1
    for run, _, _, time_us, channel, data in _events(place):
        if number in (0, run + 1) and channel.startswith(prefix) and type_of(data):
            yield time_us, channel, data


def _events(place: pathlib.Path) -> Iterator[Any]:
    """Those of a log up to the first place that is damaged. Raises ValueError if there is none before."""
    event = None
    try:
        for event in _core.LogEvents(os.fsencode(place)):
            yield event
    except ValueError:
        if event is None:
            raise
