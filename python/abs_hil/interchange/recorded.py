"""abs_convert: runs as files for other tools, with everything that stands beside their rows and what is missing; `abs_hil convert`
starts it."""
import contextlib
import datetime
import errno
import json
import os
import pathlib
import signal
from collections.abc import Sequence
from typing import Any

import numpy as np

from .. import parsers
from ..core import _core
from ..files import parse_json, write_whole
from ..messages import PHASES, QUANTITIES, decode
from ..options import failed
from ..recording import FROM_LOG, LOG, NO_CSV, NO_SUMMARY, kind_of, load, named, read_events, read_log
from ..rows import check_times
from ..run import COLUMNS, Run, csv_bytes
from .messages import CYCLE_TOPIC, EVENT_TOPIC, SIGNALS_TOPIC, McapFile

TARGETS = ('.csv', '.mcap', '.parquet')
#: reasons for which a file cannot be written that are not the command's fault
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
CYCLE_TYPE, SIGNALS_TYPE = 'abs_hil/msg/Cycle', 'abs_hil/msg/Signals'
#: kinds of events and their levels in a log
LEVELS = {'phase': 20, 'command': 20, 'limit': 30, 'fault': 40}
MEDIA_TYPES = {'.json': 'application/json', '.toml': 'application/toml', '.csv': 'text/csv'}
#: ROS 2's stamps hold no later time
LAST_NS = (2 ** 31 - 1) * 10 ** 9
#: rows that are texts at once
_ROWS = 50_000
#: files of a run folder that go with its rows
ATTACHED = ('config.toml', 'experiment.toml', 'summary.json', 'environment.json', 'events.csv')


def comment(name: str) -> str:
    """Unit and meaning of a quantity."""
    if (row := QUANTITIES.get(name)) is None:
        return 'the experiment\'s own name of the phase' if name == 'phase_name' else 'signal of the controller\'s own'
    return f'[{row["unit"]}] {row["meaning"]}' if row['unit'] else str(row['meaning'])


def read(path: str) -> Run:
    """What abs_hil.load reads, with all that goes with it into another file, and every loss. Raises ValueError as that."""
    run = load(path)
    if missing := [name for name in COLUMNS if name not in run.columns]:
        raise ValueError(f'"{path}" has no column {missing[0]}: an older version wrote it. Convert its event log')
    run.losses = list(dict.fromkeys([*missing_rows(run), *run.losses]))
    run.losses += [note for note in run.notes if note not in (NO_CSV, NO_SUMMARY)]
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
    run.attachments.update((name, (folder / name).read_bytes()) for name in ATTACHED if (folder / name).is_file())
    try:
        if ended := parse_json(run.attachments.get('environment.json', b'{}')).get('date_utc'):
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


def to_csv(run: Run, name: str, out: pathlib.Path) -> str:
    """Writes all files, or none, and returns words about what is in them. Of an event log OUT.csv has the columns of --csv, then
    every other quantity; OUT.CHANNEL.csv the fields of each other channel's messages; OUT.raw.csv other
    programs' messages, as hexadecimal digits. The last columns say where in the log a row came from."""
    log, number = named(name)
    log = log / 'run.lcmlog' if (log / 'run.lcmlog').is_file() else log
    if kind_of(log) != LOG:
        _write([(out, run.columns)])
        return ''
    found = read_log(f'{log}#{number}' if number else log, whole=True)
    columns, main = found['columns'], (found['channel'], 'telemetry_t')
    columns.update(zip(FROM_LOG[2:], (np.full(found['rows'], text, dtype=object) for text in main)))
    in_main = {*columns['log_event'].tolist()}
    tables: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for of_run, _, event, time_us, channel, data in _core.LogEvents(os.fsencode(log)):
        if of_run != max(number, 1) - 1 or (channel == main[0] and event in in_main):
            continue
        try:
            message = decode(data)
            key, row = (channel, type(message).__name__), {one: getattr(message, one) for one in message.__slots__}
        except ValueError:
            key, row = ('raw', 'raw'), {'data_hex': data.hex()}
        tables.setdefault(key, []).append({**row, **dict(zip(FROM_LOG, (event, time_us, channel, key[1])))})
    files = {out: columns}
    for (channel, type_), rows in tables.items():
        part = channel.replace('/', '_')
        endings = [part, f'{part}.{type_}', *(f'{part}.{type_}.{n}' for n in range(2, len(tables) + 2))]
        path = next(one for one in (out.with_name(f'{out.stem}.{ending}.csv') for ending in endings) if one not in files)
        files[path] = {one: _column([row[one] for row in rows]) for one in rows[0]}
    _write([*files.items()])
    raw = len(tables.get(('raw', 'raw'), ()))
    return (f', {sum(map(len, tables.values())) + found["rows"]} messages'
            + f', {raw} of them not of abs_hil, as hexadecimal digits' * (raw > 0))


