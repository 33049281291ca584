"""abs_log: what recordings hold; `abs_hil log info` starts it."""
import contextlib
import datetime
import itertools
import json
import os
import pathlib
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

from . import parsers
from .core import _core
from .interchange.mcap_file import mcap_file
from .interchange.recorded import missing_rows
from .messages import TYPES
from .options import failed
from .recording import FOLDER, LOG, MCAP, kind_of, load, missing_in, named, run_names
from .run import Run

#: where the times of a log of virtual time begin (src/program/run_outputs.cpp)
VIRTUAL_EPOCH_NS = 946_684_800 * 10 ** 9
_TYPES = {type_._get_packed_fingerprint(): name for name, type_ in TYPES.items()}
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
    names = [name]
    if kind == LOG or (place / 'run.lcmlog').is_file():
        runs = _take_log(place if kind == LOG else place / 'run.lcmlog', told)
        names = [f'{place}#{one}' for one in range(1, runs + 1)] if kind == LOG and not number and runs != 1 else names
    elif kind == MCAP:
        content = mcap_file(place)
        told['damage'] = content.damage or None
        for topic in content.topics.values():
            _take_channel(told, topic.name, topic.type, topic.times_ns, topic.bytes)
        names = run_names(name) if any(topic.data for topic in content.topics.values()) else []
    elif kind != FOLDER:
        names = run_names(name)
    for one in names:
        try:
            told['runs'].append(_of_run(one, load(one)))
        except ValueError as error:
            if not told['channels']:
                raise
            told['runs'].append({'name': one, 'rows': 0, 'notes': [str(error)]})
    spans = [(one['start_ns'], one['end_ns']) for one in (told['channels'] or told['runs']) if 'end_ns' in one]
    if spans:
        begin, end = min(begin for begin, _ in spans), max(end for _, end in spans)
        told.update(start_utc=_date(begin), duration_s=(end - begin) * 1e-9)
    return told


def _take_log(place: pathlib.Path, told: dict[str, Any]) -> int:
    """Adds channels and damage of a log; the number of its runs."""
    channels: dict[tuple[str, str], dict[int, list[tuple[int, int, int]]]] = {}
    runs, events = 0, _core.LogEvents(os.fsencode(place))
    try:
        for run, part, _, time_us, channel, data in events:
            type_ = _TYPES.get(data[:8], '')
            sequence = struct.unpack_from('>q', data, _SEQUENCE)[0] if type_ and len(data) >= _SEQUENCE + 8 else 0
            channels.setdefault((channel, type_), {}).setdefault(run, []).append((time_us, len(data), sequence))
            runs = max(runs, run + 1) if type_ in ('telemetry_t', 'experiment_t') else runs
            told['parts'] = part + 1
        told['damage'] = events.cut or None
    except ValueError as error:
        if not channels:
            raise
        told['damage'] = str(error)
    for (channel, type_), by_run in channels.items():
        tables = [np.array(one) for one in by_run.values()]
        lost = sum(missing_in(np.clip(one[:, 2], 0, 2 ** 53)) for one in tables) if type_ not in ('', 'command_t') else None
        _take_channel(told, channel, type_, np.concatenate(tables)[:, 0] * 1000, sum(int(one[:, 1].sum()) for one in tables), lost,
                      sum(float(np.ptp(one[:, 0])) for one in tables) * 1e-6, len(tables))
    return runs


def _take_channel(told: dict[str, Any], name: str, type_: str, times_ns: Sequence[int] | np.ndarray, size: int,
                  lost: int | None = None, span_s: float | None = None, runs: int = 1) -> None:
    if len(times_ns) == 0:
        return
    begin, end = int(min(times_ns)), int(max(times_ns))
    span_s = (end - begin) * 1e-9 if span_s is None else span_s
    told['channels'].append({'channel': name, 'type': type_ or None, 'messages': len(times_ns), 'bytes': size, 'lost': lost,
                             'rate_Hz': (len(times_ns) - runs) / span_s if span_s > 0 else None, 'start_ns': begin, 'end_ns': end})


def _date(time_ns: int) -> str | None:
    """Nothing for times that are no dates: of virtual time, and unknown ones."""
    if time_ns < 86_400 * 10 ** 9 or abs(time_ns - VIRTUAL_EPOCH_NS) < 86_400 * 10 ** 9:
        return None
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
            'start_ns': run.start_ns + round(begin_s * 1e9), 'end_ns': run.start_ns + round(end_s * 1e9)}


def _text(told: dict[str, Any]) -> str:
    lines = [('file', told['file']), ('format', f'{told["format"]}, {_bytes(told["bytes"])}'
                                      + f', {told["parts"]} recordings, one appended to the other' * (told['parts'] > 1)),
             ('start', told['start_utc'] or 'no date: virtual time, or not recorded'), ('duration', f'{told["duration_s"] or 0:.3f} s'),
             ('whole', f'no: {told["damage"]}' if told['damage'] else 'yes')]
    for one in told['channels']:
        rate, lost = (f'{value}' if value is not None else '' for value in (one['rate_Hz'] and f'{one["rate_Hz"]:.1f} Hz', one['lost']))
        lines.append(('channel', f'{one["channel"]:<20} {one["type"] or "unknown type":<16} {one["messages"]:>8} messages {rate:>10} '
                      f'{_bytes(one["bytes"]):>9}{"  lost " * bool(lost)}{lost}'))
    for run in told['runs'] or [{'name': 'none of abs_hil', 'rows': 0, 'notes': []}]:
        who = ', '.join(str(run[key]) for key in _FACTS[:4] if run.get(key))
        lines.append(('run', run['name'] + ': ' * bool(who) + who))
        if run['rows']:
            lines += [('', f'{run["rows"]} rows, {run["duration_s"]:.3f} s, {run["start_utc"] or "no date"}; {" ".join(run["phases"])}'),
                      ('', ': '.join(filter(None, [run['result'] or 'result unknown', run['reason']])))]
        lines += [('', note) for note in [*run.get('gaps', ()), *run['notes']]]
    return '\n'.join(f'{title + ":" * bool(title):<10}{text}' for title, text in lines)


def _bytes(size: int) -> str:
    return f'{size / 1e6:.1f} MB' if size >= 1e5 else f'{size / 1e3:.1f} kB'
