"""Logs for identification: what was measured and what was sent, from run folders, event logs and plain CSV files."""
import hashlib
import pathlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.ndimage
import scipy.signal

from ..options import PathLike
from ..recording import CSV, kind_of, load, named
from ..rows import read_rows
from ..run import Run, stretches

NEEDED = ('time_s', 'upper_counts', 'lower_counts', 'brake_pwm', 'motor_pwm')
WANTED = {*NEEDED, 'phase', 'wheels_apart', 'phase_name', 'sample_valid', 'sample_time_s'}
LEAST_ROWS = 200
#: slower than this a log has no row in some window of the fit; its times are rather of another unit
LONGEST_PERIOD_S = 0.05
_COUNTS = ("whole counts of the encoder, not revolutions or radians; the cell is empty, or sample_valid 0, without a reading",
           lambda values: np.isnan(values) | (np.rint(values) == values) & (np.abs(values) < 2.0**63))
_DUTY = 'a duty from 0 to 1', lambda values: (values >= 0) & (values <= 1)
#: column -> what it holds, and which of its values are that
HOLDS: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    'time_s': ('a time in seconds', np.isfinite), 'upper_counts': _COUNTS, 'lower_counts': _COUNTS, 'brake_pwm': _DUTY,
    'motor_pwm': _DUTY, 'wheels_apart': ('0, or 1 where the wheels are apart', lambda values: (values == 0) | (values == 1))}
#: half the width of the local parabola that gives first speeds, s
HALF_WIDTH_S = 0.012
#: a wheel stands while its count stays the same for this long before and after, s
STANDS_S = 0.015
#: slower than this a log says little: of rolling, whose slip is stiff then and costs time, and of a free wheel
LEAST_ROLLING_RAD_S = 10.0
LEAST_FREE_RAD_S = 3.0
LEAST_SEGMENT_S = 0.2


@dataclass
class Log:
    """One log. Arrays have shape (rows,), those with two columns (rows, 2): upper wheel, lower wheel.

    counts: unwrapped, from 0 at the first row; NaN where there was no valid reading
    read_late_s: how much later than time_s each wheel was read (sample_time_s - time_s)
    first_counts: shape (2,), what the counters held where counts is 0
    experiment: its name; empty if the log does not say it
    brake_before: for a brake that acts late (brake_flaws.py), the duties that act until late_s after a row's time
    """
    name: str
    path: pathlib.Path
    sha256: str
    time_s: np.ndarray
    counts: np.ndarray
    brake_pwm: np.ndarray
    motor_pwm: np.ndarray
    wheels_apart: np.ndarray
    phase: np.ndarray
    read_late_s: np.ndarray
    notes: list[str] = field(default_factory=list)
    first_counts: np.ndarray = field(default_factory=lambda: np.zeros(2))
    experiment: str = ''
    brake_before: np.ndarray | None = None
    late_s: float = 0.0

    def __len__(self) -> int:
        return len(self.time_s)

    @cached_property
    def period_s(self) -> float:
        return float(np.median(np.diff(self.time_s)))

    def inputs(self) -> dict[str, np.ndarray]:
        inputs = {'time_s': self.time_s, 'brake_pwm': self.brake_pwm, 'motor_pwm': self.motor_pwm,
                  'wheels_apart': self.wheels_apart}
        late = {} if self.brake_before is None else {'brake_before': self.brake_before, 'motor_before': self.motor_pwm}
        return inputs | late


