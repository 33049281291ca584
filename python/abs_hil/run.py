"""A run's rows, summary and signals, from the simulator or from files."""
import pathlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from . import files
from .core import _core
from .files import parse_json, write_whole
from .messages import PHASES, QUANTITIES
from .options import PathLike
from .rows import TEXTS

if TYPE_CHECKING:
    import pandas

#: columns of every run's CSV, in order
COLUMNS = tuple(name for name, row in QUANTITIES.items() if row['csv_column'] is not None)

#: quantities that are whole numbers
_WHOLE = frozenset(name for name, row in QUANTITIES.items() if row['type'] in ('integer', 'boolean'))


@dataclass
class Event:
    """A line of a run folder's events.csv, or an event of a log. message: what the log says to people."""
    time_s: float
    event: str
    phase: str
    reason: str = ''
    value: str = ''
    name: str = ''  # the experiment's own name of the phase; empty in files of older versions
    message: str = ''

    @property
    def unusual(self) -> bool:
        """True for an event that is neither a change of phase nor the regular end."""
        return self.event != 'phase' and not (self.event == 'limit' and self.phase == 'stopped')

    @property
    def text(self) -> str:
        return self.message or f'{self.name or self.phase}: {self.reason}'


@dataclass(eq=False, repr=False)
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
    events:  of a log or a converted file, in the order of time. start_ns: Unix time of its time 0; 0 if unknown.
    losses:  what its recording lacks, as sentences with numbers. attachments: files in a converted file, by name.
    truncated: the last row of its CSV was incomplete.
    """

    columns: dict[str, np.ndarray]
    summary: dict[str, Any] = field(default_factory=dict)
    signals: tuple[str, ...] = ()
    notes: list[str] = field(default_factory=list)
    config_toml: str = ''
    folder: pathlib.Path | None = None
    name: str = ''
    events: list[Event] = field(default_factory=list)
    start_ns: int = 0
    losses: list[str] = field(default_factory=list)
    attachments: dict[str, bytes] = field(default_factory=dict)
    truncated: bool = False

    @property
    def data(self) -> 'pandas.DataFrame':
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


@dataclass(eq=False, repr=False)
class Series:
    """The runs of a series' folder: a sequence of Run, and `index`, the content of series.json."""
    runs: list[Run]
    index: dict[str, Any]
    notes: list[str]

    def __len__(self) -> int:
        return len(self.runs)

    def __iter__(self) -> Iterator[Run]:
        return iter(self.runs)

    def __getitem__(self, number: int) -> Run:
        return self.runs[number]

    @property
    def data(self) -> 'pandas.DataFrame':
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
    """The columns as CSV: a number is the shortest text that reads back bit-exactly, an unknown one is NaN. Quantities that
    are whole numbers, and arrays of such, stay whole."""
    kept = [values.tolist() if values.dtype == object else
            np.ascontiguousarray(values, np.int64 if values.dtype.kind == 'i' or (name in _WHOLE and np.isfinite(values).all())
                                 else np.float64) for name, values in columns.items()]
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


def names_apart(names: Iterable[str], again: str = '{} ({})') -> list[str]:
    """Each name once: the second "run" is "run (2)"."""
    apart: list[str] = []
    for name in names:
        own, number = name, 2
        while own in apart:
            own, number = again.format(name, number), number + 1
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


def signals_of(columns: Iterable[str]) -> tuple[str, ...]:
    """The controller's own signals among the columns."""
    return tuple(name for name in columns if _core.is_signal_name(name) and name not in TEXTS)


def read_text(path: pathlib.Path) -> str:
    """A small file beside the rows. Raises ValueError with file and reason."""
    try:
        return files.read_text(path, 'replace')
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
