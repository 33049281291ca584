"""Coarse traces of wheel speeds, from a screen, a paper's figure or another data logger, and how they were read.

A reading of a wheel's speed at the time t is the mean over a window T that ended an age a before, so with the angle th (rad)

    speed = (th(t - a) - th(t - a - T)) / T              rad/s; without a window its derivative
    slip  = 1 - k r1 dth1 / (r2 dth2)                    with both changes over such a window, and a scale k of its own

Speeds and slip may have ages of their own: an age that is not told is found as a dead time of the brake.
"""
import hashlib
import pathlib
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ..options import PathLike

#: columns of wheel speeds: name behind "upper_" or "lower_" -> rad/s, or m/s at the rim
UNITS = {'rad_s': 1.0, 'rpm': 2 * np.pi / 60, 'm_s': 0.0}
LEAST_READINGS = 30
#: of rolling wheels, for a scale, and how long before the brake they end
LEAST_ROLLING = 10
BEFORE_S = 0.02


@dataclass(frozen=True)
class Key:
    """What may be told of a file's readings: its unit, range and meaning."""
    unit: str
    least: float
    most: float
    what: str


KEYS = {
    'from_s': Key('s', -np.inf, np.inf, 'first time that is used: both wheels roll on each other [the first row]'),
    'to_s': Key('s', -np.inf, np.inf, 'last time that is used [the last row]'),
    'window_s': Key('s', 0.0, 0.2, 'a reading is the mean over so long [0]'),
    'speed_age_s': Key('s', 0.0, 0.2, 'the window of a speed ended so long before its time [0]'),
    'slip_age_s': Key('s', 0.0, 0.2, 'the window of a slip ended so long before its time [0]'),
    'speed_resolution': Key("of the file's speeds", 0.0, np.inf, 'a speed is given in steps of this [the least step]'),
    'slip_resolution': Key('1', 0.0, 1.0, 'a slip is given in steps of this [the least step]'),
    'relay_below': Key('1', 0.0, 1.0, "the brake's duty was 1 while the slip as read was below this, else 0"),
    'brake_duty': Key('1', 0.0, 1.0, "the brake's duty from brake_from_s on"),
    'brake_from_s': Key('s', -np.inf, np.inf, 'the brake began about then: the instant is fitted, within 0.02 s'),
}


@dataclass
class Channel:
    """Readings of `upper` or `lower` (rad/s, or m/s at the rim) or `slip`: shapes (readings,)."""
    kind: str
    time_s: np.ndarray
    value: np.ndarray
    resolution: float
    at_rim: bool = False


@dataclass
class Trace:
    """A file's readings and what acted: `duty_time_s`, `brake_pwm`, `motor_pwm` (changes,), each from its time on. first_edge_s:
    the instant at which the brake began, if that is to be fitted, nan otherwise. scales: of slip and lower wheel, as readings
    before that tell: there both rims have one speed."""
    name: str
    path: pathlib.Path
    sha256: str
    channels: list[Channel]
    duty_time_s: np.ndarray
    brake_pwm: np.ndarray
    motor_pwm: np.ndarray
    keys: dict[str, float]
    begin_s: float
    end_s: float
    first_edge_s: float
    scales: dict[str, float] = field(default_factory=dict)

    @property
    def applications(self) -> int:
        """How many times the brake took hold."""
        return int(np.sum(np.diff(self.brake_pwm, prepend=0.0) > 0.0))


def checked_key(text: str) -> tuple[str, float]:
    """KEY=VALUE of --reading."""
    key, _, number = text.partition('=')
    if key not in KEYS:
        raise ValueError(f'--reading {text}: no such key; give one of {", ".join(KEYS)}')
    one = KEYS[key]
    try:
        value = float(number)
    except ValueError:
        raise ValueError(f'--reading {text}: "{number}" is no number') from None
    if not one.least <= value <= one.most:
        raise ValueError(f'--reading {text} is not valid; give a number from {one.least:g} to {one.most:g} ({one.unit}): '
                         f'{one.what}')
    return key, value


def load_trace(path: PathLike, keys: Mapping[str, float]) -> Trace:
    """Reads a CSV file with time_s and some of upper_*, lower_* (rpm, rad_s, m_s at the rim), slip, brake_pwm, motor_pwm; or,
    with a row for each reading, wheel (upper or lower), time_s and rim_speed_m_s. Lines that begin with # are comments.

    Raises ValueError for a file that cannot serve, with its name and the reason."""
    import pandas
    place = pathlib.Path(path)
    try:
        content = place.read_bytes()
        frame = pandas.read_csv(place, comment='#', skipinitialspace=True)
    except OSError as error:
        raise ValueError(f'cannot read "{place}": {error.strerror}') from None
    except Exception as error:  # pandas raises many kinds
        raise ValueError(f'"{place}" is no CSV file of speeds: {error}') from None
    frame.columns = [str(name).strip() for name in frame.columns]
    try:
        return _trace(place, hashlib.sha256(content).hexdigest(), {name: frame[name].to_numpy() for name in frame.columns}, keys)
    except ValueError as error:
        raise ValueError(f'"{place}": {error}') from None


