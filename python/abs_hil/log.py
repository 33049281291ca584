"""abs_log: what recordings hold; `abs_hil log info` starts it."""
import contextlib
import datetime
import itertools
import json
import os
import pathlib
import struct
from typing import Any

import numpy as np

from . import parsers
from .core import _core
from .interchange.messages import McapContent
from .interchange.recorded import missing_rows
from .messages import TYPES, type_of
from .options import failed
from .recording import FOLDER, LOG, MCAP, kind_of, load, missing_in, named, run_names
from .run import Run

#: where the times of a log of virtual time begin (src/program/run_outputs.cpp), and of those that are not known
EPOCHS_NS, DAY_NS = (946_684_800 * 10 ** 9, 0), 86_400 * 10 ** 9
#: where the number of a message stands in its bytes
_SEQUENCE = 16
_FACTS = ('experiment', 'controller', 'plant', 'backend', 'version', 'result', 'reason')


def main(arguments: list[str]) -> int:
    given = parsers.log().parse_args(arguments)
    told, status = [], 0
    for file in given.files:
        try:
            told.append(info_of(file))
        except ValueError as error:
            status = failed('abs_log', error)
    print(json.dumps(told, indent=1) if given.json else '\n\n'.join(map(_text, told)), end='\n' * bool(told or given.json))
    return status


def info_of(name: str) -> dict[str, Any]:
    """What a recording holds, ready for JSON; None for what is not known. Raises ValueError for what is no recording."""
    place, number = named(name)
    kind = kind_of(place)
    files = [place] if kind != FOLDER else [one for one in place.iterdir() if one.is_file()]
    told: dict[str, Any] = {'file': name, 'format': kind, 'bytes': sum(one.stat().st_size for one in files), 'start_utc': None,
                            'duration_s': None, 'parts': 1, 'damage': None, 'channels': [], 'runs': []}
    if kind == LOG or (place / 'run.lcmlog').is_file():
        runs = _take_log(place if kind == LOG else place / 'run.lcmlog', told)
        names = [f'{place}#{one}' for one in range(1, runs + 1)] if kind == LOG and not number and runs != 1 else [name]
    elif kind == MCAP:
        content = McapContent(place)
        told['damage'] = content.damage or None
        told['channels'] = [_channel(one.name, one.type, {0: [(time_ns, 0, 0) for time_ns in one.times_ns]}, one.bytes)
                            for one in content.topics.values() if one.times_ns]
        names = run_names(name) if any(one.columns and one.data for one in content.topics.values()) else []
    else:
        names = run_names(name)
    for one in names:
        try:
            told['runs'].append(_of_run(one, load(one)))
        except ValueError as error:
            if not told['channels']:
                raise
            told['runs'].append({'name': one, 'rows': 0, 'notes': [str(error)]})
    if spans := [one['span_ns'] for one in (told['channels'] or told['runs']) if 'span_ns' in one]:
        begin, end = min(begin for begin, _ in spans), max(end for _, end in spans)
        told.update(start_utc=_date(begin), duration_s=(end - begin) * 1e-9)
    return told


def _take_log(place: pathlib.Path, told: dict[str, Any]) -> int:
    """Adds channels and damage of a log; the number of its runs."""
    channels: dict[tuple[str, str], dict[int, list[tuple[int, int, int]]]] = {}
    runs, events = 0, _core.LogEvents(os.fsencode(place))
    try:
        for run, part, _, time_us, channel, data in events:
            type_ = type_of(data)
            sequence = struct.unpack_from('>q', data, _SEQUENCE)[0] if type_ and len(data) >= _SEQUENCE + 8 else 0
            channels.setdefault((channel, type_), {}).setdefault(run, []).append((time_us * 1000, len(data), sequence))
            runs = max(runs, run + 1) if type_ in ('telemetry_t', 'experiment_t') else runs
            told['parts'] = part + 1
        told['damage'] = events.cut or None
    except ValueError as error:
        if not channels:
            raise
        told['damage'] = str(error)
    told['channels'] = [_channel(*key, by_run) for key, by_run in channels.items()]
    return runs


