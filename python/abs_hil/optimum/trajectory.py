"""Optimal braking over a sequence of pieces of road, by direct collocation (Radau points, IPOPT)."""
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from .guess import Guesser, Phase, policies
from .rig import DISTANCE, OMEGA2, SLIP, TORQUE, Piece, Rig

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
#: a first guess that is longer than this part of the best optimum so far is none to start from
WORTH = 1.05
#: a phase lasts at least this long; the solver may shorten one to nearly nothing, but never turn it around
SHORTEST_S = 1e-4


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

    def then(self, other: 'Trajectory') -> 'Trajectory':
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


#: in [0, 1], and the derivatives of the Lagrange polynomials there, shape (DEGREE, DEGREE + 1)
POINTS = np.append(0.0, ca.collocation_points(DEGREE, 'radau'))
SLOPES = ca.collocation_coeff(list(POINTS[1:]))[0].full().T
#: sizes of the state's elements, for the solver
SCALE = np.array([0.1, 100.0, 5.0, 10.0])
_SCALE = ca.DM(SCALE)
SOLVER: dict[str, Any] = {'print_time': False,
                          'ipopt': {'print_level': 0, 'sb': 'yes', 'max_iter': 400, 'tol': 1e-7, 'mu_init': 1e-4}}


def solve(rig: Rig, start: np.ndarray, start_s: float, road: Sequence[Piece], end_speed_m_s: float) -> Trajectory:
    """The braking from `start` over `road` that is shortest until the car moves at `end_speed_m_s`.

    The commanded torque lies in [0, rig.max_torque_Nm] and is constant within an interval; the brake follows it by the
    lag c31. With a limit of the brake's rate, the torque's rate is constant within an interval instead, and the command is
    the one that this takes. `road` is known: each piece ends at its position, the last one where the car is slow.

    The solver finds local optima. So under a lever, where there are several, it starts from more than one braking
    (guess.py): from each that is itself not much longer than the best result. The shortest result counts. Raises NoOptimum if
    there is none.
    """
    guesser, problem = Guesser(rig), 'no first guess gets to the end of the road'
    best: Trajectory | None = None
    enough, others = policies(rig, rig['r2_m'] * float(start[OMEGA2]))
    for policy in [*enough, *others]:
        if best is not None and policy in enough:
            continue
        phases = guesser.phases(policy, start, start_s, road, end_speed_m_s)
        driven_m = phases[-1].distance_m - float(start[DISTANCE]) if phases else math.inf
        if not phases or (best is not None and driven_m > WORTH * (best.distance_m - float(start[DISTANCE]))):
            continue
        try:
            found = _solve(rig, start, start_s, phases, end_speed_m_s)
            best = found if best is None or found.distance_m < best.distance_m else best
        except NoOptimum as none:
            problem = str(none)
    if best is None:
        raise NoOptimum(problem)
    return best


def _solve(rig: Rig, start: np.ndarray, start_s: float, phases: Sequence[Phase], end_speed_m_s: float) -> Trajectory:
    rates = {stands: rig.rates_function(stands) for stands in (False, True)}
    variables: list[tuple[ca.SX, np.ndarray, np.ndarray, np.ndarray]] = []  # symbols, first guess, least, most
    constraints: list[ca.SX] = []  # zero in a solution
    within: list[ca.SX] = []  # torques and commands in [0, max_torque_Nm]
    lasting: list[ca.SX] = []  # durations that are not variables

    def variable(first: np.ndarray, lowest: np.ndarray, highest: np.ndarray) -> ca.SX:
        variables.append((ca.SX.sym('w', len(first)), first, lowest, highest))
        return variables[-1][0]

    slowest = 0.5 * end_speed_m_s / rig['r2_m']
    ceiling = np.array([1.0, 2.0 * float(start[OMEGA2]), rig.max_torque_Nm, 1e3]) / SCALE
    x, time = ca.SX(np.array(start, dtype=float) / SCALE), ca.SX(start_s)
    times, states = [time], [x]
    commands: list[ca.SX] = []
    cost: ca.SX = ca.SX(0.0)
    for number, phase in enumerate(phases):
        piece, last = phase.piece, number == len(phases) - 1
        expected_s, guess_s = phase.duration_s, phase.time_s[0]
        if piece.along == 'time' and phase.last_of_piece and not last:
            duration = ca.SX(piece.end) - time
            lasting.append(duration)
        else:
            duration = variable(np.array([expected_s]), np.array([SHORTEST_S]), np.array([10.0 * expected_s + 0.1]))
        floor = np.array([1.0 if phase.stands else -0.5, slowest, 0.0, 0.0]) / SCALE
        for share in _mesh(expected_s):
            h, step_s = float(share) * duration, float(share) * expected_s
            command_Nm = phase.command_at(guess_s + 0.5 * step_s)
            ramp = command = ca.SX(0.0)
            if rig.limited:
                behind_Nm = command_Nm - float(phase.state_at(guess_s)[TORQUE])
                asked = float(rig['c31_per_s'] * behind_Nm / rig.rate_limit_Nm_s)
                ramp = rig.rate_limit_Nm_s * variable(np.array([min(max(asked, -1.0), 1.0)]), -np.ones(1), np.ones(1))
            else:
                command = variable(np.array([command_Nm]), np.array([0.0]), np.array([rig.max_torque_Nm]))
            points = [x, *(variable(phase.state_at(guess_s + at * step_s) / SCALE, floor, ceiling) for at in POINTS[1:])]
            guess_s += step_s
            for j in range(DEGREE):
                state = points[j + 1] * _SCALE
                slope = ca.horzcat(*points) @ ca.DM(SLOPES[j])
                rate = ramp if rig.limited else rig.torque_rate_Nm_s(state, command)
                at = piece.friction(time + float(POINTS[j + 1]) * h, state[DISTANCE])
                defect = slope - h * rates[phase.stands](state, rate, at) / _SCALE
                constraints.append(defect[SLIP + 1:] if phase.stands else defect)
                if phase.stands:
                    within.append(state[TORQUE] - rig.holds_Nm(at))
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
        else:
            if phase.last_of_piece and piece.along == 'distance':
                constraints.append(x[DISTANCE] - float(piece.end / SCALE[DISTANCE]))
            if phases[number + 1].stands and not phase.stands:
                constraints.append(x[SLIP] - float(1.0 / SCALE[SLIP]))
    cost += float(SCALE[DISTANCE]) * x[DISTANCE]

    symbols, first, least, most = zip(*variables)
    w = ca.vertcat(*symbols)
    zeros = ca.vertcat(*constraints)
    solver = ca.nlpsol('braking', 'ipopt', {'x': w, 'f': cost, 'g': ca.vertcat(zeros, *within, *lasting)}, SOLVER)
    found = solver(x0=np.concatenate(first), lbx=np.concatenate(least), ubx=np.concatenate(most),
                   lbg=np.concatenate([np.zeros(zeros.numel() + len(within)), np.full(len(lasting), SHORTEST_S)]),
                   ubg=np.concatenate([np.zeros(zeros.numel()), np.full(len(within), rig.max_torque_Nm),
                                       np.full(len(lasting), np.inf)]))
    if (status := solver.stats()['return_status']) not in ('Solve_Succeeded', 'Solved_To_Acceptable_Level'):
        raise NoOptimum(f'no optimal braking: IPOPT says {status}')
    values = ca.Function('values', [w], [ca.vertcat(*times), ca.horzcat(*states), ca.vertcat(*commands)])(found['x'])
    return Trajectory(values[0].full().ravel(), values[1].full().T * SCALE, values[2].full().ravel())
