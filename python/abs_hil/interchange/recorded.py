"""Recorded runs: their rows with everything that stands beside them and what is missing, converted for other tools."""
import datetime
import json
import pathlib

import numpy as np

from ..messages import PHASES, QUANTITIES
from ..nesting import parse_json
from ..recording import load, read_events
from ..rows import check_times
from ..run import COLUMNS, Run, csv_bytes
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


def comment(name: str) -> str:
    """Unit and meaning of a quantity."""
    row = QUANTITIES.get(name)
    if row is None:
        return 'the experiment\'s own name of the phase' if name == 'phase_name' else 'signal of the controller\'s own'
    return f'[{row["unit"]}] {row["meaning"]}' if row['unit'] else str(row['meaning'])


def read(path: str) -> Run:
    """What abs_hil.load reads, with all that goes with it into another file, and every loss. Raises ValueError as that."""
    run = load(path)
    if missing := [name for name in COLUMNS if name not in run.columns]:
        raise ValueError(f'"{path}" has no column {missing[0]}: an older version wrote it. Convert its event log')
    run.losses = list(dict.fromkeys([*missing_rows(run), *run.losses]))
    run.losses += [note for note in run.notes if not note.startswith(('no run.csv', 'no summary.json'))]
    if pathlib.Path(path).is_dir():
        _read_folder(pathlib.Path(path), run)
    if run.events and 'events.csv' not in run.attachments:
        fields = {'time_s': float, **dict.fromkeys(('event', 'phase', 'reason', 'value', 'name'), object)}
        run.attachments['events.csv'] = csv_bytes({one: np.array([getattr(event, one) for event in run.events], dtype=kind)
                                                   for one, kind in fields.items()})
    if run.summary.get('config') and not {'config.toml', 'config.json'} & {*run.attachments}:
        run.attachments['config.json'] = json.dumps(run.summary['config'], indent=2).encode()
    for figure in ('telemetry_drops', 'csv_rows_lost'):
        if run.summary.get(figure):
            run.losses.append(f'the run itself counted {figure} = {run.summary[figure]}')
    latest_s = max([float(run['time_s'][-1]), *(event.time_s for event in run.events)])
    if not 0 <= run.start_ns <= LAST_NS - latest_s * 1e9:
        run.losses.append(f'no stamp holds its start, Unix time {run.start_ns // 10 ** 9} s: the times begin at 1970-01-01')
        run.start_ns = 0
    return run


def missing_rows(run: Run) -> list[str]:
    """Rows that the times say are missing. A decimated recording has longer steps throughout."""
    steps = np.diff(run['time_s'])
    if len(steps) == 0:
        return []
    step = float(np.median(steps))
    missing = int(np.sum(np.maximum(np.rint(steps / step) - 1, 0))) if step > 0 else 0
    return [f'gaps in time for {missing} rows at steps of {step * 1e3:g} ms (late cycles, or lost rows)'] if missing else []


def _read_folder(folder: pathlib.Path, run: Run) -> None:
    for name in ATTACHED:
        if (folder / name).is_file():
            run.attachments[name] = (folder / name).read_bytes()
    try:
        ended = parse_json(run.attachments.get('environment.json', b'{}')).get('date_utc')
        if ended:
            end = datetime.datetime.strptime(ended, '%Y-%m-%dT%H:%M:%SZ').replace(tzinfo=datetime.UTC)
            run.start_ns = int(end.timestamp()) * 1_000_000_000 - round(float(run['time_s'][-1]) * 1e9)
    except (ValueError, AttributeError):
        run.losses.append('environment.json cannot be read: the times begin at 1970-01-01')
    if 'events.csv' in run.attachments:
        run.events = read_events(run.attachments['events.csv'], folder / 'events.csv')
        check_times(np.array([event.time_s for event in run.events]), lambda row: f'{folder / "events.csv"}:{row + 2}', False)


def _metadata(run: Run) -> dict[str, str]:
    names = ('controller', 'plant', 'experiment', 'backend', 'result', 'reason')
    facts = {name: str(run.summary[name]) for name in names if run.summary.get(name) is not None}
    return {'source': run.name, 'rows': str(len(run)), 'losses': '; '.join(run.losses) or 'none', 'phases': ','.join(PHASES),
            'phase_names': ','.join(dict.fromkeys(run.columns.get('phase_name', ()))), **facts}


def to_mcap(run: Run, name: str) -> None:
    """Writes the file. A phase is its number in the metadata's lists. Raises ImportError without the package mcap."""
    metadata = _metadata(run)
    columns = {column: run.columns[column] for column in (*COLUMNS, 'phase_name') if column in run.columns}
    for column, names in (('phase', 'phases'), ('phase_name', 'phase_names')):
        place = {one: float(number) for number, one in enumerate(metadata[names].split(','))}
        if column in columns:
            columns[column] = np.array([place.get(one, np.nan) for one in columns[column]])
    with open(name, 'wb') as file:
        mcap = McapFile(file, library='abs_hil')
        times_ns = run.start_ns + np.rint(run['time_s'] * 1e9).astype(np.int64)
        for topic, type_name, fields in ((CYCLE_TOPIC, CYCLE_TYPE, tuple(columns)), (SIGNALS_TOPIC, SIGNALS_TYPE, run.signals)):
            if fields:
                mcap.add_struct(topic, type_name, [(field, comment(field)) for field in fields])
        for event in run.events:
            mcap.log(EVENT_TOPIC, run.start_ns + round(event.time_s * 1e9), LEVELS.get(event.event, 20), event.event, event.text)
        mcap.write_rows(CYCLE_TOPIC, times_ns, list(columns.values()))
        if run.signals:
            values = [run.columns[field] for field in run.signals]
            known = ~np.all(np.isnan(np.column_stack(values)), axis=1)
            mcap.write_rows(SIGNALS_TOPIC, times_ns[known], [column[known] for column in values])
        for attached, data in run.attachments.items():
            mcap.attach(attached, MEDIA_TYPES[pathlib.Path(attached).suffix], data, run.start_ns)
        mcap.describe('abs_hil', metadata)
        mcap.finish()


def to_parquet(run: Run, name: str) -> None:
    """Writes the columns of the CSV, with texts as texts; the attachments are in the schema's metadata. Raises ImportError
    without the package pyarrow."""
    import pyarrow
    import pyarrow.parquet
    table = pyarrow.table({column: pyarrow.array(values.tolist() if values.dtype == object else values)
                           for column, values in run.columns.items()})
    metadata = {f'abs_hil.{key}': value.encode() for key, value in _metadata(run).items()}
    metadata.update((f'abs_hil.{key}', data) for key, data in run.attachments.items())
    metadata['abs_hil.units'] = json.dumps({column: comment(column) for column in table.column_names}).encode()
    pyarrow.parquet.write_table(table.replace_schema_metadata(metadata), name, compression='zstd')