def _channel(name: str, type_: str, by_run: dict[int, list[tuple[int, int, int]]], size: int | None = None) -> dict[str, Any]:
    """By run: time in ns, size and number of each message."""
    tables = [np.array(one, dtype=np.int64) for one in by_run.values()]
    count, span_s = sum(map(len, tables)), sum(int(np.ptp(one[:, 0])) for one in tables) * 1e-9
    lost = sum(missing_in(np.clip(one[:, 2], 0, 2 ** 53)) for one in tables) if type_ in TYPES and type_ != 'command_t' else None
    return {'channel': name, 'type': type_ or None, 'messages': count, 'lost': lost,
            'bytes': sum(int(one[:, 1].sum()) for one in tables) if size is None else size,
            'rate_Hz': (count - len(tables)) / span_s if span_s > 0 else None,
            'span_ns': [min(int(one[:, 0].min()) for one in tables), max(int(one[:, 0].max()) for one in tables)]}


def _date(time_ns: int) -> str | None:
    if not any(abs(time_ns - epoch_ns) < DAY_NS for epoch_ns in EPOCHS_NS):
        with contextlib.suppress(OverflowError, ValueError, OSError):
            return datetime.datetime.fromtimestamp(time_ns * 1e-9, datetime.UTC).isoformat(timespec='milliseconds')
    return None


def _of_run(name: str, run: Run) -> dict[str, Any]:
    begin_s, end_s = float(run['time_s'][0]), float(run['time_s'][-1])
    return {'name': name, 'start_utc': _date(run.start_ns), 'duration_s': end_s - begin_s, 'rows': len(run),
            'rate_Hz': (len(run) - 1) / (end_s - begin_s) if end_s > begin_s else None,
            **{key: run.summary.get(key) for key in _FACTS}, 'signals': list(run.signals),
            'phases': [phase for phase, _ in itertools.groupby(run['phase'].tolist())],
            'gaps': list(dict.fromkeys([*run.losses, *missing_rows(run)])), 'notes': run.notes,
            'span_ns': [run.start_ns + round(time_s * 1e9) for time_s in (begin_s, end_s)]}


def _text(told: dict[str, Any]) -> str:
    parts = f', {told["parts"]} recordings, one appended to the other' * (told['parts'] > 1)
    lines = [('file', told['file']), ('format', f'{told["format"]}, {_bytes(told["bytes"])}{parts}'),
             ('start', told['start_utc'] or 'no date: virtual time, or not recorded'),
             ('duration', f'{told["duration_s"] or 0:.3f} s'), ('whole', f'no: {told["damage"]}' if told['damage'] else 'yes')]
    for one in told['channels']:
        rate = '' if one['rate_Hz'] is None else f'{one["rate_Hz"]:.1f} Hz'
        lost = '' if one['lost'] is None else f'  lost {one["lost"]}'
        lines.append(('channel', f'{one["channel"]:<20} {one["type"] or "unknown type":<16} {one["messages"]:>8} messages '
                      f'{rate:>10} {_bytes(one["bytes"]):>9}{lost}'))
    for run in told['runs'] or [{'name': 'none of abs_hil', 'rows': 0, 'notes': []}]:
        names = ', '.join(str(run[key]) for key in _FACTS[:4] if run.get(key))
        lines.append(('run', ': '.join(filter(None, [run['name'], names]))))
        if run['rows']:
            when = run['start_utc'] or 'no date'
            lines += [('', f'{run["rows"]} rows, {run["duration_s"]:.3f} s, {when}; {" ".join(run["phases"])}'),
                      ('', ': '.join(filter(None, [run['result'] or 'result unknown', run['reason']])))]
        lines += [('', note) for note in [*run.get('gaps', ()), *run['notes']]]
    return '\n'.join(f'{title + ":" * bool(title):<10}{text}' for title, text in lines)


def _bytes(size: int) -> str:
    return f'{size / 1e6:.1f} MB' if size >= 1e5 else f'{size / 1e3:.1f} kB'