def load_log(path: PathLike | Run) -> Log:
    """Reads a Run, what abs_hil.load takes, or any CSV file, gzip or not, with the columns time_s, upper_counts,
    lower_counts, brake_pwm, motor_pwm and, if they are there, phase and wheels_apart. Row n holds the counts at time_s
    and the duties (0 to 1, as sent) from then on.

    Raises ValueError for a file that cannot serve, with its name and the reason; what is cut off is left out and noted.
    """
    if isinstance(path, Run):
        experiment = str(path.summary.get('experiment') or '')
        content = b''.join(np.ascontiguousarray(path.columns[name]).tobytes() for name in NEEDED if name in path.columns)
        return _log(pathlib.Path(path.folder or experiment or 'run'), path.columns, list(path.notes), content, experiment)
    place, _ = named(path)
    if kind_of(place) == CSV:
        rows = read_rows(place, (), WANTED)
        run = Run(rows.columns, notes=[f'the last row of "{place}" is incomplete and is left out'] * rows.truncated + rows.notes)
    else:
        run = load(path)
    if 'upper_counts' not in run.columns and (place / 'run.lcmlog').exists():
        run.columns = load(place / 'run.lcmlog').columns
    content = next((file.read_bytes() for file in (place, place / 'run.csv', place / 'run.lcmlog') if file.is_file()), b'')
    try:
        return _log(pathlib.Path(path), run.columns, run.notes, content, str(run.summary.get('experiment') or ''))
    except ValueError as error:
        raise ValueError(f'"{place}": {error}') from None


def _log(place: pathlib.Path, columns: dict[str, np.ndarray], notes: list[str], content: bytes, experiment: str) -> Log:
    if missing := [name for name in NEEDED if name not in columns]:
        raise ValueError(f'the log lacks the columns {", ".join(missing)}; needed are {", ".join(NEEDED)}')
    if (rows := len(columns['time_s'])) < LEAST_ROWS:
        raise ValueError(f'the log has {rows} rows; give at least {LEAST_ROWS}')
    numbers = {'wheels_apart': np.zeros(rows), 'sample_valid': np.ones(rows)}
    for name in ('sample_valid', *HOLDS):
        if name in columns:
            try:
                numbers[name] = np.asarray(columns[name], dtype=np.float64)
            except (TypeError, ValueError):
                raise ValueError(f'the column {name} holds texts; give numbers') from None
    unread = numbers['sample_valid'] == 0
    for name, (what, are) in HOLDS.items():
        if not (fit := are(numbers[name]) | (unread if what is _COUNTS[0] else False)).all():
            raise ValueError(f'{name} is {numbers[name][row := int(np.argmin(fit))]:.9g} in row {row + 1}; give {what}')
    time_s = numbers['time_s']
    if not (np.diff(time_s) > 0).all():
        row = int(np.argmin(np.diff(time_s))) + 1
        raise ValueError(f'time_s does not rise at row {row + 1}: {time_s[row - 1]:g} s, then {time_s[row]:g} s')
    if (period := np.median(np.diff(time_s))) > LONGEST_PERIOD_S:
        raise ValueError(f'time_s rises by {period:g} from row to row; give seconds (are these milliseconds?), and rows at '
                         f'most {LONGEST_PERIOD_S} s apart')
    counts = np.stack([numbers['upper_counts'], numbers['lower_counts']], axis=1)
    counts[unread] = np.nan
    late = np.nan_to_num(np.asarray(columns.get('sample_time_s', time_s), dtype=float) - time_s)[:, None].repeat(2, axis=1)
    first_counts = np.array([counts[np.isfinite(counts[:, wheel]), wheel][:1].sum() for wheel in range(2)])
    counts = np.stack([_unwrapped(counts[:, wheel]) for wheel in range(2)], axis=1)
    for wheel, name in enumerate(('upper_counts', 'lower_counts')):
        if np.nanmin(counts[:, wheel]) == np.nanmax(counts[:, wheel]):
            raise ValueError(f'{name} never changes: the wheel stood, or its encoder is not connected')
    phase = np.asarray(columns.get('phase_name', columns.get('phase', np.full(len(time_s), ''))), dtype=object)
    name = place.resolve().name.removesuffix('.gz').removesuffix('.csv').removesuffix('.lcmlog')
    return Log(name, place, hashlib.sha256(content).hexdigest(), time_s, counts, numbers['brake_pwm'],
               numbers['motor_pwm'], numbers['wheels_apart'], phase, late, notes, first_counts, experiment)


