"""What the scope remembers, in bounded memory: the newest cycles whole, of a longer time the least and the greatest value of
every signal in each fiftieth of a second, and of a run its names, phases, verdicts, events, timing."""
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..files import parse_json
from ..messages import MOST_SIGNALS, PHASES, QUANTITIES, REASONS, TYPES

#: length of a bin: 50 a second
BIN_S = 0.02
#: what the server itself computes (feed.py)
DERIVED = ('tyre_slip', 'tyre_force_N')
#: quantities that are fields of telemetry_t
FIELDS = tuple(name for name in QUANTITIES if name in TYPES['telemetry_t'].__slots__)
#: columns of the quantities, FIELDS first; then come the places of a controller's own signals, then DERIVED
COLUMNS = tuple(dict.fromkeys((*FIELDS, *QUANTITIES)))
PLACE = {name: place for place, name in enumerate(COLUMNS)}
WIDTH = len(COLUMNS) + MOST_SIGNALS + len(DERIVED)
DERIVED_PLACE = WIDTH - len(DERIVED)
#: 10 minutes of bins; 2 minutes of cycles at 1 kHz
BINS, ROWS = 30_000, 120_000
MOST_MARKS, MOST_EVENTS, MOST_RUNS = 200, 200, 20
#: no run is longer
LONGEST_S = 1e6
#: characters of a text from the network
MOST_TEXT = 300
#: what RunFacts takes beside the cycles
MESSAGES = ('event_t', 'experiment_t', 'status_t', 'command_state_t')
#: bounds of the histograms' classes: ten a decade from 1 us to 100 ms; below and above are classes too
EDGES_NS = 1e3 * 10.0 ** (np.arange(51) / 10.0)
TIMED = ('wakeup_latency_ns', 'cycle_ns')


class Ring:
    """The newest `size` rows of a table. Rows are numbered from the first ever added."""

    def __init__(self, size: int, *shape: int) -> None:
        self.size = size
        self.head = 0  # number of the next row
        # Filled at once: the memory does not grow later.
        self.run = np.full(size, -1, dtype=np.int32)
        self.values = np.full((size, *shape), np.nan)

    @property
    def tail(self) -> int:
        return max(0, self.head - self.size)

    def add(self, run: int, values: np.ndarray) -> None:
        values = values[-self.size:]
        places = np.arange(self.head, self.head + len(values)) % self.size
        self.values[places] = values
        self.run[places] = run
        self.head += len(values)

    def places(self, first: int, end: int) -> np.ndarray:
        return np.arange(max(first, self.tail), min(end, self.head)) % self.size


class History:
    """cycles: rows of WIDTH values. bins: rows of (least, greatest, number of the bin since the run's start) by WIDTH; the
    third has one value."""

    def __init__(self, bins: int = BINS, rows: int = ROWS) -> None:
        self.cycles = Ring(rows, WIDTH)
        self.bins = Ring(bins, 2, WIDTH)
        self.numbers = np.zeros(bins, dtype=np.int32)
        self._run = -1
        self._open: tuple[int, np.ndarray] | None = None  # the bin that still grows

    def add(self, run: int, rows: np.ndarray) -> None:
        """Adds the rows of consecutive cycles, of shape (cycles, WIDTH)."""
        if run != self._run:
            self.close_bin()
            self._run = run
        self.cycles.add(run, rows)
        numbers = self.bin_numbers(rows[:, PLACE['time_s']])
        starts = np.concatenate(([0], np.flatnonzero(np.diff(numbers)) + 1))
        lows, highs = np.fmin.reduceat(rows, starts, axis=0), np.fmax.reduceat(rows, starts, axis=0)
        for start, low, high in zip(starts.tolist(), lows, highs):
            number = int(numbers[start])
            if self._open is not None and self._open[0] == number:
                envelope = self._open[1]
                np.fmin(envelope[0], low, out=envelope[0])
                np.fmax(envelope[1], high, out=envelope[1])
                continue
            self.close_bin()
            self._open = (number, np.stack((low, high)))

    def close_bin(self) -> None:
        """Ends the bin that grows: the next one has begun, or no message came for a while."""
        if self._open is None:
            return
        number, envelope = self._open
        self._open = None
        self.numbers[self.bins.head % self.bins.size] = number
        self.bins.add(self._run, envelope[np.newaxis])

    def rows_of(self, run: int, from_s: float, to_s: float, most: int) -> np.ndarray:
        """The cycles of a run within a time, the oldest `most` of them."""
        cycles = self.cycles
        times = cycles.values[:, PLACE['time_s']]
        kept = np.flatnonzero((cycles.run == run) & (times >= from_s) & (times <= to_s))
        kept = kept[np.argsort(cycles.values[kept, PLACE['cycle']], kind='stable')][:most]
        return cycles.values[kept]

    @staticmethod
    def bin_numbers(time_s: np.ndarray) -> np.ndarray:
        return np.floor(time_s / BIN_S + 1e-6).astype(np.int64)


def own_place(names: Sequence[str], name: str) -> int | None:
    """Column of a signal in a run whose controller's own signals are `names`; None if the run lacks it."""
    if name in PLACE:
        return PLACE[name]
    if name in DERIVED:
        return DERIVED_PLACE + DERIVED.index(name)
    return len(COLUMNS) + list(names).index(name) if name in names else None


