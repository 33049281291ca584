"""Recorded runs: their rows with everything that stands beside them and what is missing, converted for other tools."""
import dataclasses
import datetime
import json
import pathlib
from collections.abc import Callable
from typing import Any

import numpy as np

from ..core import _core
from ..messages import PHASES, QUANTITIES, REASONS
from ..nesting import parse_json
from ..report.files import read_events
from ..rows import check_times
from ..run import COLUMNS, Run, load
from .messages import McapFile

CYCLE_TOPIC, SIGNALS_TOPIC, EVENT_TOPIC = '/abs_hil/cycle', '/abs_hil/signals', '/abs_hil/event'
CYCLE_TYPE, SIGNALS_TYPE = 'abs_hil/msg/Cycle', 'abs_hil/msg/Signals'
#: kinds of events and their levels in a log
LEVELS = {'phase': 20, 'command': 20, 'limit': 30, 'fault': 40}
MEDIA_TYPES = {'.json': 'application/json', '.toml': 'application/toml', '.csv': 'text/csv'}
#: ROS 2's stamps hold no later time
LAST_NS = (2 ** 31 - 1) * 10 ** 9
#: a run's messages count from 0, and none makes more
LAST_NUMBER = 10 ** 13
#: files of a run folder that go with its rows
ATTACHED = ('config.toml', 'experiment.toml', 'summary.json', 'environment.json', 'events.csv')


@dataclasses.dataclass
class Event:
    time_s: float
    kind: str
    text: str


@dataclasses.dataclass
class Source:
    """A run to convert.

    start_ns:    Unix time of its first cycle; 0 if unknown.
    events:      in the order of time.
    attachments: name -> bytes.
    losses:      what the recording lacks, as sentences with numbers; empty: nothing.
    """

    run: Run
    start_ns: int
    events: list[Event]
    attachments: dict[str, bytes]
    losses: list[str]

    @property
    def times_ns(self) -> np.ndarray:
        return self.start_ns + np.rint(self.run['time_s'] * 1e9).astype(np.int64)

    def numbers(self) -> dict[str, np.ndarray]:
        """The columns of the CSV as float64; a phase is its number in abs_hil.PHASES, its own name that in `phase_names`."""
        kept = {name: self.run.columns[name] for name in (*COLUMNS, 'phase_name') if name in self.run.columns}
        for column, names in (('phase', PHASES), ('phase_name', self.phase_names)):
            place = {name: float(number) for number, name in enumerate(names)}
            if column in kept:
                kept[column] = np.array([place.get(name, np.nan) for name in kept[column]])
        return kept

    @property
    def phase_names(self) -> list[str]:
        return list(dict.fromkeys(self.run.columns.get('phase_name', ())))

    def metadata(self) -> dict[str, str]:
        names = ('controller', 'plant', 'experiment', 'backend', 'result', 'reason')
        facts = {name: str(self.run.summary[name]) for name in names if self.run.summary.get(name) is not None}
        return {'source': self.run.name, 'rows': str(len(self.run)), 'losses': '; '.join(self.losses) or 'none',
                'phases': ','.join(PHASES), 'phase_names': ','.join(self.phase_names), **facts}


def comment(name: str) -> str:
    """Unit and meaning of a quantity."""
    row = QUANTITIES.get(name)
    if row is None:
        return 'the experiment\'s own name of the phase' if name == 'phase_name' else 'signal of the controller\'s own'
    return f'[{row["unit"]}] {row["meaning"]}' if row['unit'] else str(row['meaning'])


def read(path: str) -> Source:
    """Reads a run folder, an event log or a CSV. Raises ValueError, which names the file, for anything else."""
    place = pathlib.Path(path)
    run = load(place)
    missing = [name for name in COLUMNS if name not in run.columns]
    if missing:
        raise ValueError(f'"{path}" has no column {missing[0]}: an older version wrote it. Convert its event log')
    source = Source(run, 0, [], {}, _missing_rows(run))
    source.losses.extend(note for note in run.notes
                         if not note.startswith(('an event log has no', 'no run.csv', 'no summary.json')))
    if place.is_dir():
        _read_folder(place, source)
    log = place / 'run.lcmlog' if place.is_dir() else place
    if log.suffix == '.lcmlog' and (not place.is_dir() or not (place / 'run.csv').exists()):
        _read_log_facts(log, source)
    if run.summary.get('config') and 'config.toml' not in source.attachments:
        source.attachments['config.json'] = json.dumps(run.summary['config'], indent=2).encode()
    for figure in ('telemetry_drops', 'csv_rows_lost'):
        if run.summary.get(figure):
            source.losses.append(f'the run itself counted {figure} = {run.summary[figure]}')
    latest_s = max([float(run['time_s'][-1]), *(event.time_s for event in source.events)])
    if not 0 <= source.start_ns <= LAST_NS - latest_s * 1e9:
        source.losses.append(f'no stamp holds its start, Unix time {source.start_ns // 10 ** 9} s: the times begin at 1970-01-01')
        source.start_ns = 0
    return source


