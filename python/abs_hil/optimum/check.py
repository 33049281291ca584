"""The optimal torque on the plant of the program itself: an independent check of the equations and of their solution.

Without a limit of the brake's rate the commands run in open loop. With one the optimum passes the peak where friction falls,
and holds a slip there that is unstable: in open loop a thousandth of a newton metre grows until the wheel locks. So the check
then follows the plan's slip: it adds a small torque in proportion to the difference.
"""
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..options import PathLike, Value
from ..stepped import Plant
from .rig import OMEGA2, SLIP, TORQUE, Rig
from .trajectory import Trajectory

#: of the commands that follow a ramp
TICK_S = 2e-4
#: decay of a slip that differs from the plan's, and lead of that torque over the brake's lag, 1/s
FOLLOW_PER_S = 30.0
LEAD_PER_S = 60.0


@dataclass(frozen=True)
class Driven:
    """What the plant made of a trajectory."""
    distance_m: float
    time_s: float


def drive(trajectory: Trajectory, plant: PathLike = 'paper-table1', set: Mapping[str, Value] | None = None) -> Driven:
    """Simulates the commands of a trajectory, and measures to the speed at which the trajectory ends.

    plant, set: those that the trajectory was found for. The duty is not rounded to the PWM's steps. Commands inside the
    brake's dead zone give no torque.
    """
    rig = Rig.of(plant=plant, set=set)
    r2, start = rig['r2_m'], trajectory.states[0]
    wheels = Plant(plant, set)
    wheels.reset(omega1_rad_s=float(rig.omega1_rad_s(start)), omega2_rad_s=float(start[OMEGA2]))
    torque = trajectory.states[:, TORQUE]
    follow_Ns_m = FOLLOW_PER_S * (1.0 + LEAD_PER_S / rig['c31_per_s']) * rig['J1_kg_m2'] / rig['r1_m']
    for k, length_s in enumerate(np.diff(trajectory.time_s)):
        ramp = (torque[k + 1] - torque[k]) / length_s
        # With a limit of the rate the command runs ahead of a torque that changes in a straight line.
        ticks = math.ceil(length_s / TICK_S) if rig.limited else 1
        for tick in range(ticks):
            part = (tick + 0.5) / ticks
            ahead_Nm = torque[k] + ramp * (length_s * part + 1.0 / rig['c31_per_s'])
            v = r2 * wheels.state.omega2_rad_s
            planned = (1.0 - part) * trajectory.states[k, SLIP] + part * trajectory.states[k + 1, SLIP]
            behind_m_s = planned * v - (v - rig['r1_m'] * wheels.state.omega1_rad_s)
            command_Nm = ahead_Nm + follow_Ns_m * behind_m_s if rig.limited else trajectory.command_Nm[k]
            wheels.advance(length_s / ticks, brake_duty=min(max((command_Nm - rig['b2_Nm']) / rig['b1_Nm'], 0.0), 1.0))
    # A few millimetres a second are left over or missing: at the deceleration of the last interval.
    before, end = r2 * trajectory.states[-2, OMEGA2], r2 * trajectory.states[-1, OMEGA2]
    slowing = (before - end) / (trajectory.time_s[-1] - trajectory.time_s[-2])
    v = r2 * wheels.state.omega2_rad_s
    distance = r2 * wheels.state.angle2_rad + (v * v - end * end) / (2.0 * slowing)
    return Driven(float(distance), float(trajectory.time_s[-1] + (v - end) / slowing)) if v > 0.0 else Driven(math.nan, math.nan)
