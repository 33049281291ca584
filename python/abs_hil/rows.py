"""Reads the rows of a CSV, as a run wrote it or a spreadsheet saved it, and says file and line of whatever is no row."""
import csv
import gzip
import io
import itertools
import math
import os
import pathlib
import re
import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .core import _core
from .messages import QUANTITIES

#: columns that every run's CSV has, whatever version wrote it; others may follow in any order
CONTRACT = tuple(name for name, row in QUANTITIES.items() if row['csv_column'] is not None and row['since'] == '0.1')
#: columns that hold texts: of a run; of exported runs their name; of converted logs where a row came from; of coarse traces
TEXTS = ('phase', 'phase_name', 'run', 'channel', 'type', 'wheel')
MOST_SHOWN = 40
#: the latest time of a row: some other program's may count from 1970
LAST_S = 2e9
#: between the fields of a text that was put in order
_SEPARATOR = '\x1f'


@dataclass
class Rows:
    """columns: name -> float64, or texts for those in TEXTS, in the order of the file.
    truncated: the last line has no end, as after a crash; it is no row.
    notes: what else was left out."""
    columns: dict[str, np.ndarray]
    truncated: bool
    notes: list[str] = field(default_factory=list)


@dataclass
class _Text:
    """lines: the numbers that the lines of `data` have in the file."""
    data: bytes
    separator: str
    lines: Sequence[int]


def read_rows(path: str | os.PathLike[str], needed: Sequence[str] = CONTRACT, only: Collection[str] = ()) -> Rows:
    """A CSV as this program writes it, or a person or a spreadsheet: with a byte order mark, UTF-16, line ends of Windows,
    fields in quotes, ';' or tabs beside decimal commas, comments (#) at its beginning, gzip. An empty field is unknown.

    needed: the columns that it must have; without any its times are not checked. only: no others are read. Columns that
    hold nothing but texts are left out.
    Raises ValueError with file and line: missing columns, fields that are no numbers, decreasing time, no row.
    """
    place = pathlib.Path(path)
    try:
        data = place.read_bytes()
    except OSError as error:
        raise ValueError(f'cannot read "{place}": {error.strerror}; give a run\'s CSV file or folder') from None
    data, damaged = _unzipped(data) if data[:2] == b'\x1f\x8b' else (data, False)
    wide = data[:2] in (b'\xff\xfe', b'\xfe\xff')
    data = data.decode('utf-16', 'replace').encode() if wide else data.removeprefix(b'\xef\xbb\xbf')
    if b'\n' not in data:
        data = data.replace(b'\r', b'\n')
    end = data.rfind(b'\n') + 1
    truncated = end < len(data)
    data = data[:end]
    if not data:
        raise ValueError(f'{place}:1: the file ends within its first line: the recording stopped before the first row'
                         if truncated else f'{place}:1: the file is empty: the run wrote nothing')
    plain = _Text(data, ',', range(1, 1 << 62))
    try:
        rows = _rows(place, plain if b'"' not in data else in_order(data), truncated, needed, only)
    except ValueError:
        rows = _rows(place, in_order(data), truncated, needed, only)
    if damaged:
        rows.notes.append(f'"{place}" is cut off; its readable part is used')
    return rows


def starts_of(columns: Mapping[str, np.ndarray]) -> list[int]:
    """Where the runs of a table begin: where its column `run` changes."""
    names = columns.get('run', np.empty(0))
    return [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1).tolist()]


def _unzipped(content: bytes) -> tuple[bytes, bool]:
    """What can be read, and whether the rest is missing or damaged."""
    parts = []
    with gzip.GzipFile(fileobj=io.BytesIO(content)) as file:
        try:
            while part := file.read1(1 << 16):
                parts.append(part)
        except (OSError, EOFError, zlib.error):
            return b''.join(parts), True
    return b''.join(parts), False


def in_order(data: bytes) -> _Text:
    """A text with points in its numbers, without quotes, empty lines, and comments before its first line."""
    separator, lines = '', []
    kept: list[str] = []
    for number, line in enumerate(data.decode('utf-8', 'surrogateescape').split('\n'), 1):
        line = line.rstrip('\r')
        if not line.strip(' \t,;"') or (not kept and line.startswith(('#', 'sep='))):
            continue
        separator = separator or next((one for one in '\t;' if one in line), ',')
        try:
            fields = next(csv.reader([line], delimiter=separator, skipinitialspace=True, strict=True))
        except csv.Error:
            fields = line.split(separator)
        while len(fields) > 1 and not fields[-1] and (not kept or len(fields) > kept[0].count(_SEPARATOR) + 1):
            fields.pop()  # a spreadsheet's empty columns behind the last one
        kept.append(_SEPARATOR.join(re.sub(r'^([-+]?\d*),(\d+(?:[eE][-+]?\d+)?)$', r'\1.\2', one.strip()) for one in fields))
        lines.append(number)
    return _Text('\n'.join([*kept, '']).encode('utf-8', 'surrogateescape'), _SEPARATOR, lines)


