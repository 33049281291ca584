"""What a viewer is told of a run beside its curves: names, phases, verdicts, events, timing. Every list has a bound."""
import dataclasses
from typing import Any

import numpy as np

from ..messages import PHASES, REASONS
from ..nesting import parse_json
from .history import PLACE

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
