"""Optimal braking over a sequence of pieces of road, by direct collocation (Radau points, IPOPT)."""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from .rig import DISTANCE, OMEGA2, SLIP, TORQUE, Rig

#: degree of the collocation polynomials; the error of a state falls with the fifth power of the interval
DEGREE = 3
#: the first part of a piece is dense: brake and slip settle there
DENSE_S = 0.2
DENSE_INTERVAL_S = 3.5e-3
#: intervals of the rest of a piece, at most and at least; they shrink with the speed
REST_INTERVAL_S = 0.03
REST_INTERVALS = (6, 50)
#: weight of the squared changes of the commanded torque, m/(N m)^2. On the singular arc the distance alone leaves the
#: command undetermined within rounding. It lengthens the braking by less than 1e-5 of the distance.
SMOOTHNESS = 2e-6
Number = TypeVar('Number', float, ca.SX)


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


@dataclass(frozen=True)
class Trajectory:
    """States at the ends of the intervals, shape (intervals + 1, 4), and the torque that is commanded in each interval.

    With a limit of the brake's rate, that is the mean of a command that changes with the torque.
    """
    time_s: np.ndarray
    states: np.ndarray
    command_Nm: np.ndarray

    @property
    def distance_m(self) -> float:
        return float(self.states[-1, DISTANCE])

    @property
    def stop_time_s(self) -> float:
        return float(self.time_s[-1])

    @property
    def variation_Nm(self) -> float:
        """Sum of the absolute changes of the commanded torque, from 0 on."""
        return float(np.abs(np.diff(self.command_Nm, prepend=0.0)).sum())

    def until(self, count: int) -> Trajectory:
        """The first `count` intervals."""
        return Trajectory(self.time_s[:count + 1], self.states[:count + 1], self.command_Nm[:count])

    def then(self, other: Trajectory) -> Trajectory:
        return Trajectory(np.concatenate([self.time_s, other.time_s[1:]]), np.concatenate([self.states, other.states[1:]]),
                          np.concatenate([self.command_Nm, other.command_Nm]))


class NoOptimum(RuntimeError):
    """The solver found no solution."""


def _mesh(duration_s: float) -> np.ndarray:
    """Lengths of the intervals of a piece that lasts about this long, as shares of its duration."""
    dense_s = min(DENSE_S, 0.5 * duration_s)
    dense = np.full(max(4, math.ceil(dense_s / DENSE_INTERVAL_S)), 1.0)
    rest_s = duration_s - dense_s
    rest = np.linspace(1.0, 0.3, min(max(math.ceil(rest_s / REST_INTERVAL_S), REST_INTERVALS[0]), REST_INTERVALS[1]))
    lengths = np.concatenate([dense * dense_s / dense.sum(), rest * rest_s / rest.sum()])
    return lengths / lengths.sum()