@dataclasses.dataclass
class RunFacts:
    """One run. `version` grows with every change that viewers should learn of."""
    number: int
    began: float  # Unix time
    own: tuple[str, ...] = ()
    version: int = 0
    names: dict[str, str] = dataclasses.field(default_factory=dict)
    config: dict[str, Any] = dataclasses.field(default_factory=dict)
    marks: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    verdicts: dict[int, dict[str, Any]] = dataclasses.field(default_factory=dict)
    events: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    status: dict[str, Any] = dataclasses.field(default_factory=dict)
    commands: dict[str, Any] = dataclasses.field(default_factory=dict)
    counts: dict[str, np.ndarray] = dataclasses.field(
        default_factory=lambda: {name: np.zeros(len(EDGES_NS) + 1, dtype=np.int64) for name in TIMED})
    cycles: int = 0
    lost: int = 0
    last_s: float = 0.0
    last_phase: tuple[int, int, str] = (-1, -1, '')
    _sequence: int = -1

    def take_rows(self, rows: np.ndarray, phase_names: list[str]) -> None:
        self.version += 1
        self.cycles += len(rows)
        self.last_s = float(rows[-1, PLACE['time_s']])
        sequence = rows[:, PLACE['sequence']]
        steps = np.diff(sequence, prepend=self._sequence if self._sequence >= 0 else sequence[0] - 1) - 1
        self.lost += int(np.maximum(steps, 0).sum())
        self._sequence = int(sequence[-1])
        for name in TIMED:
            self.counts[name] += np.bincount(np.searchsorted(EDGES_NS, rows[:, PLACE[name]]), minlength=len(EDGES_NS) + 1)
        phases, places = rows[:, PLACE['phase']], rows[:, PLACE['phase_index']]
        changed = (np.diff(phases, prepend=-1.0) != 0) | (np.diff(places, prepend=-1.0) != 0) | (rows[:, PLACE['reason']] != 0)
        changed[0] = True
        for place in np.flatnonzero(changed).tolist():
            self._look(rows[place], phase_names[place])

    def _look(self, row: np.ndarray, phase_name: str) -> None:
        phase = (int(row[PLACE['phase']]), int(row[PLACE['phase_index']]), phase_name)
        time_s, reason = float(row[PLACE['time_s']]), int(row[PLACE['reason']])
        if phase != self.last_phase:
            kind = PHASES[phase[0]] if 0 <= phase[0] < len(PHASES) else str(phase[0])
            self.marks.append({'time_s': time_s, 'phase': kind, 'name': phase_name or kind,
                               'cycle': int(row[PLACE['cycle']]), 'reason': REASONS.get(reason, {}).get('text', '')})
            del self.marks[:-MOST_MARKS]
            self.last_phase = phase
        known = REASONS.get(reason)
        if reason and known is not None and known['kind'] in ('fault', 'refusal'):
            verdict = self.verdicts.setdefault(reason, {
                **{key: known[key] for key in ('kind', 'text', 'quantity', 'unit', 'bound')}, 'count': 0, 'first_s': time_s})
            verdict.update(count=verdict['count'] + 1, last_s=time_s, value=number(float(row[PLACE['reason_value']])))

    def take(self, message: Any) -> None:
        """One of MESSAGES."""
        self.version += 1
        kind = type(message).__name__
        if kind == 'event_t':
            self._take_event(message)
        elif kind == 'experiment_t':
            self._take_experiment(message)
        elif kind == 'status_t':
            self.status = {name: number(getattr(message, name)) for name in message.__slots__}
        else:
            self.commands = {'enabled': bool(message.enabled), 'waiting': bool(message.waiting)}

    def _take_event(self, event: Any) -> None:
        known = REASONS.get(event.reason, {})
        self.events.append({'time_s': event.time_s if 0 <= event.time_s <= LONGEST_S else 0.0, 'kind': event.kind[:MOST_TEXT],
                            'text': (event.message or event.reason_text)[:MOST_TEXT],
                            'reason': event.reason_text[:MOST_TEXT], 'value': number(event.value),
                            **{key: known.get(key, '') for key in ('quantity', 'unit', 'bound')}})
        del self.events[:-MOST_EVENTS]

    def _take_experiment(self, message: Any) -> None:
        self.names = {name: str(getattr(message, name))[:MOST_TEXT]
                      for name in ('experiment', 'controller', 'plant', 'backend', 'version')}
        try:
            config = parse_json(message.config_json)
        except ValueError:
            return
        # Of the configuration, feed.py wants these two.
        self.config = {part: config[part] for part in ('plant', 'model')
                       if isinstance(config, dict) and isinstance(config.get(part), dict)}

    def told(self) -> dict[str, Any]:
        """What a viewer gets, ready for JSON."""
        return {'kind': 'run', 'run': self.number, 'began': self.began, 'own': self.own, 'names': self.names,
                'marks': self.marks, 'verdicts': list(self.verdicts.values()), 'events': self.events, 'status': self.status,
                'commands': self.commands, 'cycles': self.cycles, 'lost': self.lost, 'last_s': self.last_s,
                'counts': {name: counts.tolist() for name, counts in self.counts.items()}}


def number(value: Any) -> Any:
    """A number as JSON has it: None for what is none."""
    return value if not isinstance(value, float) or np.isfinite(value) else None
