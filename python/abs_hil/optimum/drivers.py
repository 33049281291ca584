"""Two drivers: one knows the whole road, the other the present friction. And what the plant makes of their brakings."""
import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..options import PathLike, Value
from ..stepped import Plant
from .rig import DISTANCE, OMEGA2, SLIP, TORQUE, Piece, Rig
from .trajectory import NoOptimum, Trajectory, solve

#: on a road that changes in a straight line the causal braking is planned again this often, s
REPLAN_S = 0.04
#: of the integration on a road that changes
STEP_S = 1e-4
#: of the commands that follow a ramp
TICK_S = 2e-4
#: decay of a slip that differs from the plan's, and lead of that torque over the brake's lag, 1/s
FOLLOW_PER_S = 30.0
LEAD_PER_S = 60.0


def _after(rig: Rig, rates: Mapping[bool, Any], x: np.ndarray, time_s: float, plan: Trajectory, k: int, piece: Piece,
           duration_s: float) -> np.ndarray:
    """The state after a part of interval k of a plan: under its command, or with a limit under its torque's rate. By Runge-Kutta
    steps far below every time constant."""
    def slope(x: np.ndarray, friction: float) -> np.ndarray:
        rate = control if rig.limited else rig['c31_per_s'] * (control - x[TORQUE])
        stands = bool(x[SLIP] >= 1.0 and x[TORQUE] >= rig.holds_Nm(friction))
        return np.asarray(rates[stands](x, rate, friction).full().ravel())

    change_Nm = float(plan.states[k + 1, TORQUE] - plan.states[k, TORQUE])
    control = change_Nm / float(plan.time_s[k + 1] - plan.time_s[k]) if rig.limited else float(plan.command_Nm[k])
    steps = max(1, math.ceil(duration_s / STEP_S))
    h = duration_s / steps
    for number in range(steps):
        friction = float(piece.friction(time_s + (number + 0.5) * h, x[DISTANCE] + 0.5 * h * rig['r2_m'] * x[OMEGA2]))
        k1 = slope(x, friction)
        k2 = slope(x + 0.5 * h * k1, friction)
        k3 = slope(x + 0.5 * h * k2, friction)
        k4 = slope(x + h * k3, friction)
        x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        x[SLIP] = min(x[SLIP], 1.0)
    return x


def _cut(rig: Rig, plan: Trajectory, piece: Piece, until_s: float) -> tuple[Trajectory, bool]:
    """The part of a plan that is driven before the piece ends or `until_s` has come, and whether the car stops in it.

    The plan knows the friction at its start only. So where the friction changes along the piece, its commands are
    integrated on the true road.
    """
    rates = {stands: rig.rates_function(stands) for stands in (False, True)}
    times, states = [plan.time_s[0]], [plan.states[0]]
    count = len(plan.command_Nm)
    for k in range(count):
        x, now_s, length_s = states[-1], times[-1], plan.time_s[k + 1] - plan.time_s[k]
        end = plan.states[k + 1] if piece.slope == 0.0 else _after(rig, rates, x, now_s, plan, k, piece, length_s)
        over_s = now_s + length_s - min(until_s, piece.end if piece.along == 'time' else math.inf)
        part = 1.0 - over_s / length_s if over_s > 0.0 else 1.0
        if piece.along == 'distance' and end[DISTANCE] > piece.end:
            # The speed changes by little within an interval.
            v0, v1 = rig['r2_m'] * x[OMEGA2], rig['r2_m'] * end[OMEGA2]
            gap_m = piece.end - x[DISTANCE]
            slowing = (v0 - v1) / length_s
            reached_s = 2.0 * gap_m / (v0 + math.sqrt(max(v0 * v0 - 2.0 * slowing * gap_m, 0.0)))
            part = min(part, reached_s / length_s)
        if part < 1.0:
            states.append(_after(rig, rates, x, now_s, plan, k, piece, part * length_s))
            times.append(now_s + part * length_s)
            return Trajectory(np.array(times), np.array(states), plan.command_Nm[:k + 1]), False
        states.append(end)
        times.append(now_s + length_s)
        if piece.slope != 0.0 and k == count - 1:
            return Trajectory(np.array(times), np.array(states), plan.command_Nm), False
    return plan, True


def causal(rig: Rig, start: np.ndarray, road: Sequence[Piece], end_speed_m_s: float) -> Trajectory:
    """The braking of one who knows the tyre and the present friction, and takes it to last.

    Where the friction jumps, the braking is planned again from the present state; while it changes in a straight line,
    every REPLAN_S.
    """
    driven: Trajectory | None = None
    x, now_s, number = np.asarray(start, dtype=float), 0.0, 0
    while True:
        piece = road[number]
        plan = solve(rig, x, now_s, [Piece(float(piece.friction(now_s, x[DISTANCE])))], end_speed_m_s)
        part, stops = _cut(rig, plan, piece, math.inf if piece.slope == 0.0 else now_s + REPLAN_S)
        driven = part if driven is None else driven.then(part)
        if stops:
            return driven
        x, now_s = driven.states[-1], float(driven.time_s[-1])
        if rig['r2_m'] * x[OMEGA2] <= 1.02 * end_speed_m_s:
            return driven
        position = now_s if piece.along == 'time' else x[DISTANCE]
        if position >= piece.end - 1e-9 * max(1.0, piece.end) - 1e-7:
            number += 1


def preview(rig: Rig, start: np.ndarray, road: Sequence[Piece], end_speed_m_s: float,
            known: Trajectory | None = None) -> Trajectory:
    """The braking of one who knows the whole road.

    known:  a braking on the same road that passes no fewer pieces; the causal one by default.
    """
    if len(road) == 1:
        return solve(rig, np.asarray(start, dtype=float), 0.0, road, end_speed_m_s)
    if known is None:
        known = causal(rig, start, road, end_speed_m_s)
    at = known.stop_time_s if road[0].along == 'time' else known.distance_m
    count = max(1, sum(piece.begin < at for piece in road))
    while True:
        passed = [*road[:count - 1], dataclasses.replace(road[count - 1], end=math.inf)]
        try:
            return solve(rig, np.asarray(start, dtype=float), 0.0, passed, end_speed_m_s)
        except NoOptimum:
            if count == 1:
                raise
            count -= 1  # the better braking stops before the last piece begins


@dataclass(frozen=True)
class Driven:
    """What the plant made of a trajectory."""
    distance_m: float
    time_s: float


def drive(trajectory: Trajectory, plant: PathLike = 'paper-table1', set: Mapping[str, Value] | None = None) -> Driven:
    """Simulates the commands of a trajectory on the plant of the program itself, and measures to the speed at which the trajectory
    ends: an independent check of the equations and of their solution.

    Without a limit of the brake's rate the commands run in open loop. With one the optimum passes the peak where friction falls,
    and holds a slip there that is unstable: in open loop a thousandth of a newton metre grows until the wheel locks. So the
    check then follows the plan's slip: it adds a small torque in proportion to the difference.

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
