"""A run's rows, summary and signals, from the simulator or from files."""
from __future__ import annotations

import itertools
import os
import pathlib
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .core import _core
from .files import write_whole
from .messages import PHASES, QUANTITIES
from .nesting import parse_json
from .options import PathLike
from .rows import TEXTS, check_times, read_rows

if TYPE_CHECKING:
    import pandas

#: columns of every run's CSV, in order
COLUMNS = tuple(name for name, row in QUANTITIES.items() if row['csv_column'] is not None)

#: side files are small; a larger file is not one, and must not fill the memory
MOST_BYTES = 64 << 20


class Run:
    """One run.

    columns: name -> NumPy array of shape (cycles,), float64; `phase` and `phase_name` are arrays of names, `motor_enable`
             of 0 and 1. `phase_name` is there if the experiment gives its phases names of its own.
             Names, units and meanings are those of the CSV (abs_hil.QUANTITIES); the controller's own signals follow.
    summary: the content of summary.json, a dictionary; figures that the run has no value for are None. Empty if the run
             has no summary.
    signals: names of the controller's own signals.
    notes:   what is missing or damaged, as sentences.
    folder:  where the run was read from; None for a simulated one.
    """

    def __init__(self, columns: Mapping[str, np.ndarray], summary: Mapping[str, Any] | None = None,
                 signals: tuple[str, ...] = (), *, notes: list[str] | None = None, config_toml: str = '',
                 folder: pathlib.Path | None = None, name: str = '') -> None:
        self.columns = dict(columns)
        self.summary = dict(summary or {})
        self.signals = tuple(signals)
        self.notes = list(notes or [])
        self.config_toml = config_toml
        self.folder = folder
        self.name = name

    @property
    def data(self) -> pandas.DataFrame:
        """The columns as a pandas DataFrame of shape (cycles, columns). `phase` and `phase_name` are categorical. The frame's
        attrs["units"] has the unit of each column that has one."""
        import pandas
        frame: dict[str, Any] = {name: pandas.Categorical(values) if name in TEXTS else values
                 for name, values in self.columns.items()}
        data = pandas.DataFrame(frame)
        data.attrs['units'] = {name: str(row['unit']) for name, row in QUANTITIES.items() if name in frame and row['unit']}
        return data

    @property
    def config(self) -> dict[str, Any]:
        """The effective configuration by dotted key: {"plant.theta_N": 23.0, ...}; empty if unknown."""
        return flattened(self.summary.get('config') or {})

    def __getitem__(self, column: str) -> np.ndarray:
        return self.columns[column]

    def __len__(self) -> int:
        return len(self.columns['time_s'])

    def during(self, phase: str) -> dict[str, np.ndarray]:
        """The columns in one phase, as in run.during("brake"); of shape (0,) if the run did not come there. Raises ValueError
        for what is no phase."""
        if phase not in PHASES and phase not in self.columns['phase']:
            raise ValueError(f'"{phase}" is no phase; give one of {", ".join(PHASES)}')
        chosen = self.columns['phase'] == phase
        return {name: values[chosen] for name, values in self.columns.items()}

    def to_csv(self, path: PathLike) -> None:
        """Writes the rows as the program does, bit for bit."""
        rows = csv_bytes(self.columns)
        write_whole(path, lambda name: pathlib.Path(name).write_bytes(rows))

    def __repr__(self) -> str:
        controller = self.summary.get('controller', 'unknown controller')
        result = self.summary.get('result', 'no summary')
        stop = self.summary.get('stop_time_s')
        stopped = f', stopped in {stop:.3f} s' if stop is not None else ''
        return f'<abs_hil.Run {self.name or controller}: {result}, {len(self)} cycles{stopped}>'


class Series:
    """The runs of a series' folder: a sequence of Run, and `index`, the content of series.json."""

    def __init__(self, runs: list[Run], index: Mapping[str, Any], notes: list[str]) -> None:
        self.runs = runs
        self.index = dict(index)
        self.notes = notes

    def __len__(self) -> int:
        return len(self.runs)

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    def __getitem__(self, number: int) -> Run:
        return self.runs[number]

    @property
    def data(self) -> pandas.DataFrame:
        """One row a run: its name, the figures of the summary and the configuration values that differ."""
        import pandas
        configs = [run.config for run in self.runs]
        keys = sorted({key for config in configs for key in config})
        varied = [key for key in keys if len({str(config.get(key)) for config in configs}) > 1]
        return pandas.DataFrame([
            {'run': run.name, **{key: config.get(key) for key in varied},
             **{key: value for key, value in run.summary.items() if isinstance(value, (int, float, str, type(None)))}}
            for run, config in zip(self.runs, configs)])


def csv_bytes(columns: Mapping[str, np.ndarray], header: bool = True) -> bytes:
    """The columns as CSV: a number is the shortest text that reads back bit-exactly, an unknown one is NaN."""
    kept = [values.tolist() if values.dtype == object else np.ascontiguousarray(values, dtype=np.float64)
            for values in columns.values()]
    return (','.join(_quoted(name) for name in columns) + '\n').encode() * header + _core.csv_rows(kept)


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text


def phase_names(numbers: np.ndarray) -> np.ndarray:
    """Names of phases from their numbers."""
    return np.array(PHASES, dtype=object)[numbers.astype(np.intp)]


