"""Recorded runs: which kind of file holds them, told by its content, and the one reader of each kind.

A file may hold several runs: FILE#2 names the second one.
"""
import contextlib
import gzip
import math
import os
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from .core import _core
from .files import parse_json
from .interchange.messages import EVENT_TOPIC, McapContent, log_of
from .merits import figures, figures_of
from .messages import PHASES, REASONS, decode
from .options import PathLike
from .rows import CONTRACT, TEXTS, check_times, in_order, read_rows, starts_of
from .run import Event, Run, Series, name_phases, read_object, signals_of

FOLDER, LOG, CSV, MCAP, PARQUET = 'run folder', 'LCM event log', 'CSV file', 'MCAP file', 'Parquet file'
WHAT = "a run folder, an event log (.lcmlog), a run's CSV, an MCAP or a Parquet file of abs_hil convert"
#: how files begin
_BEGINNINGS = {b'\xed\xa1\xda\x01': LOG, b'\x89MCAP0\r\n': MCAP, b'PAR1': PARQUET}
_FOREIGN = {b'PK\x03\x04': 'a ZIP archive, as the own files of spreadsheets are: save the table as CSV',
            b'\x28\xb5\x2f\xfd': 'compressed: decompress it first (unzstd)', b'\xfd7zXZ': 'compressed: decompress it first (unxz)'}
#: columns of a converted log that say where a row came from
FROM_LOG = ('log_event', 'log_time_us', 'channel', 'type')
#: notes on a run that lost nothing
NO_CSV = 'no run.csv: the rows are those of run.lcmlog'
NO_SUMMARY = 'no summary.json: names, figures and configuration are unknown'
#: a run's messages count from 0, and none makes more
_LAST_NUMBER = 10 ** 13


def named(path: PathLike) -> tuple[pathlib.Path, int]:
    """The file, and the number of the run in it that a name like FILE#2 asks for; 0: the only one."""
    place, number = _core.named_recording(os.fsencode(path))
    return pathlib.Path(os.fsdecode(place)), number


def kind_of(place: pathlib.Path) -> str:
    """FOLDER, LOG, CSV, MCAP or PARQUET. Raises ValueError, with the reason and what to do, for anything else."""
    if place.is_dir():
        return FOLDER
    if not place.exists():
        raise ValueError(f'"{place}" does not exist; give {WHAT}')
    if not place.is_file():
        return CSV  # a pipe, which can be read once only
    try:
        with open(place, 'rb') as file:
            head = file.read(512)
    except OSError as error:
        raise ValueError(f'cannot read "{place}": {error.strerror}; give {WHAT}') from None
    if not head:
        raise ValueError(f'{place}: the file is empty: nothing was recorded')
    for begin, what in {**_BEGINNINGS, **_FOREIGN}.items():
        if head.startswith(begin):
            if begin in _BEGINNINGS:
                return what
            raise ValueError(f'"{place}" is {what}')
    if head[:2] == b'\x1f\x8b':
        with contextlib.suppress(OSError, EOFError), gzip.open(place) as packed:
            if packed.read(8).startswith(tuple(_BEGINNINGS)):
                raise ValueError(f'"{place}" is compressed: decompress it first (gunzip)')
    elif place.suffix in ('.lcmlog', '.mcap', '.parquet') or (b'\0' in head and head[:2] not in (b'\xff\xfe', b'\xfe\xff')):
        raise ValueError(f'"{place}" is no recording, although its name may say so; give {WHAT}')
    return CSV


def load(path: PathLike) -> Run:
    """Loads a run folder, an event log (.lcmlog), a run's CSV, or what `abs_hil convert` made of one: MCAP, Parquet, CSV;
    whole or cut off. `Run.notes` says what is missing. FILE#2 is the second run of a file that holds several.

    Raises ValueError for anything else, with the file, the place and the reason; so it does for a file with several runs of
    which none is named, and for a run folder whose files are no longer those of its SHA256SUMS. Raises ImportError, with
    the command that mends it, where the package for MCAP (mcap) or Parquet (pyarrow) is missing.
    """
    place, number = named(path)
    if (kind := kind_of(place)) != FOLDER:
        run = {LOG: _load_log, CSV: _load_csv, MCAP: _load_mcap, PARQUET: _load_parquet}[kind](place, os.fspath(path))
        run.folder, run.name = place.parent, f'{place.stem}#{number}' if number else place.stem
        return run
    _core.chosen_run(os.fsencode(path), 1)
    _core.check_seal(os.fsencode(place))
    if (rows := next((place / one for one in ('run.csv', 'run.lcmlog') if (place / one).exists()), None)) is None:
        what = 'a series; load it with abs_hil.load_series' if (place / 'series.json').exists() else 'no run folder'
        raise ValueError(f'"{place}" is {what} (it has no run.csv)')
    run = load(rows)
    run.folder, run.name = place, place.resolve().name
    if rows.suffix == '.lcmlog':
        run.notes.append(NO_CSV)
    elif (place / 'summary.json').exists():
        try:
            run.summary = read_object(place / 'summary.json')
        except ValueError as error:
            run.notes.append(f'summary.json is not used: {error}')
    else:
        run.notes.append(NO_SUMMARY)
    return run