def _missing_rows(run: Run) -> list[str]:
    """Rows that the times say are missing. A decimated recording has longer steps throughout."""
    steps = np.diff(run['time_s'])
    if len(steps) == 0:
        return []
    step = float(np.median(steps))
    missing = int(np.sum(np.maximum(np.rint(steps / step) - 1, 0))) if step > 0 else 0
    return [f'gaps in time for {missing} rows at steps of {step * 1e3:g} ms (late cycles, or lost rows)'] if missing else []


def _read_folder(folder: pathlib.Path, source: Source) -> None:
    for name in ATTACHED:
        if (folder / name).is_file():
            source.attachments[name] = (folder / name).read_bytes()
    try:
        ended = parse_json(source.attachments.get('environment.json', b'{}')).get('date_utc')
        if ended:
            end = datetime.datetime.strptime(ended, '%Y-%m-%dT%H:%M:%SZ').replace(tzinfo=datetime.UTC)
            source.start_ns = int(end.timestamp()) * 1_000_000_000 - round(float(source.run['time_s'][-1]) * 1e9)
    except (ValueError, AttributeError):
        source.losses.append('environment.json cannot be read: the times begin at 1970-01-01')
    if 'events.csv' in source.attachments:
        events = [Event(one.time_s, one.event, f'{one.name or one.phase}: {one.reason}')
                  for one in read_events(folder / 'events.csv')]
        _add_events(source, events, lambda number: f'{folder / "events.csv"}:{number + 2}')


def _add_events(source: Source, events: list[Event], place: Callable[[int], str]) -> None:
    check_times(np.array([event.time_s for event in events]), place, rising=False)
    source.events.extend(events)


def _read_log_facts(path: pathlib.Path, source: Source) -> None:
    facts: dict[str, Any] = _core.read_log_facts(str(path))
    for name in ('cycles', 'sequences', 'event_sequences'):
        for number in facts[name][~((facts[name] >= 0) & (facts[name] <= LAST_NUMBER))][:1].tolist():
            raise ValueError(f'{path}: a message has the impossible number {number} among its {name}')
    source.start_ns = max(facts['start_us'], 0) * 1000
    if lost := _gaps(facts['sequences'], 1):
        source.losses.append(f'{lost} messages of telemetry are missing in the log')
    if events_lost := _gaps(facts['event_sequences'], 1):
        source.losses.append(f'{events_lost} events are missing in the log')
    cycles = np.diff(facts['cycles'])
    if len(cycles):
        every = int(np.median(cycles))
        dropped = _gaps(facts['cycles'], every) - lost
        if dropped > 0:
            source.losses.append(f'{dropped} cycles have no message, although every {every} of them should have one')
    events = [Event(time_s, kind.decode(errors='replace'),
                    message.decode(errors='replace') or str(REASONS.get(reason, {}).get('text', reason)))
              for time_s, kind, reason, message in facts['events']]
    _add_events(source, events, lambda number: f'{path}: event {number + 1}')


def _gaps(numbers: np.ndarray, step: int) -> int:
    """How many numbers are missing in a sequence that should rise by `step`."""
    steps = np.diff(numbers) // max(step, 1)
    return int(np.sum(np.maximum(steps - 1, 0)))


def to_mcap(source: Source, name: str) -> None:
    """Writes the file. Raises ImportError without the package mcap."""
    with open(name, 'wb') as file:
        mcap = McapFile(file, library='abs_hil')
        times_ns, columns, signals = source.times_ns, source.numbers(), source.run.signals
        for topic, type_name, names in ((CYCLE_TOPIC, CYCLE_TYPE, tuple(columns)), (SIGNALS_TOPIC, SIGNALS_TYPE, signals)):
            if names:
                mcap.add_struct(topic, type_name, [(field, comment(field)) for field in names])
        for event in source.events:
            mcap.log(EVENT_TOPIC, source.start_ns + round(event.time_s * 1e9), LEVELS.get(event.kind, 20), event.kind,
                     event.text)
        mcap.write_rows(CYCLE_TOPIC, times_ns, list(columns.values()))
        if signals:
            values = [source.run.columns[field] for field in signals]
            known = ~np.all(np.isnan(np.column_stack(values)), axis=1)
            mcap.write_rows(SIGNALS_TOPIC, times_ns[known], [column[known] for column in values])
        for attached, data in source.attachments.items():
            mcap.attach(attached, MEDIA_TYPES[pathlib.Path(attached).suffix], data, source.start_ns)
        mcap.describe('abs_hil', source.metadata())
        mcap.finish()


def to_parquet(source: Source, name: str) -> None:
    """Writes the columns of the CSV, with texts as texts; the attachments are in the schema's metadata. Raises ImportError
    without the package pyarrow."""
    import pyarrow
    import pyarrow.parquet
    table = pyarrow.table({column: pyarrow.array(values.tolist() if values.dtype == object else values)
                           for column, values in source.run.columns.items()})
    metadata = {f'abs_hil.{key}': value.encode() for key, value in source.metadata().items()}
    metadata.update((f'abs_hil.{key}', data) for key, data in source.attachments.items())
    metadata['abs_hil.units'] = json.dumps({column: comment(column) for column in table.column_names}).encode()
    pyarrow.parquet.write_table(table.replace_schema_metadata(metadata), name, compression='zstd')