def _column(values: Sequence[Any]) -> np.ndarray:
    if isinstance(values[0], (int, float)):
        return np.array(values, dtype=None if not isinstance(values[0], bool) else np.int64)
    return np.array([one if isinstance(one, str) else ' '.join(map(repr, one)) for one in values], dtype=object)


def _write(files: list[tuple[pathlib.Path, dict[str, np.ndarray]]]) -> None:
    """Writes each before any is in its place. The first one, the main one, gets there last."""
    (path, columns), *others = files

    def write(name: str) -> None:
        with open(name, 'wb') as file:
            for begin in range(0, len(next(iter(columns.values()))), _ROWS):
                file.write(csv_bytes({one: values[begin:begin + _ROWS] for one, values in columns.items()}, begin == 0))
        if others:
            _write(others)
    write_whole(path, write)


def main(arguments: list[str]) -> int:
    given = parsers.convert().parse_args(arguments)
    *inputs, out = [*given.files, *filter(None, [given.out])] or ['']
    output = pathlib.Path(out)
    try:
        if output.suffix not in TARGETS:
            raise ValueError(f'OUT = {out or "nothing"}: give a name that ends in .csv, .mcap or .parquet')
        if len(inputs) != (given.live is None):
            raise ValueError('give one IN, or --live URL in its place')
        if not output.parent.is_dir():
            raise ValueError(f'OUT = {output}: there is no folder {output.parent}; create it first')
        if given.live is None and (given.idle is not None or given.seconds is not None):
            raise ValueError('--idle and --seconds belong to --live')
        if given.live is not None and output.suffix != '.mcap':
            raise ValueError('--live writes .mcap only; convert that run\'s folder or log to .parquet afterwards')
        print(_record(given, output) if given.live is not None else _convert(inputs[0], output))
        return 0
    except (ValueError, OSError) as error:
        full = isinstance(error.__context__, OSError) and error.__context__.errno in FULL
        return failed('abs_convert', error, 1 if full else 3 if isinstance(error, OSError) else 2)


def _convert(path: str, output: pathlib.Path) -> str:
    origin = named(path)[0].resolve()
    if output.resolve() == origin or origin.is_dir() and output.resolve().parent == origin:
        raise ValueError(f'OUT = {output}: this command reads it; give another file')
    run, more = read(path), ''
    if output.suffix == '.csv':
        more = to_csv(run, path, output)
    else:
        write = to_mcap if output.suffix == '.mcap' else to_parquet
        write_whole(output, lambda name: write(run, name))
    return f'{len(run)} rows, {len(run.events)} events{more}; lost: {"; ".join(run.losses) or "nothing"}'


def _record(given: Any, output: pathlib.Path) -> str:
    from . import running
    # A request to end must not cut the file short.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    result = ''

    def record(name: str) -> None:
        nonlocal result
        with open(name, 'wb') as file:
            recorder = running.Recorder(McapFile(file, library='abs_hil'))
            with contextlib.suppress(KeyboardInterrupt):
                for channel, message in running.received(given.live, given.prefix, given.idle, given.seconds):
                    recorder.take(channel, message)
            recorder.finish()
            if recorder.rows == 0:
                raise ValueError(f'no telemetry of abs_hil came on {given.live or "the default network"}; `abs_hil doctor --only '
                                 'lcm` says whether this computer can receive it')
        result = (f'{recorder.rows} rows; lost: {recorder.lost} messages on the way, {recorder.damaged} damaged')

    write_whole(output, record)
    return result