def run_names(path: PathLike) -> list[str]:
    """The names of all runs of a file, as FILE#1; FILE alone if it holds one. ValueError as `load`."""
    place, number = named(path)
    kind = kind_of(place)
    if number or not place.is_file():
        return [os.fspath(path)]
    if kind == LOG:
        count = int(_core.read_log(os.fsencode(place), 0, False)['runs'])
    else:
        count = len(starts_of(McapContent(place).columns()[0] if kind == MCAP else _parquet(place)[0] if kind == PARQUET else
                              read_rows(place, (), ('run',)).columns))
    return [os.fspath(path)] if count <= 1 else [f'{place}#{one}' for one in range(1, count + 1)]


def load_series(folder: PathLike) -> Series:
    """Loads the complete runs of a series' folder, in order; `Series.notes` names those that are left out."""
    place = pathlib.Path(folder)
    folders, notes = runs_in_series(place)
    runs = [load(path) for path in folders]
    try:
        index = read_object(place / 'series.json')
    except ValueError:
        index = {}
        notes.append('no readable series.json')
    return Series(runs, index, notes)


def runs_in_series(place: pathlib.Path) -> tuple[list[pathlib.Path], list[str]]:
    """The folders of the complete runs of a series, in order, and notes about the others. Raises ValueError if there is
    none."""
    try:
        folders = sorted(path for path in place.iterdir() if path.name.startswith('run-') and path.is_dir())
    except (FileNotFoundError, NotADirectoryError):
        folders = []
    except OSError as error:
        raise ValueError(f'cannot read "{place}": {error.strerror}') from None
    if not folders:
        raise ValueError(f'"{place}" is no series folder (it has no run-0001/)')
    complete = [path for path in folders if (path / 'run.csv').exists() and (path / 'summary.json').exists()]
    notes = [f'{path} is not complete and is left out' for path in folders if path not in complete]
    if not complete:
        raise ValueError(f'"{place}": this series folder has no complete run (as run-0001/ with run.csv and summary.json)')
    return complete, notes


def read_events(data: bytes, place: PathLike) -> list[Event]:
    """The events of an events.csv. ValueError, with `place` and line, for what is none."""
    text = in_order(data[:data.rfind(b'\n') + 1])  # a line without line end is the trace of a crash
    head, *lines = (line.split(text.separator) for line in text.data.decode('utf-8', 'replace').split('\n'))
    if head[:5] != ['time_s', 'event', 'phase', 'reason', 'value']:
        raise ValueError(f'{place}:1: the header must begin with "time_s,event,phase,reason,value"')
    events = []
    for number, fields in zip(text.lines[1:], lines):
        try:
            texts = [_core.clean_text(one.encode(), most) for one, most in zip(fields[1:], (40, 40, 1000, 40, 40))]
            events.append(Event(float(fields[0]), texts[0], texts[1], texts[2], texts[3], ''.join(texts[4:])))
        except (IndexError, ValueError):
            raise ValueError(f'{place}:{number}: not an event: "{_core.clean_text(",".join(fields).encode(), 60)}"') from None
    return events


# ---- the readers: each takes the place of the file, and the name by which it was asked for

def _load_csv(place: pathlib.Path, name: str) -> Run:
    rows = read_rows(place)
    notes = ['the last row of the CSV is incomplete, as after a crash, and is left out'] if rows.truncated else []
    columns, _ = _one_run({one: values for one, values in rows.columns.items() if one not in FROM_LOG}, name)
    return Run(columns, {}, signals_of(columns), notes + rows.notes, truncated=rows.truncated)


