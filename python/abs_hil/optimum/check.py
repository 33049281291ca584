"""The optimal torque on the plant of the program itself: an independent check of the equations and of their solution."""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..hand import Plant
from ..options import PathLike, Value
from .rig import OMEGA2, TORQUE, Rig
from .trajectory import Trajectory

#: of the commands that follow a ramp
TICK_S = 2e-4


@dataclass(frozen=True)
class Driven:
    """What the plant made of a trajectory."""
    distance_m: float
    time_s: float


def drive(trajectory: Trajectory, plant: PathLike = 'paper-table1', set: Mapping[str, Value] | None = None) -> Driven:
    """Simulates the commands of a trajectory in open loop, and measures to the speed at which the trajectory ends.

    plant, set: those that the trajectory was found for. The duty is not rounded to the PWM's steps. Commands inside the
    brake's dead zone give no torque.
    """
    rig = Rig.of(plant=plant, set=set)
    r2, start = rig['r2_m'], trajectory.states[0]
    wheels = Plant(plant, set)
    wheels.reset(omega1_rad_s=float(rig.omega1_rad_s(start)), omega2_rad_s=float(start[OMEGA2]))
    torque = trajectory.states[:, TORQUE]
    for k, length_s in enumerate(np.diff(trajectory.time_s)):
        ramp = (torque[k + 1] - torque[k]) / length_s
        # With a limit of the rate the command runs ahead of a torque that changes in a straight line.
        ticks = math.ceil(length_s / TICK_S) if rig.limited else 1
        for tick in range(ticks):
            ahead_Nm = torque[k] + ramp * (length_s * (tick + 0.5) / ticks + 1.0 / rig['c31_per_s'])
            command_Nm = ahead_Nm if rig.limited else trajectory.command_Nm[k]
            wheels.advance(length_s / ticks, brake_duty=min(max((command_Nm - rig['b2_Nm']) / rig['b1_Nm'], 0.0), 1.0))
    # A few millimetres a second are left over or missing: at the deceleration of the last interval.
    before, end = r2 * trajectory.states[-2, OMEGA2], r2 * trajectory.states[-1, OMEGA2]
    slowing = (before - end) / (trajectory.time_s[-1] - trajectory.time_s[-2])
    v = r2 * wheels.state.omega2_rad_s
    distance = r2 * wheels.state.angle2_rad + (v * v - end * end) / (2.0 * slowing)
    return Driven(float(distance), float(trajectory.time_s[-1] + (v - end) / slowing)) if v > 0.0 else Driven(math.nan, math.nan)
