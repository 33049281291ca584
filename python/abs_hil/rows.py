"""Reads the rows of a run's CSV with pandas, and says file and line of whatever is no row of a run."""
import csv
import io
import math
import os
import pathlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .core import _core
from .messages import QUANTITIES

#: columns that every run's CSV has, whatever version wrote it; others may follow in any order
CONTRACT = tuple(name for name, row in QUANTITIES.items() if row['csv_column'] is not None and row['since'] == '0.1')
#: columns that hold texts
TEXTS = ('phase', 'phase_name')
MOST_SHOWN = 40
#: the latest time of a row: some other program's may count from 1970
LAST_S = 2e9


@dataclass
class Rows:
    """columns: name -> float64, or texts for `phase` and `phase_name`, in the order of the file.
    truncated: the last line has no end, as after a crash; it is no row."""
    columns: dict[str, np.ndarray]
    truncated: bool

    @property
    def time_s(self) -> np.ndarray:
        return self.columns['time_s']

    @property
    def braking(self) -> np.ndarray:
        return self.columns['phase'] == 'brake'


def read_rows(path: str | os.PathLike[str]) -> Rows:
    """Raises ValueError with file and line: missing columns, fields that are no numbers, decreasing time, no row."""
    import pandas
    place = pathlib.Path(path)
    try:
        data = place.read_bytes()
    except OSError as error:
        raise ValueError(f'cannot read "{place}": {error.strerror}; give a run\'s CSV file or folder') from None
    end = data.rfind(b'\n') + 1
    truncated = end < len(data)
    data = data[:end]
    names, first = _header(place, data, truncated)
    if len(data) == first:
        raise ValueError(f'{place}:2: the only row is incomplete: the file holds no data of the run' if truncated else
                         f'{place}:1: no rows after the header: the file holds no data of the run')
    try:
        rows = io.BytesIO(data)  # shares the bytes: a long run's rows fill the memory once
        rows.seek(first)
        types = {number: str if name in TEXTS else np.float64 for number, name in enumerate(names)}
        unknown: dict[int, list[str]] = {number: [] if name in TEXTS else ['NaN'] for number, name in enumerate(names)}
        frame = pandas.read_csv(rows, header=None, dtype=types, na_values=unknown,
                                keep_default_na=False, float_precision='round_trip', quoting=csv.QUOTE_NONE,
                                skip_blank_lines=False, encoding_errors='surrogateescape')
        # pandas refuses a line that is longer than the one before, and fills up a shorter one: then commas are missing.
        if frame.shape[1] != len(names) or data.count(b',', first) != len(frame) * (len(names) - 1):
            raise ValueError
        columns = {name: frame[number].to_numpy() for number, name in enumerate(names)}
    except ValueError as error:
        _refuse(place, data[first:], names)
        raise ValueError(f'{place}: {error}') from None
    check_times(columns['time_s'], lambda row: f'{place}:{row + 2}')
    for name in {*TEXTS} & {*columns}:
        texts = columns[name]  # few different ones
        clean = {text: _core.clean_text(str(text).encode('utf-8', 'surrogateescape'), MOST_SHOWN) for text in set(texts)}
        columns[name] = np.array([clean[text] for text in texts], dtype=object)
    return Rows(columns, truncated)


def _header(place: pathlib.Path, body: bytes, truncated: bool) -> tuple[list[str], int]:
    """Names of the columns, and where the rows begin."""
    first = body.find(b'\n') + 1
    if first == 0:
        raise ValueError(f'{place}:1: the file ends within its first line: the recording stopped before the first row'
                         if truncated else f'{place}:1: the file is empty: the run wrote nothing')
    line = body[:first].rstrip(b'\r\n').removeprefix(b'\xef\xbb\xbf')  # a spreadsheet's byte order mark
    names = [_core.clean_text(name) for name in line.split(b',')]
    missing = [name for name in CONTRACT if name not in names]
    if missing:
        raise ValueError(f'{place}:1: the header lacks {", ".join(missing)}; a run\'s CSV, as abs_hil --csv writes it, '
                         f'begins with "{",".join(CONTRACT[:3])},…"')
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f'{place}:1: the header has the column {twice} twice')
    return names, first


def _refuse(place: pathlib.Path, body: bytes, names: list[str]) -> None:
    """Raises ValueError for the first line that is no row."""
    for number, line in enumerate(body.split(b'\n')[:-1], 2):
        fields = line.removesuffix(b'\r').split(b',')
        for name, field in zip(names, fields):
            try:
                if name not in TEXTS:
                    float(field)
            except ValueError:
                shown = _core.clean_text(field, MOST_SHOWN)
                raise ValueError(f'{place}:{number}: {name}: "{shown}" is not a number (a run writes NaN for an unknown '
                                 'value)') from None
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