def read_log(path: PathLike, whole: bool = False) -> dict[str, Any]:
    """_core.read_log of the run that the name asks for, with phases as names."""
    place, number = named(path)
    found: dict[str, Any] = _core.read_log(os.fsencode(place), max(number, 1) - 1, whole)
    _core.chosen_run(os.fsencode(path), found['runs'])
    name_phases(found['columns'])
    return found


def _load_log(place: pathlib.Path, name: str) -> Run:
    found = read_log(name)
    messages: dict[str, list[Any]] = {'event_t': [], 'experiment_t': [], 'status_t': []}
    for data in found['messages']:
        try:
            message = decode(data)
            messages.setdefault(type(message).__name__, []).append(message)
        except ValueError:
            found['unreadable'] += 1
    if found['rows'] == 0:
        raise ValueError(found['damage'] or f'"{place}" holds no telemetry of abs_hil' + (
            ', or another version of abs_hil recorded it' if found['unreadable'] else '')
            + f'; `abs_hil log info {place}` lists what it holds')
    run = Run(found['columns'], {}, tuple(found['signals']))
    run.notes = [note for told, note in (
        (found['damage'], f'parts of the log are not used: {found["damage"]}'),
        (found['lacks'], f'{found["lacks"]}: another version of abs_hil recorded it'),
        (found['unreadable'], f'{found["unreadable"]} messages of the log cannot be read and are left out'),
        (found['late'], f'{found["late"]} messages of telemetry came twice or late and are left out')) if told]
    check_times(run['time_s'], lambda row: f'{place}: message {row + 1} of its telemetry')
    run.start_ns = max(found['start_us'], 0) * 1000
    run.losses = _losses(place, found, messages['event_t'])
    names = run.columns.get('phase_name', run['phase'])
    for event in messages['event_t']:
        row = min(int(np.searchsorted(run['time_s'], event.time_s - 1e-6)), len(run) - 1)
        phase = PHASES[event.phase] if 0 <= event.phase < len(PHASES) else 'fault'
        run.events.append(Event(event.time_s, event.kind, phase, event.reason_text, f'{event.value:.12g}', str(names[row]),
                                event.message))
    check_times(np.array([event.time_s for event in run.events]), lambda row: f'{place}: event {row + 1}', rising=False)
    if not messages['experiment_t']:
        run.notes.append('the log does not describe the run: its names and its configuration are unknown')
    for told in messages['experiment_t'][:1]:
        run.summary = {one: getattr(told, one) for one in ('experiment', 'controller', 'plant', 'backend', 'version')}
        try:
            run.summary['config'] = parse_json(told.config_json)
        except ValueError:
            run.notes.append('the configuration in the log is not valid JSON')
    ends = {'fault': 'fault', 'stop request': 'stopped'}
    for event in reversed(messages['event_t']):
        reason = REASONS.get(event.reason, {'kind': '', 'name': ''})
        result = 'completed' if reason['name'] == 'sequence_complete' else ends.get(reason['kind'])
        if result is not None:
            _, found_words, value = event.message.partition(event.reason_text)
            run.summary.update(result=result, reason=event.reason_text + value * bool(found_words))
            counts = ('cycles', 'overruns', 'telemetry_drops', 'publish_failures')
            run.summary.update((one, getattr(status, one)) for status in messages['status_t'][-1:] for one in counts)
            return _with_figures(run)
    run.notes.append('the log ends before the run did: its result is unknown')
    return _with_figures(run)


def _losses(place: pathlib.Path, found: Mapping[str, Any], events: list[Any]) -> list[str]:
    sequences, cycles = found['sequences'], found['cycles']
    event_sequences = np.array([event.sequence for event in events], dtype=np.int64)
    for what, values in (('cycles', cycles), ('sequences', sequences), ('event_sequences', event_sequences)):
        for number in values[~((values >= 0) & (values <= _LAST_NUMBER))][:1].tolist():
            raise ValueError(f'{place}: a message has the impossible number {number} among its {what}')
    every = int(np.median(np.diff(cycles))) if len(cycles) > 1 else 1
    lost, events_lost = missing_in(sequences), missing_in(event_sequences)
    dropped = missing_in(cycles, every) - lost
    return [text for count, text in (
        (lost, f'{lost} messages of telemetry are missing in the log'),
        (events_lost, f'{events_lost} events are missing in the log'),
        (dropped, f'{dropped} cycles have no message, although every {every} of them should have one')) if count > 0]


