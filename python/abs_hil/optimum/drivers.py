"""Two drivers: one knows the whole road, the other the present friction."""
from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from .rig import DISTANCE, OMEGA2, SLIP, TORQUE, Rig
from .road import Piece
from .trajectory import NoOptimum, Trajectory, solve

#: on a road that changes in a straight line the causal braking is planned again this often, s
REPLAN_S = 0.04


class _Integrator:
    """States under commands that are given, by Runge-Kutta steps far below every time constant."""

    STEP_S = 1e-4

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._turning, self._standing = rig.rates_function(False), rig.rates_function(True)

    def _slope(self, x: np.ndarray, control: float, friction: float) -> np.ndarray:
        rate = control if self._rig.limited else self._rig['c31_per_s'] * (control - x[TORQUE])
        stands = x[SLIP] >= 1.0 and x[TORQUE] >= self._rig.holds_Nm(friction)
        return (self._standing if stands else self._turning)(x, rate, friction).full().ravel()

    def after(self, x: np.ndarray, time_s: float, plan: Trajectory, k: int, piece: Piece, duration_s: float) -> np.ndarray:
        """The state after a part of interval k of a plan: under its command, or with a limit under its torque's rate."""
        change_Nm = float(plan.states[k + 1, TORQUE] - plan.states[k, TORQUE])
        control = change_Nm / float(plan.time_s[k + 1] - plan.time_s[k]) if self._rig.limited else float(plan.command_Nm[k])
        steps = max(1, math.ceil(duration_s / self.STEP_S))
        h = duration_s / steps
        for number in range(steps):
            friction = float(piece.friction(time_s + (number + 0.5) * h, x[DISTANCE] + 0.5 * h * self._rig['r2_m'] * x[OMEGA2]))
            k1 = self._slope(x, control, friction)
            k2 = self._slope(x + 0.5 * h * k1, control, friction)
            k3 = self._slope(x + 0.5 * h * k2, control, friction)
            k4 = self._slope(x + h * k3, control, friction)
            x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
            x[SLIP] = min(x[SLIP], 1.0)
        return x


def _cut(rig: Rig, plan: Trajectory, piece: Piece, until_s: float) -> tuple[Trajectory, bool]:
    """The part of a plan that is driven before the piece ends or `until_s` has come, and whether the car stops in it.

    The plan knows the friction at its start only. So where the friction changes along the piece, its commands are
    integrated on the true road.
    """
    integrator = _Integrator(rig)
    times, states = [plan.time_s[0]], [plan.states[0]]
    count = len(plan.command_Nm)
    for k in range(count):
        x, now_s, length_s = states[-1], times[-1], plan.time_s[k + 1] - plan.time_s[k]
        end = plan.states[k + 1] if piece.slope == 0.0 else integrator.after(x, now_s, plan, k, piece, length_s)
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
            states.append(integrator.after(x, now_s, plan, k, piece, part * length_s))
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
        present = float(piece.friction(now_s, x[DISTANCE]))
        plan = solve(rig, x, now_s, [Piece(present)], end_speed_m_s)
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
