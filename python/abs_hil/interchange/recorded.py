"""Recorded runs: their rows with everything that stands beside them and what is missing, converted for other tools."""
import dataclasses
import datetime
import json
import pathlib

import numpy as np

from ..messages import PHASES, QUANTITIES
from ..nesting import parse_json
from ..recording import load, read_events
from ..rows import check_times
from ..run import COLUMNS, Event, Run, csv_bytes
from .mcap_file import CYCLE_TOPIC, EVENT_TOPIC, SIGNALS_TOPIC
from .messages import McapFile

CYCLE_TYPE, SIGNALS_TYPE = 'abs_hil/msg/Cycle', 'abs_hil/msg/Signals'
#: kinds of events and their levels in a log
LEVELS = {'phase': 20, 'command': 20, 'limit': 30, 'fault': 40}
MEDIA_TYPES = {'.json': 'application/json', '.toml': 'application/toml', '.csv': 'text/csv'}
#: ROS 2's stamps hold no later time
LAST_NS = (2 ** 31 - 1) * 10 ** 9
#: files of a run folder that go with its rows
ATTACHED = ('config.toml', 'experiment.toml', 'summary.json', 'environment.json', 'events.csv')


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
    """Reads what abs_hil.load does. Raises ValueError, which names the file, for anything else."""
    run = load(path)
    missing = [name for name in COLUMNS if name not in run.columns]
    if missing:
        raise ValueError(f'"{path}" has no column {missing[0]}: an older version wrote it. Convert its event log')
    source = Source(run, run.start_ns, run.events, run.attachments, list(dict.fromkeys([*missing_rows(run), *run.losses])))
    source.losses += [note for note in run.notes if not note.startswith(('no run.csv', 'no summary.json'))]
    if pathlib.Path(path).is_dir():
        _read_folder(pathlib.Path(path), source)
    if run.events and 'events.csv' not in source.attachments:
        fields = {'time_s': float, **dict.fromkeys(('event', 'phase', 'reason', 'value', 'name'), object)}
        source.attachments['events.csv'] = csv_bytes({one: np.array([getattr(event, one) for event in run.events], dtype=kind)
                                                      for one, kind in fields.items()})
    if run.summary.get('config') and not {'config.toml', 'config.json'} & {*source.attachments}:
        source.attachments['config.json'] = json.dumps(run.summary['config'], indent=2).encode()
    for figure in ('telemetry_drops', 'csv_rows_lost'):
        if run.summary.get(figure):
            source.losses.append(f'the run itself counted {figure} = {run.summary[figure]}')
    latest_s = max([float(run['time_s'][-1]), *(event.time_s for event in source.events)])
    if not 0 <= source.start_ns <= LAST_NS - latest_s * 1e9:
        source.losses.append(f'no stamp holds its start, Unix time {source.start_ns // 10 ** 9} s: the times begin at 1970-01-01')
        source.start_ns = 0
    return source


def missing_rows(run: Run) -> list[str]:
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
        source.events = read_events(source.attachments['events.csv'], folder / 'events.csv')
        check_times(np.array([event.time_s for event in source.events]), lambda row: f'{folder / "events.csv"}:{row + 2}', False)


def to_mcap(source: Source, name: str) -> None:
    """Writes the file. Raises ImportError without the package mcap."""
    with open(name, 'wb') as file:
        mcap = McapFile(file, library='abs_hil')
        times_ns, columns, signals = source.times_ns, source.numbers(), source.run.signals
        for topic, type_name, names in ((CYCLE_TOPIC, CYCLE_TYPE, tuple(columns)), (SIGNALS_TOPIC, SIGNALS_TYPE, signals)):
            if names:
                mcap.add_struct(topic, type_name, [(field, comment(field)) for field in names])
        for event in source.events:
            mcap.log(EVENT_TOPIC, source.start_ns + round(event.time_s * 1e9), LEVELS.get(event.event, 20), event.event,
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