def _numbers(columns: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    try:
        return np.asarray(columns[name], dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f'the column {name} holds texts; give numbers') from None


def _trace(place: pathlib.Path, sha256: str, columns: Mapping[str, np.ndarray], keys: Mapping[str, float]) -> Trace:
    if 'time_s' not in columns:
        raise ValueError(f'the file lacks the column time_s; it has {", ".join(columns)}')
    time_s = _numbers(columns, 'time_s')
    if not np.isfinite(time_s).all():
        raise ValueError(f'time_s is {time_s[row := int(np.argmin(np.isfinite(time_s)))]} in row {row + 1}; give seconds')
    begin, end = keys.get('from_s', float(time_s.min())), keys.get('to_s', float(time_s.max()))
    channels, scales = [], {}

    def take(kind: str, values: np.ndarray, rows: np.ndarray, resolution: str, at_rim: bool, factor: float = 1.0) -> None:
        rows = rows & np.isfinite(values)
        rolls = rows & (time_s < keys.get('brake_from_s', -np.inf) - BEFORE_S)
        if kind == 'slip' and rolls.sum() >= LEAST_ROLLING:
            scales[kind] = 1.0 - float(np.mean(values[rolls]))
        rows &= (time_s >= begin) & (time_s <= end)
        if not rows.any():
            return
        order = np.argsort(time_s[rows], kind='stable')
        value = values[rows][order]
        steps = np.diff(np.unique(value))
        step = keys.get(resolution, float(steps.min(initial=np.inf)) if steps.size else 0.0)
        channels.append(Channel(kind, time_s[rows][order], factor * value, factor * step, at_rim))
    every = np.ones(len(time_s), dtype=bool)
    if 'wheel' in columns:
        for kind in ('upper', 'lower'):
            take(kind, _numbers(columns, 'rim_speed_m_s'), columns['wheel'] == kind, 'speed_resolution', True)
    for kind in ('upper', 'lower'):
        for unit, factor in UNITS.items():
            if f'{kind}_{unit}' in columns:
                take(kind, _numbers(columns, f'{kind}_{unit}'), every, 'speed_resolution', factor == 0.0, factor or 1.0)
    for name in ('slip', 'slip_recorded'):
        if name in columns:
            take('slip', _numbers(columns, name), every, 'slip_resolution', False)
    readings = sum(len(one.value) for one in channels)
    if readings < LEAST_READINGS or all(one.kind == 'slip' for one in channels):
        raise ValueError(f'it has {readings} readings of speeds or slip from {begin:g} to {end:g} s; give at least '
                         f"{LEAST_READINGS}, and one wheel's speed (columns upper_rpm, lower_m_s, slip and so on)")
    return Trace(place.stem, place, sha256, channels, *_duties(columns, time_s, channels, keys), dict(keys), begin, end,
                 keys.get('brake_from_s', np.nan), scales)


def _duties(columns: Mapping[str, np.ndarray], time_s: np.ndarray, channels: list[Channel],
            keys: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times and duties of brake and motor: as they stand in the file, or as the keys say how they came about."""
    ways = [name for name, there in (('the column brake_pwm', 'brake_pwm' in columns), ('relay_below', 'relay_below' in keys),
                                     ('brake_duty', 'brake_duty' in keys)) if there]
    if len(ways) != 1:
        raise ValueError(f'the brake\'s duty is told by {" and ".join(ways) or "nothing"}; give one of: the column brake_pwm, '
                         '--reading relay_below=SLIP, --reading brake_duty=DUTY')
    motor = _numbers(columns, 'motor_pwm') if 'motor_pwm' in columns else np.zeros(len(time_s))
    begins = keys.get('brake_from_s', -np.inf)
    if 'brake_pwm' in columns:
        duty = _numbers(columns, 'brake_pwm')
        for name, values in (('brake_pwm', duty), ('motor_pwm', motor)):
            if not (fine := (values >= 0.0) & (values <= 1.0)).all():
                row = int(np.argmin(fine))
                raise ValueError(f'{name} is {values[row]:g} in row {row + 1}; give a duty from 0 to 1')
        return time_s, duty, motor
    if 'brake_duty' in keys:
        if not np.isfinite(begins):
            raise ValueError('brake_duty needs to know when it began; give --reading brake_from_s=TIME')
        return np.array([begins]), np.array([keys['brake_duty']]), np.zeros(1)
    slip = next((one for one in channels if one.kind == 'slip'), None)
    if slip is None:
        raise ValueError('relay_below needs the slip as it was read; give a column slip')
    brakes = (slip.value < keys['relay_below']) & (slip.time_s >= begins - 1e-9)
    return slip.time_s, brakes.astype(float), np.interp(slip.time_s, time_s, motor)
