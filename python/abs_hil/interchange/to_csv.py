"""Runs as CSV. Of an event log: OUT.csv has the columns of --csv, then every other quantity; OUT.CHANNEL.csv the fields of each
other channel's messages; OUT.raw.csv, as hexadecimal digits, what is none of our messages. The last columns say where in the
log a row came from."""
import os
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..core import _core
from ..files import write_whole
from ..messages import decode
from ..recording import FROM_LOG, LOG, kind_of, named, read_log
from ..run import Run, csv_bytes

#: rows that are texts at once
_ROWS = 50_000


def to_csv(run: Run, name: str, out: pathlib.Path) -> str:
    """Writes all files, or none. Returns words about what is in them."""
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
