"""Coarse traces of wheel speeds, from a screen, a paper's figure or another data logger, and how they were read.

A reading of a wheel's speed at the time t is the mean over a window T that ended an age a before, so with the angle th (rad)

    speed = (th(t - a) - th(t - a - T)) / T              rad/s; without a window its derivative
    slip  = 1 - k r1 dth1 / (r2 dth2)                    with both changes over such a window, and a scale k of its own

Speeds and slip may have ages of their own: an age that is not told is found as a dead time of the brake.
"""
import hashlib
import pathlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ..options import PathLike
from ..rows import read_rows

#: columns of wheel speeds: name behind "upper_" or "lower_" -> rad/s; 0: m/s at the rim
UNITS = {'rad_s': 1.0, 'rpm': 2 * np.pi / 60, 'm_s': 0.0}
LEAST_READINGS = 30
#: of rolling wheels, for a scale, and how long before the brake they end
LEAST_ROLLING = 10
BEFORE_S = 0.02


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
    """A file's readings and what acted: `duty_time_s`, `brake_pwm`, `motor_pwm` (changes,), each from its time on. keys: how it
    was read (parsers.READINGS). scales: of slip and lower wheel, as readings before the brake tell: there both rims have one
    speed."""
    name: str
    path: pathlib.Path
    sha256: str
    keys: dict[str, float]
    begin_s: float
    end_s: float
    channels: list[Channel] = field(default_factory=list)
    scales: dict[str, float] = field(default_factory=dict)
    duty_time_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    brake_pwm: np.ndarray = field(default_factory=lambda: np.zeros(0))
    motor_pwm: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def edge_fitted(self) -> bool:
        """Whether the instant at which the brake began is to be fitted."""
        return 'brake_from_s' in self.keys


def load_trace(path: PathLike, keys: Mapping[str, float]) -> Trace:
    """Reads a CSV file with time_s and some of upper_*, lower_* (rpm, rad_s, m_s at the rim), slip, brake_pwm, motor_pwm; or,
    with a row for each reading, wheel (upper or lower), time_s and rim_speed_m_s. Comments (#) may stand at its beginning.

    Raises ValueError for a file that cannot serve, with its name and the reason."""
    place = pathlib.Path(path)
    columns = read_rows(place, ()).columns
    try:
        return _trace(place, hashlib.sha256(place.read_bytes()).hexdigest(), columns, keys)
    except ValueError as error:
        raise ValueError(f'"{place}": {error}') from None


def _checked(columns: Mapping[str, np.ndarray], name: str, are: Callable[[np.ndarray], np.ndarray], give: str) -> np.ndarray:
    if not (fine := are(columns[name])).all():
        raise ValueError(f'{name} is {columns[name][row := int(np.argmin(fine))]:g} in row {row + 1}; give {give}')
    return columns[name]


def _trace(place: pathlib.Path, sha256: str, columns: Mapping[str, np.ndarray], keys: Mapping[str, float]) -> Trace:
    if 'time_s' not in columns:
        raise ValueError(f'the file lacks the column time_s; it has {", ".join(columns)}')
    time_s = _checked(columns, 'time_s', np.isfinite, 'seconds')
    out = Trace(place.stem, place, sha256, dict(keys), keys.get('from_s', float(time_s.min())),
                keys.get('to_s', float(time_s.max())))

    def take(kind: str, name: str, where: np.ndarray | bool, factor: float) -> None:
        values = columns[name]
        rows = where & np.isfinite(values)
        rolls = rows & (time_s < keys.get('brake_from_s', -np.inf) - BEFORE_S)
        if kind == 'slip' and rolls.sum() >= LEAST_ROLLING:
            out.scales[kind] = 1.0 - float(np.mean(values[rolls]))
        rows = np.flatnonzero(rows & (time_s >= out.begin_s) & (time_s <= out.end_s))
        rows = rows[np.argsort(time_s[rows], kind='stable')]
        steps = np.diff(np.unique(values[rows]))
        step = keys.get('slip_resolution' if kind == 'slip' else 'speed_resolution', float(steps.min()) if steps.size else 0.0)
        scale = factor or 1.0
        out.channels.extend([Channel(kind, time_s[rows], scale * values[rows], scale * step, factor == 0.0)] * bool(rows.size))
    for kind in ('upper', 'lower'):
        if {'wheel', 'rim_speed_m_s'} <= {*columns}:
            take(kind, 'rim_speed_m_s', columns['wheel'] == kind, 0.0)
        for unit, factor in UNITS.items():
            if f'{kind}_{unit}' in columns:
                take(kind, f'{kind}_{unit}', True, factor)
    for name in [name for name in ('slip', 'slip_recorded') if name in columns]:
        take('slip', name, True, 1.0)
    readings = sum(len(one.value) for one in out.channels)
    if readings < LEAST_READINGS or all(one.kind == 'slip' for one in out.channels):
        raise ValueError(f'it has {readings} readings of speeds or slip from {out.begin_s:g} to {out.end_s:g} s; give at least '
                         f"{LEAST_READINGS}, and one wheel's speed (columns upper_rpm, lower_m_s, slip and so on)")
    out.duty_time_s, out.brake_pwm, out.motor_pwm = _duties(columns, time_s, out)
    return out


def _duties(columns: Mapping[str, np.ndarray], time_s: np.ndarray, trace: Trace) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times and duties of brake and motor: as they stand in the file, or as the keys say how they came about."""
    keys, begins = trace.keys, trace.keys.get('brake_from_s', -np.inf)
    ways = ['the column brake_pwm'] * ('brake_pwm' in columns) + [key for key in ('relay_below', 'brake_duty') if key in keys]
    if len(ways) != 1:
        raise ValueError(f'the brake\'s duty is told by {" and ".join(ways) or "nothing"}; give one of: the column brake_pwm, '
                         '--reading relay_below=SLIP, --reading brake_duty=DUTY')
    brake, motor = (_checked(columns, name, lambda values: (values >= 0.0) & (values <= 1.0), 'a duty from 0 to 1')
                    if name in columns else np.zeros(len(time_s)) for name in ('brake_pwm', 'motor_pwm'))
    if 'brake_pwm' in columns:
        return time_s, brake, motor
    if 'brake_duty' in keys:
        if not np.isfinite(begins):
            raise ValueError('brake_duty needs to know when it began; give --reading brake_from_s=TIME')
        return np.array([begins]), np.array([keys['brake_duty']]), np.zeros(1)
    if (slip := next((one for one in trace.channels if one.kind == 'slip'), None)) is None:
        raise ValueError('relay_below needs the slip as it was read; give a column slip')
    brakes = (slip.value < keys['relay_below']) & (slip.time_s >= begins - 1e-9)
    return slip.time_s, brakes.astype(float), np.interp(slip.time_s, time_s, motor)