def _collocation() -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the Lagrange polynomials at the points, shape (DEGREE, DEGREE + 1), and the points in [0, 1]."""
    points = np.append(0.0, ca.collocation_points(DEGREE, 'radau'))
    slopes = np.zeros((DEGREE, DEGREE + 1))
    for j in range(DEGREE + 1):
        others = [points[r] for r in range(DEGREE + 1) if r != j]
        basis = np.poly1d(np.poly(others) / np.prod([points[j] - other for other in others]))
        slopes[:, j] = np.polyder(basis)(points[1:])
    return slopes, points


SLOPES, POINTS = _collocation()
#: sizes of the state's elements, for the solver
SCALE = np.array([0.1, 100.0, 5.0, 10.0])
_SCALE = ca.DM(SCALE)
SOLVER: dict[str, Any] = {'print_time': False,
                          'ipopt': {'print_level': 0, 'sb': 'yes', 'max_iter': 400, 'tol': 1e-7, 'mu_init': 1e-4}}
#: slips of the first guess as parts of the best constant slip: the next is tried where the solver fails from one
GUESS_SHARES = (0.8, 0.5, 1.0, 0.25)
#: step of the integration that gives the first guess
GUESS_STEP_S = 2.5e-4


class _FirstGuess:
    """A feasible braking for the solver to start from: the slip is led to a value before the peak and held there."""

    def __init__(self, rig: Rig, rates: ca.Function, slip: float) -> None:
        self._rig = rig
        x, u, f = ca.SX.sym('x', 4), ca.SX.sym('u'), ca.SX.sym('f')
        rate = rig.torque_rate_Nm_s(x, u)
        force = rig.force_N(x, f)
        _, lower = rig.wheel_rates(x, force)
        # The torque that lets the slip approach the wanted one, and the command that lets the torque approach that.
        wanted_upper = ((1.0 - x[SLIP]) * lower - 25.0 * (slip - x[SLIP]) * x[OMEGA2]) * rig['r2_m'] / rig['r1_m']
        torque = rig['r1_m'] * force - rig['d1_Nms_rad'] * rig.omega1_rad_s(x) - rig['M10_Nm'] - rig['J1_kg_m2'] * wanted_upper
        command = ca.fmin(ca.fmax(torque + 100.0 / rig['c31_per_s'] * (torque - x[TORQUE]), 0.0), rig.max_torque_Nm)
        self._command = ca.Function('command', [x, f], [command])
        self._slope = ca.Function('slope', [x, u, f], [rates(x, rate, f)])

    def command_Nm(self, x: np.ndarray, friction: float) -> float:
        return float(self._command(x, friction))

    def duration_s(self, x: np.ndarray, time_s: float, piece: Piece, last: bool, end_speed_m_s: float,
                   deceleration_m_s2: float) -> float:
        """About how long the car takes to the end of the piece."""
        if piece.along == 'time' and not last:
            return piece.end - time_s
        v = self._rig['r2_m'] * float(x[OMEGA2])
        if last:
            return max(v - end_speed_m_s, 0.02) / deceleration_m_s2
        root = v * v - 2.0 * deceleration_m_s2 * (piece.end - float(x[DISTANCE]))
        return (v - math.sqrt(max(root, 0.01 * v * v))) / deceleration_m_s2

    def step(self, x: np.ndarray, command_Nm: float, friction: float, duration_s: float) -> np.ndarray:
        steps = max(1, math.ceil(duration_s / GUESS_STEP_S))
        h = duration_s / steps
        for _ in range(steps):
            k1 = self._slope(x, command_Nm, friction).full().ravel()
            k2 = self._slope(x + 0.5 * h * k1, command_Nm, friction).full().ravel()
            x = x + h * k2
        return x


def _cruise(rig: Rig, friction: float) -> tuple[float, float]:
    """The constant slip of the strongest braking force on this road, and the deceleration that it gives, m/s^2."""
    slips = np.linspace(0.005, 0.5, 200)
    torque = np.full_like(slips, 0.5 * rig.max_torque_Nm)
    r1, r2 = rig['r1_m'], rig['r2_m']
    force_of = rig.force_function().map(len(slips))
    for _ in range(40):  # with the lever the force depends on the torque
        states = np.stack([slips, np.full_like(slips, 100.0), torque, np.zeros_like(slips)])
        force = force_of(states, np.full((1, len(slips)), friction)).full().ravel()
        torque = np.minimum(r1 * force + rig['J1_kg_m2'] * (1.0 - slips) * r2 / r1 * r2 * force / rig['J2_kg_m2'],
                            rig.max_torque_Nm)
    best = int(np.argmax(force))
    return float(slips[best]), float(r2 * (r2 * force[best] + rig['M20_Nm']) / rig['J2_kg_m2'])


def solve(rig: Rig, start: np.ndarray, start_s: float, road: Sequence[Piece], end_speed_m_s: float) -> Trajectory:
    """The braking from `start` over `road` that is shortest until the car moves at `end_speed_m_s`.

    The commanded torque lies in [0, rig.max_torque_Nm] and is constant within an interval; the brake follows it by the
    lag c31. With a limit of the brake's rate, the torque's rate is constant within an interval instead, and the command is
    the one that this takes. `road` is known: each piece ends at its position, the last one where
    the car is slow. Raises NoOptimum.
    """
    problems = []
    for share in GUESS_SHARES:
        try:
            return _solve(rig, start, start_s, road, end_speed_m_s, share)
        except NoOptimum as problem:
            problems.append(problem)
    raise problems[0]


def _solve(rig: Rig, start: np.ndarray, start_s: float, road: Sequence[Piece], end_speed_m_s: float,
           guess_share: float) -> Trajectory:
    rates = rig.rates_function()
    symbols: list[ca.SX] = []
    guesses: list[float] = []
    least: list[float] = []
    most: list[float] = []
    constraints: list[ca.SX] = []  # zero in a solution
    within: list[ca.SX] = []  # commands that have to be possible

    def variable(first: np.ndarray, lowest: np.ndarray, highest: np.ndarray) -> ca.SX:
        symbols.append(ca.SX.sym('w', len(first)))
        guesses.extend(first)
        least.extend(lowest)
        most.extend(highest)
        return symbols[-1]

    guess_x = np.array(start, dtype=float)
    guess_s = start_s
    floor = np.array([-0.5, 0.5 * end_speed_m_s / rig['r2_m'], 0.0, 0.0]) / SCALE
    ceiling = np.array([0.99, 2.0 * guess_x[OMEGA2], rig.max_torque_Nm, 1e3]) / SCALE
    x, time = ca.SX(guess_x / SCALE), ca.SX(start_s)
    times, states = [time], [x]
    commands: list[ca.SX] = []
    cost: ca.SX = ca.SX(0.0)
    for number, piece in enumerate(road):
        last = number == len(road) - 1
        slip, deceleration = _cruise(rig, piece.value)
        first_guess = _FirstGuess(rig, rates, guess_share * slip)
        expected_s = first_guess.duration_s(guess_x, guess_s, piece, last, end_speed_m_s, deceleration)
        if piece.along == 'time' and not last:
            duration = ca.SX(piece.end) - time
        else:
            duration = variable(np.array([expected_s]), np.array([0.1 * expected_s]), np.array([10.0 * expected_s]))
        for share in _mesh(expected_s):
            h, step_s = float(share) * duration, float(share) * expected_s
            friction = piece.friction(guess_s, guess_x[DISTANCE])
            command_Nm = first_guess.command_Nm(guess_x, friction)
            ramp = command = ca.SX(0.0)
            if rig.limited:
                asked = float(rig['c31_per_s'] * (command_Nm - guess_x[TORQUE]) / rig.rate_limit_Nm_s)
                ramp = rig.rate_limit_Nm_s * variable(np.array([min(max(asked, -1.0), 1.0)]), -np.ones(1), np.ones(1))
            else:
                command = variable(np.array([command_Nm]), np.array([0.0]), np.array([rig.max_torque_Nm]))
            points = [x]
            for j in range(DEGREE):
                guess_x = first_guess.step(guess_x, command_Nm, friction, (POINTS[j + 1] - POINTS[j]) * step_s)
                guess_x[OMEGA2] = max(guess_x[OMEGA2], 0.6 * end_speed_m_s / rig['r2_m'])
                points.append(variable(guess_x / SCALE, floor, ceiling))
            guess_s += step_s
            for j in range(DEGREE):
                state = points[j + 1] * _SCALE
                slope = ca.horzcat(*points) @ ca.DM(SLOPES[j])
                rate = ramp if rig.limited else rig.torque_rate_Nm_s(state, command)
                at = piece.friction(time + float(POINTS[j + 1]) * h, state[DISTANCE])
                constraints.append(slope - h * rates(state, rate, at) / _SCALE)
            if rig.limited:
                ends = [point[TORQUE] * float(SCALE[TORQUE]) + ramp / rig['c31_per_s'] for point in (x, points[-1])]
                within += ends
                command = 0.5 * (ends[0] + ends[1])
            if commands:
                cost += SMOOTHNESS * (command - commands[-1]) ** 2
            commands.append(command)
            x, time = points[-1], time + h
            times.append(time)
            states.append(x)
        if last:
            constraints.append(x[OMEGA2] - float(end_speed_m_s / rig['r2_m'] / SCALE[OMEGA2]))
        elif piece.along == 'distance':
            constraints.append(x[DISTANCE] - float(piece.end / SCALE[DISTANCE]))
    cost += float(SCALE[DISTANCE]) * x[DISTANCE]

    w = ca.vertcat(*symbols)
    zeros = ca.vertcat(*constraints)
    solver = ca.nlpsol('braking', 'ipopt', {'x': w, 'f': cost, 'g': ca.vertcat(zeros, *within)}, SOLVER)
    found = solver(x0=guesses, lbx=least, ubx=most, lbg=0.0,
                   ubg=np.concatenate([np.zeros(zeros.numel()), np.full(len(within), rig.max_torque_Nm)]))
    status = solver.stats()['return_status']
    if status not in ('Solve_Succeeded', 'Solved_To_Acceptable_Level'):
        raise NoOptimum(f'no optimal braking: IPOPT says {status}')
    values = ca.Function('values', [w], [ca.vertcat(*times), ca.horzcat(*states), ca.vertcat(*commands)])(found['x'])
    return Trajectory(values[0].full().ravel(), values[1].full().T * SCALE, values[2].full().ravel())
