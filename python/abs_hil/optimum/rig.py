"""The rig's equations (1), (2), (6), (7) as CasADi expressions, with the values of a plant of ours, and its road."""
import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self, TypeVar

import casadi as ca
import numpy as np

from ..core import _core
from ..simulation import keys

#: indices of the state: slip, speed of the lower wheel, brake torque, distance. With the slip in the place of the upper
#: wheel's speed the solver sees the fast motion at its own scale.
SLIP, OMEGA2, TORQUE, DISTANCE = range(4)
Number = TypeVar('Number', float, ca.SX)


@dataclass(frozen=True)
class Rig:
    """Both wheels in contact: the lower one turns forwards, the upper one turns forwards or stands. The brake is without dead
    time, curved map, hysteresis and fading, and friction does not fall with the sliding speed.

    values: of the plant.  brake_duty_max: the limit of gate and plant, which no command passes.
    """
    values: Mapping[str, Any]
    brake_duty_max: float = 1.0

    @classmethod
    def of(cls, **arguments: Any) -> Self:
        """The plant and the gate that these arguments of abs_hil.simulate give."""
        prefix, rows = 'plant.', keys(**arguments)
        return cls({name[len(prefix):]: row['value'] for name, row in rows.items() if name.startswith(prefix)},
                   float(min(rows[f'{part}.brake_duty_max']['value'] for part in ('gate', 'plant'))))

    def __getitem__(self, name: str) -> float:
        return float(self.values[name])

    @property
    def max_torque_Nm(self) -> float:
        """The largest static torque of the brake, b(1), or that of the largest duty."""
        return 0.0 if self.brake_duty_max < self['u0'] else max(0.0, self['b1_Nm'] * self.brake_duty_max + self['b2_Nm'])

    @property
    def rate_limit_Nm_s(self) -> float:
        """The fastest change of the brake torque; infinite without a limit."""
        return self['brake_rate_limit_Nm_s'] or math.inf

    def state(self, omega1_rad_s: float, omega2_rad_s: float) -> np.ndarray:
        """Where a braking begins: without a torque."""
        return np.array([1.0 - self['r1_m'] * omega1_rad_s / (self['r2_m'] * omega2_rad_s), omega2_rad_s, 0.0, 0.0])

    def omega1_rad_s(self, x: Any) -> Any:
        return (1.0 - x[SLIP]) * x[OMEGA2] * self['r2_m'] / self['r1_m']

    def _curve(self, slip: Any) -> Any:
        """The friction curve of the tyre model, without its scale; odd in the slip."""
        if self._magic:
            return ca.sin(self['C'] * ca.atan(self['B'] * slip))
        # In traction this curve's slip is that over the wheel's speed.
        pulled = ca.fmin(slip, 0.0)
        slip = ca.fmax(slip, 0.0) + pulled / (1.0 - pulled)
        # Powers need a base above 0; the curve is below 1e-11 at this floor.
        size = ca.sqrt(slip * slip + 1e-14)
        power = size ** self['mu_p']
        curve = (self['mu_w4'] * power / (self['mu_a'] + power)
                 + size * (self['mu_w1'] + size * (self['mu_w2'] + size * self['mu_w3'])))
        return slip / size * curve

    @functools.cached_property
    def _highest(self) -> float:
        """Maximum of the friction curve over [0, 1]; it may lie at the end."""
        return float(self._curve(ca.DM(np.linspace(0.0, 1.0, 2001) ** 2)).full().max())

    def force_N(self, x: Any, friction: Any) -> Any:
        """Tyre force while both wheels turn forwards."""
        mu = self._gripped(x[SLIP], friction)
        if self.values['load'] == 'constant':
            return mu
        pressed_Nm = self['lever_Mg_Nm'] + x[TORQUE] + self['M10_Nm'] + self['d1_Nms_rad'] * self.omega1_rad_s(x)
        return mu * pressed_Nm / self._arm_m(mu)

    def standing_force_N(self, friction: Any) -> Any:
        """Tyre force while the brake holds the upper wheel: it then passes on only the torque that turns the wheel."""
        mu = self._gripped(ca.DM(1.0), friction)
        if self.values['load'] == 'constant':
            return mu
        return mu * self['lever_Mg_Nm'] / (self._arm_m(mu) - self['r1_m'] * mu)

    def holds_Nm(self, friction: Any) -> Any:
        """The least brake torque that holds the upper wheel while the lower one turns."""
        return self['r1_m'] * self.standing_force_N(friction) - self['M10_Nm']

    def _gripped(self, slip: Any, friction: Any) -> Any:
        """The tyre's force under a constant load, N, or its friction coefficient under the lever."""
        peak = self['theta_N'] if self.values['load'] == 'constant' else self['mu_peak'] if self._magic else self._highest
        return peak * friction * (self._curve(slip) / (1.0 if self._magic else self._highest))

    def _arm_m(self, mu: Any) -> Any:
        """Of the lever: its arm less what friction takes of it."""
        phi = math.radians(self['lever_phi_deg'])
        return self['lever_L_m'] * (math.sin(phi) - mu * math.cos(phi))

    @property
    def _magic(self) -> bool:
        return bool(self.values['tyre'] == 'magic-formula')

    @property
    def limited(self) -> bool:
        return self.rate_limit_Nm_s < math.inf

    def torque_rate_Nm_s(self, x: Any, command_Nm: Any) -> Any:
        """The brake's answer to a commanded torque: the lag, limited to the brake's rate."""
        rate = self['c31_per_s'] * (command_Nm - x[TORQUE])
        if (release := self.values.get('brake_release_ratio', 1.0)) != 1.0:
            rate *= ca.if_else(command_Nm < x[TORQUE], release, 1.0)
        return ca.fmin(ca.fmax(rate, -self.rate_limit_Nm_s), self.rate_limit_Nm_s) if self.limited else rate

    def wheel_rates(self, x: Any, force_N: Any) -> tuple[Any, Any]:
        """omega1' and omega2' under a tyre force, rad/s^2."""
        upper = (self['r1_m'] * force_N - self['d1_Nms_rad'] * self.omega1_rad_s(x) - self['M10_Nm'] - x[TORQUE])
        lower = -self['r2_m'] * force_N - self['d2_Nms_rad'] * x[OMEGA2] - self['M20_Nm']
        return upper / self['J1_kg_m2'], lower / self['J2_kg_m2']

    def rates(self, x: Any, torque_rate_Nm_s: Any, friction: Any, stands: bool = False) -> Any:
        """Time derivative of the state. stands: the brake holds the upper wheel, so the slip stays 1."""
        upper, lower = self.wheel_rates(x, self.standing_force_N(friction) if stands else self.force_N(x, friction))
        slip_rate = 0.0 if stands else ((1.0 - x[SLIP]) * lower - self['r1_m'] / self['r2_m'] * upper) / x[OMEGA2]
        return ca.vertcat(slip_rate, lower, torque_rate_Nm_s, self['r2_m'] * x[OMEGA2])

    def rates_function(self, stands: bool = False) -> ca.Function:
        x, w, f = ca.SX.sym('x', 4), ca.SX.sym('w'), ca.SX.sym('f')
        return ca.Function('rates', [x, w, f], [self.rates(x, w, f, stands)])

    def force_function(self) -> ca.Function:
        x, f = ca.SX.sym('x', 4), ca.SX.sym('f')
        return ca.Function('force', [x, f], [self.force_N(x, f)])


@dataclass(frozen=True)
class Piece:
    """A piece of road on which the friction is `value` + `slope` (position - `begin`).

    along:  'time' or 'distance' since the start of braking: the unit of the position, s or m.
    end:    its last position; infinite for the piece on which the car stops.
    """
    value: float
    slope: float = 0.0
    begin: float = 0.0
    end: float = math.inf
    along: str = 'time'

    def friction(self, time_s: Number, distance_m: Number) -> Number | float:
        if self.slope == 0.0:
            return self.value
        return self.value + self.slope * ((time_s if self.along == 'time' else distance_m) - self.begin)


def road_of(rig: Rig) -> list[Piece]:
    """The pieces of the plant's friction profile. Braking begins at once, so both origins of a profile are the same."""
    if not (text := str(rig.values['friction_profile'])):
        return [Piece(1.0)]
    axis, _, parts = _core.profile_of(text, 'plant.friction_profile')
    ends = [begin for begin, _, _ in parts[1:]] + [math.inf]
    return [Piece(value, slope, begin, end, axis) for (begin, value, slope), end in zip(parts, ends)]