def missing_in(numbers: np.ndarray, step: int = 1) -> int:
    """How many numbers are missing in a sequence that should rise by `step`."""
    return int(np.sum(np.maximum(np.diff(numbers) // max(step, 1) - 1, 0)))


def _load_mcap(place: pathlib.Path, name: str) -> Run:
    content = McapContent(place)
    columns, times_ns = content.columns()
    columns, (first, last) = _one_run(columns, name)
    run = _described(columns, content.metadata, content.attachments)
    run.start_ns = max(int(times_ns[first]) - round(float(run['time_s'][0]) * 1e9), 0)
    until_ns = times_ns[last] if last < len(times_ns) else math.inf
    for topic in content.topics.values() if not run.events else ():
        events = zip(topic.times_ns, topic.data) if topic.name == EVENT_TOPIC else ()
        run.events += [Event((time_ns - run.start_ns) * 1e-9, log_of(data)[0], '', message=log_of(data)[1])
                       for time_ns, data in events if run.start_ns <= time_ns < until_ns]
    if content.damage:
        run.notes.append(f'parts of "{place}" are not used: it is cut off or damaged ({content.damage})')
    return run


def _load_parquet(place: pathlib.Path, name: str) -> Run:
    columns, metadata = _parquet(place)
    texts = {one: data.decode(errors='replace') for one, data in metadata.items() if '.' not in one}
    return _described(_one_run(columns, name)[0], texts, {one: data for one, data in metadata.items() if '.' in one})


def _parquet(place: pathlib.Path) -> tuple[dict[str, np.ndarray], dict[str, bytes]]:
    """Columns, and our metadata. Columns that hold neither numbers nor texts of a run are left out."""
    import pyarrow
    import pyarrow.parquet
    try:
        table = pyarrow.parquet.read_table(place)
    except (pyarrow.ArrowException, OSError) as error:
        raise ValueError(f'"{place}" is cut off or damaged ({str(error).splitlines()[0]}); convert the run again') from None
    columns = {name: values.fillna('').to_numpy(object) if name in TEXTS else values.to_numpy(float)
               for name, values in table.to_pandas().items() if name in TEXTS or values.dtype.kind in 'iufb'}
    return columns, {key.decode().removeprefix('abs_hil.'): value for key, value in (table.schema.metadata or {}).items()
                     if key.startswith(b'abs_hil.')}


def _one_run(columns: Mapping[str, np.ndarray], name: str) -> tuple[dict[str, np.ndarray], tuple[int, int]]:
    """The columns of the run that the name asks for, without their column `run`, and its rows [first, last)."""
    if missing := [one for one in CONTRACT if one not in columns]:
        raise ValueError(f'"{name}" lacks the columns {", ".join(missing)} of a run')
    starts = [*starts_of(columns), len(columns['time_s'])]
    if starts[-1] == 0:
        raise ValueError(f'"{name}" holds no rows')
    number = _core.chosen_run(os.fsencode(name), len(starts) - 1)
    first, last = starts[number:number + 2]
    chosen = {one: values[first:last] for one, values in columns.items() if one != 'run'}
    check_times(chosen['time_s'], lambda row: f'{name}: row {first + row + 1}')
    return chosen, (first, last)


def _described(columns: dict[str, np.ndarray], metadata: Mapping[str, str], attachments: dict[str, bytes]) -> Run:
    """A run of a converted file, with what stands there beside its rows."""
    facts = ('experiment', 'controller', 'plant', 'backend', 'result', 'reason')
    run = Run(columns, {one: metadata[one] for one in facts if one in metadata}, signals_of(columns), attachments=attachments,
              losses=[one for one in metadata.get('losses', 'none').split('; ') if one != 'none'])
    try:
        if 'config.json' in attachments:
            run.summary['config'] = parse_json(attachments['config.json'])
        if 'events.csv' in attachments:
            run.events = read_events(attachments['events.csv'], 'events.csv')
        if 'summary.json' in attachments:
            run.summary = dict(parse_json(attachments['summary.json']))
            return run
    except (TypeError, ValueError) as error:
        run.notes.append(f'not all that was attached to the rows is used: {error}')
    return _with_figures(run)


def _with_figures(run: Run) -> Run:
    """With the figures of merit of its rows, which no file holds."""
    found = figures_of(run.columns, run.config)
    run.summary.update((one, found[one] if math.isfinite(found[one]) else None)
                       for one, figure in figures().items() if figure.in_summary)
    return run