def stretches(flags: np.ndarray) -> list[tuple[int, int]]:
    """Rows [begin, end) of each stretch in which a flag stands."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist()))


def name_phases(columns: dict[str, Any]) -> None:
    """Makes arrays of names of what the core gives as numbers and lists."""
    columns['phase'] = phase_names(np.clip(columns['phase'], 0, len(PHASES) - 1))
    if 'phase_name' in columns:
        columns['phase_name'] = np.array(columns['phase_name'], dtype=object)


def names_apart(names: Iterable[str]) -> list[str]:
    """Each name once: the second "run" is "run (2)"."""
    apart: list[str] = []
    for name in names:
        own, number = name, 2
        while own in apart:
            own, number = f'{name} ({number})', number + 1
        apart.append(own)
    return apart


def flattened(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    """Nested tables by dotted key."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            flat.update(flattened(value, f'{prefix}{key}.'))
        else:
            flat[f'{prefix}{key}'] = value
    return flat


def read_csv(path: PathLike) -> tuple[dict[str, np.ndarray], tuple[str, ...], list[str]]:
    """(columns, signals, notes) of a run's CSV. ValueError, with file and line, for a file that is no run's."""
    rows = read_rows(path)
    notes = ['the last row of the CSV is incomplete, as after a crash, and is left out'] if rows.truncated else []
    return rows.columns, signals_of(list(rows.columns)), notes


def signals_of(columns: list[str]) -> tuple[str, ...]:
    """The controller's own signals: they follow the fixed columns and the phase's own name."""
    return tuple(itertools.takewhile(_core.is_signal_name, columns[len(COLUMNS) + ('phase_name' in columns):]))


def load(path: PathLike) -> Run:
    """Loads a run folder, a run's CSV file or an event log (.lcmlog), whole or cut off; `Run.notes` says what is missing.

    Raises ValueError for anything else, with the file, the place and the reason; so it does for a run folder whose files
    are no longer those of its SHA256SUMS.
    """
    place = pathlib.Path(path)
    if place.suffix == '.lcmlog':
        return _load_log(place)
    if not place.is_dir():
        columns, signals, notes = read_csv(place)
        return Run(columns, {}, signals, notes=notes, folder=place.parent, name=place.stem)
    _core.check_seal(os.fsencode(place))
    if not (place / 'run.csv').exists() and (place / 'run.lcmlog').exists():
        run = _load_log(place / 'run.lcmlog')
        run.notes.append('no run.csv: the rows are those of run.lcmlog')
        run.name = place.resolve().name
        return run
    if not (place / 'run.csv').exists():
        what = 'a series; load it with abs_hil.load_series' if (place / 'series.json').exists() else 'no run folder'
        raise ValueError(f'"{place}" is {what} (it has no run.csv)')
    columns, signals, notes = read_csv(place / 'run.csv')
    summary: dict[str, Any] = {}
    if (place / 'summary.json').exists():
        try:
            summary = read_object(place / 'summary.json')
        except ValueError as error:
            notes.append(f'summary.json is not used: {error}')
    else:
        notes.append('no summary.json: names, figures and configuration are unknown')
    return Run(columns, summary, signals, notes=notes, folder=place, name=place.resolve().name)


def read_text(path: pathlib.Path) -> str:
    """A small file beside the rows. Raises ValueError with file and reason."""
    try:
        if (size := path.stat().st_size) > MOST_BYTES:
            raise ValueError(f'{path}: {size} bytes are too many for this kind of file')
        return path.read_bytes().decode('utf-8', 'replace')
    except OSError as error:
        raise ValueError(f'cannot read "{path}": {error.strerror}') from None


def read_object(path: pathlib.Path) -> dict[str, Any]:
    """A JSON file that holds an object. Raises ValueError with file, line and reason."""
    text = read_text(path)
    try:
        data = parse_json(text)
    except ValueError as error:
        raise ValueError(f'{path}: not valid JSON: {_core.clean_text(str(error).encode())}') from None
    if not isinstance(data, dict):
        raise ValueError(f'{path}:1: the file must contain a JSON object')
    return data


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


def _load_log(path: pathlib.Path) -> Run:
    columns, signals, rows, experiment, unreadable, damage, lacks = _core.read_log(str(path))
    notes = [f'the rest of the log is not used: {damage}'] if damage else []
    if lacks:
        notes.append(f'{lacks}: another version of abs_hil recorded it')
    if unreadable:
        notes.append(f'{unreadable} messages of the log cannot be read and are left out')
    if rows == 0:
        raise ValueError(damage or f'"{path}" holds no telemetry of abs_hil'
                         + (', or another version of abs_hil recorded it' if unreadable else ''))
    check_times(columns['time_s'], lambda row: f'{path}: message {row + 1} of its telemetry')
    name_phases(columns)
    summary: dict[str, Any] = {}
    if experiment:
        names = ('experiment', 'controller', 'plant', 'backend')
        summary = {name: text.decode(errors='replace') for name, text in zip(names, experiment)}
        try:
            summary['config'] = parse_json(experiment[-1])
        except ValueError:
            notes.append('the configuration in the log is not valid JSON')
    notes.append('an event log has no figures of merit')
    return Run(columns, summary, tuple(signals), notes=notes, folder=path.parent, name=path.stem)
