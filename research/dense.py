"""A certificate for even roads: the shortest braking by a dynamic programme over slip, speed and brake torque.

It shares with the collocation of abs_hil.optimum neither the method nor the tyre: every force is one of the plant in C++, the
standing wheel's too. It compares all commands at each point of a grid, so that it has no local optima.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline

from abs_hil.core import _core
from abs_hil.optimum.rig import Rig
from abs_hil.options import PathLike, Value, options

#: steps of the integration: parts of the time constant of the slip
STEP_SHARE = 0.7
#: least part of a step that ends where the wheel comes to stand, s
LEAST_STEP_S = 2e-5
#: a layer is reached within this part of its distance; what is left is a straight line
REACHED = 2e-3
#: commands that the drive down the layers compares
COMMANDS_DRIVEN = 33


@dataclass(frozen=True)
class Grid:
    """Points of slip and torque, largest distance of two layers of the lower wheel's speed (and its part of the speed),
    commands. Slips are dense at 0, as their squares."""
    slips: int = 80
    torques: int = 30
    layer_rad_s: float = 1.0
    layer_share: float = 0.05
    commands: int = 3


@dataclass(frozen=True)
class Certificate:
    """Of a braking that starts without slip and torque.

    value_m:  distance from the programme's value. driven_m: of the braking that follows it, which is a real one.
    """
    value_m: float
    driven_m: float


class Field:
    """Motion of many states at once on an even road; u is the commanded torque.

    friction: a factor of the tyre's force, other than 1 under a constant load alone.
    """

    def __init__(self, plant: PathLike, set: Mapping[str, Value] | None, friction: float = 1.0) -> None:
        self.rig, self._friction = Rig.of(plant=plant, set=set), friction
        if self.rig.values['friction_profile']:
            raise ValueError('the dense programme is for even roads; leave plant.friction_profile out')
        if friction != 1.0 and self.rig.values['load'] != 'constant':
            raise ValueError(f'plant.load is {self.rig.values["load"]}; a friction other than 1 needs constant')
        self._base = _core.PlantOptions(options(plant=plant, set=set))
        slips = np.linspace(0.0, 0.999, 4000)
        speed = np.full_like(slips, 100.0)
        force = self._force_N(slips, speed, np.full_like(slips, self.rig.max_torque_Nm))
        rig = self.rig
        self.steepest = float(np.max(np.diff(force) / np.diff(slips))) * (
            rig['r1_m'] ** 2 / rig['J1_kg_m2'] + rig['r2_m'] ** 2 / rig['J2_kg_m2']) / rig['r2_m']

    def _force_N(self, slip: np.ndarray, speed: np.ndarray, torque: np.ndarray) -> np.ndarray:
        upper = np.where(slip >= 1.0, 0.0, (1.0 - slip) * speed * self.rig['r2_m'] / self.rig['r1_m'])
        return np.asarray(self._friction * _core.tyre_forces_N(self._base, [], upper, speed, torque))

    def rates(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Of slip, speed of the lower wheel, torque and distance."""
        rig, (slip, speed, torque, _) = self.rig, x
        force = self._force_N(slip, speed, torque)
        upper_rad_s = (1.0 - slip) * speed * rig['r2_m'] / rig['r1_m']
        lower = -(rig['r2_m'] * force + rig['d2_Nms_rad'] * speed + rig['M20_Nm']) / rig['J2_kg_m2']
        upper = (rig['r1_m'] * force - rig['d1_Nms_rad'] * upper_rad_s - rig['M10_Nm'] - torque) / rig['J1_kg_m2']
        upper = np.where((slip >= 1.0) & (upper < 0.0), 0.0, upper)  # the brake holds the wheel
        pulled = np.clip(rig['c31_per_s'] * (u - torque), -rig.rate_limit_Nm_s, rig.rate_limit_Nm_s)
        return np.stack([((1.0 - slip) * lower - rig['r1_m'] / rig['r2_m'] * upper) / speed, lower, pulled,
                         rig['r2_m'] * speed])

    def descend(self, to_rad_s: float, from_rad_s: float, slip: np.ndarray, torque: np.ndarray,
                u: np.ndarray) -> np.ndarray:
        """The states at which the lower wheel has slowed down to a speed, with the distance that it took."""
        x = np.stack([slip, np.full_like(slip, from_rad_s), torque, np.zeros_like(slip)])
        longest_s = STEP_SHARE * to_rad_s / self.steepest
        going = np.arange(slip.size)
        while going.size:
            at, command = x[:, going], u[going]
            k1 = self.rates(at, command)
            h = np.clip((to_rad_s - at[1]) / k1[1], -longest_s, longest_s)
            to_stand = np.maximum((1.0 - at[0]) / np.maximum(k1[0], 1e-9), LEAST_STEP_S)
            h = np.where((at[0] < 1.0) & (k1[0] > 0.0), np.minimum(h, to_stand), h)
            k2 = self.rates(on_road(at + 0.5 * h * k1), command)
            k3 = self.rates(on_road(at + 0.5 * h * k2), command)
            k4 = self.rates(on_road(at + h * k3), command)
            x[:, going] = on_road(at + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4))
            going = going[np.abs(x[1, going] - to_rad_s) > REACHED * (from_rad_s - to_rad_s)]
        k1 = self.rates(x, u)
        return on_road(x + (to_rad_s - x[1]) / k1[1] * k1)


def on_road(x: np.ndarray) -> np.ndarray:
    """States whose slip lies between that of a wheel that rolls and that of one that stands."""
    x[0] = np.clip(x[0], 0.0, 1.0)
    return x


def certify(plant: PathLike = 'paper-table1', set: Mapping[str, Value] | None = None, *, start_speed_rad_s: float = 170.0,
            end_speed_m_s: float = 0.3, grid: Grid | None = None) -> Certificate:
    """The shortest braking of a plant on its even road, from wheels that roll."""
    grid, field = grid or Grid(), Field(plant, set)
    most = field.rig.max_torque_Nm
    roots, torques = np.linspace(0.0, 1.0, grid.slips), np.linspace(0.0, most, grid.torques)
    layers = [end_speed_m_s / field.rig['r2_m']]
    while layers[-1] < start_speed_rad_s:
        layers.append(layers[-1] + min(grid.layer_rad_s, grid.layer_share * layers[-1]))
    speeds = layers[0] + (np.array(layers) - layers[0]) * (start_speed_rad_s - layers[0]) / (layers[-1] - layers[0])
    slip, torque, u = (a.ravel() for a in np.meshgrid(roots ** 2, torques, np.linspace(0.0, most, grid.commands), indexing='ij'))
    value = np.zeros((grid.slips, grid.torques))
    values = []
    for low, high in zip(speeds, speeds[1:]):
        values.append(RectBivariateSpline(roots, torques, value))
        end = field.descend(low, high, slip, torque, u)
        whole = end[3] + values[-1].ev(np.sqrt(end[0]), end[2])
        value = whole.reshape(grid.slips, grid.torques, grid.commands).min(axis=2)
    commands = np.linspace(0.0, most, COMMANDS_DRIVEN)
    slip_now, torque_now, driven_m = 0.0, 0.0, 0.0
    for number in range(len(speeds) - 2, -1, -1):
        end = field.descend(speeds[number], speeds[number + 1], np.full_like(commands, slip_now),
                            np.full_like(commands, torque_now), commands)
        best = int(np.argmin(end[3] + values[number].ev(np.sqrt(end[0]), end[2])))
        slip_now, torque_now, driven_m = float(end[0, best]), float(end[2, best]), driven_m + float(end[3, best])
    return Certificate(float(value[0, 0]), driven_m)