def _unwrapped(counts: np.ndarray) -> np.ndarray:
    """Counts of a 32-bit register as ever rising or falling ones, from 0."""
    known = np.isfinite(counts)
    if known.sum() < LEAST_ROWS:
        raise ValueError(f'only {int(known.sum())} readings of a wheel are valid; give at least {LEAST_ROWS}')
    out = np.full(len(counts), np.nan)
    out[known] = np.unwrap(counts[known] - counts[known][0], period=2.0**32)
    return out


# ---- what follows from the counts alone

@dataclass
class Motion:
    """Angles, speeds and what the counts weigh, by local parabolas. Shapes (rows, 2).

    angle_rad: of the count's middle, at time_s; NaN where there is no reading
    """
    angle_rad: np.ndarray
    smooth_rad: np.ndarray
    speed_rad_s: np.ndarray
    weight: np.ndarray
    stands: np.ndarray


def motion_of(log: Log, counts_per_rev: int) -> Motion:
    width = 2 * max(2, round(HALF_WIDTH_S / log.period_s)) + 1
    around = 2 * max(1, round(STANDS_S / log.period_s)) + 1
    grid = np.linspace(log.time_s[0], log.time_s[-1], len(log))
    delta = (grid[-1] - grid[0]) / (len(log) - 1)
    columns = []
    for counts, late_s in zip(log.counts.T, log.read_late_s.T):
        known = np.isfinite(counts)
        filled = np.interp(log.time_s, log.time_s[known], counts[known] + 0.5) * (2 * np.pi / counts_per_rev)
        even = np.interp(grid, log.time_s, filled)
        smooth, speed = (np.interp(log.time_s, grid, scipy.signal.savgol_filter(even, width, 2, deriv=order, delta=delta))
                         for order in (0, 1))
        stands = scipy.ndimage.maximum_filter1d(filled, around) == scipy.ndimage.minimum_filter1d(filled, around)
        columns.append((np.where(known, filled, np.nan) - late_s * speed, smooth, speed,
                        np.where(known, _weights(np.where(known, counts, -1e18)), 0.0), stands))
    return Motion(*(np.stack(column, axis=1) for column in zip(*columns)))


def _weights(counts: np.ndarray) -> np.ndarray:
    """Rows that share a count weigh as one: a slow wheel repeats what is known already."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(counts) != 0]))
    lengths = np.diff(np.concatenate([starts, [len(counts)]]))
    return np.repeat(1.0 / lengths, lengths)


def segments_of(log: Log, motion: Motion) -> list[tuple[int, int]]:
    """Rows [begin, end) in which something turns: without rest, gaps in time, or a change from touching to apart."""
    upper, lower = motion.speed_rad_s[:, 0], motion.speed_rad_s[:, 1]
    moves = np.where(log.wheels_apart != 0, np.maximum(upper, lower) > LEAST_FREE_RAD_S, lower > LEAST_ROLLING_RAD_S)
    moves &= ~_being_parted(log)
    breaks = np.flatnonzero((np.diff(log.wheels_apart) != 0) | (np.diff(log.time_s) > 5 * log.period_s)) + 1
    segments = [(begin + a, begin + b) for begin, end in zip([0, *breaks], [*breaks, len(log)])
                for a, b in stretches(moves[begin:end])]
    return [(a, b) for a, b in segments if log.time_s[b - 1] - log.time_s[a] >= LEAST_SEGMENT_S]


def _being_parted(log: Log) -> np.ndarray:
    """The phase in which a person lifts the upper wheel, or lowers it: when in that phase, the log cannot tell. It is the
    first one with the wheels apart, without a duty, if another phase with the wheels apart follows."""
    out = np.zeros(len(log), dtype=bool)
    for begin, end in stretches(log.wheels_apart != 0.0):
        same = log.phase[begin:end] == log.phase[begin]
        if same.all():
            continue
        length = int(np.argmin(same))
        if not (log.brake_pwm[begin:begin + length].any() or log.motor_pwm[begin:begin + length].any()):
            out[begin:begin + length] = True
    return out