def _rows(place: pathlib.Path, text: _Text, truncated: bool, needed: Sequence[str], only: Collection[str]) -> Rows:
    import pandas
    names, first = _header(place, text, needed)
    if len(text.data) == first:
        raise ValueError(f'{place}:2: the only row is incomplete: the file holds no data of the run' if truncated else
                         f'{place}:1: no rows after the header: the file holds no data of the run')
    wanted = [number for number, name in enumerate(names) if name and (not only or name in only)]
    ends = [line.rstrip(b'\r').split(text.separator.encode()) for line in (
        text.data[first:text.data.index(b'\n', first)], text.data[text.data.rfind(b'\n', 0, -1) + 1:-1])]
    words = [number for number in wanted if names[number] not in (*QUANTITIES, *TEXTS, *needed)
             and not any(_is_number(row[number]) for row in ends if number < len(row))]
    wanted = [number for number in wanted if number not in words]
    if not wanted:
        return Rows({}, truncated)
    numbers = {number for number in wanted if names[number] not in TEXTS}
    try:
        rows = io.BytesIO(text.data)  # shares the bytes: a long run's rows fill the memory once
        rows.seek(first)
        unknown: dict[int, list[str]] = {number: [] for number in range(len(names))}
        unknown.update((number, ['NaN', 'nan'] if names[number] == 'time_s' else ['NaN', 'nan', '']) for number in numbers)
        frame = pandas.read_csv(rows, header=None, usecols=wanted, na_values=unknown, sep=text.separator, keep_default_na=False,
                                dtype={number: np.float64 if number in numbers else str for number in wanted},
                                float_precision='round_trip', quoting=csv.QUOTE_NONE, skip_blank_lines=False,
                                encoding_errors='surrogateescape')
        # pandas refuses a line that is longer than the one before, and fills up a shorter one: then separators are missing.
        if text.data.count(text.separator.encode(), first) != len(frame) * (len(names) - 1):
            raise ValueError
    except ValueError as error:
        _refuse(place, text, first, names, numbers)
        raise ValueError(f'{place}: {error}') from None
    columns = {names[number]: frame[number].to_numpy() for number in wanted}
    if needed:
        for begin, end in itertools.pairwise([*starts_of(columns), len(frame)]):
            lines = text.lines[begin + 1:end + 1]
            check_times(columns['time_s'][begin:end], lambda row, lines=lines: f'{place}:{lines[row]}')  # type: ignore[misc]
    for name in {*TEXTS} & {*columns}:
        texts = columns[name]  # few different ones
        clean = {one: _core.clean_text(str(one).encode('utf-8', 'surrogateescape'), MOST_SHOWN) for one in set(texts)}
        columns[name] = np.array([clean[one] for one in texts], dtype=object)
    return Rows(columns, truncated, [f'column {names[number]} of "{place}" holds texts and is left out' for number in words])


def _is_number(field: bytes) -> bool:
    try:
        float(field or 0)
        return True
    except ValueError:
        return False


def _header(place: pathlib.Path, text: _Text, needed: Sequence[str]) -> tuple[list[str], int]:
    """Names of the columns, and where the rows begin."""
    first = text.data.find(b'\n') + 1
    names = [_core.clean_text(name.strip()) for name in text.data[:first].rstrip(b'\r\n').split(text.separator.encode())]
    if missing := [name for name in needed if name not in names]:
        some = len(missing) < len(needed)
        wrong = f'the header lacks {", ".join(missing)}' if some else 'the first line names no column of a run'
        raise ValueError(f'{place}:1: {wrong}; a run\'s CSV, as abs_hil --csv writes it, begins with "{",".join(CONTRACT[:3])},…"')
    if twice := [name for name in names if name and names.count(name) > 1]:
        raise ValueError(f'{place}:1: the header has the column {twice[0]} twice')
    return names, first


def _refuse(place: pathlib.Path, text: _Text, first: int, names: list[str], numbers: set[int]) -> None:
    """Raises ValueError for the first line that is no row."""
    for number, line in zip(text.lines[1:], text.data[first:].split(b'\n')[:-1]):
        fields = line.removesuffix(b'\r').split(text.separator.encode())
        for column, value in enumerate(fields[:len(names)]):
            if column in numbers and not _is_number(value or b'-' * (names[column] == 'time_s')):
                raise ValueError(f'{place}:{number}: {names[column]}: "{_core.clean_text(value, MOST_SHOWN)}" is not a number (a '
                                 'run writes NaN for an unknown value)')
        if len(fields) < len(names):
            raise ValueError(f'{place}:{number}: the row has {len(fields)} fields instead of {len(names)} and ends before '
                             f'{names[len(fields)]}')
        if len(fields) > len(names):
            raise ValueError(f'{place}:{number}: the row has more than the header\'s {len(names)} fields')


def check_times(time_s: np.ndarray, place: Callable[[int], str], rising: bool = True) -> None:
    """Raises ValueError for the first of a recording's times that is none. `place` names where the row of that number is."""
    wrong = ~((time_s >= 0.0) & (time_s <= LAST_S))
    if rising:
        wrong[1:] |= time_s[1:] < time_s[:-1]
    for row in np.flatnonzero(wrong)[:1].tolist():
        if not math.isfinite(time_s[row]):
            raise ValueError(f'{place(row)}: time_s is not a finite number')
        if rising and row and time_s[row] < time_s[row - 1]:
            raise ValueError(f'{place(row)}: time_s decreases from {time_s[row - 1]:g} to {time_s[row]:g}')
        raise ValueError(f'{place(row)}: time_s = {time_s[row]:g} is no time of a run: they lie within 0 to {LAST_S:g} s')
