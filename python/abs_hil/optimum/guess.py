"""Feasible brakings for the solver to start from. Each fixes the order in which the braked wheel turns and stands."""
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from .rig import DISTANCE, OMEGA2, SLIP, TORQUE, Piece, Rig

#: of the integration where the slip settles fastest, and the speed of the lower wheel above which it grows with that speed
STEP_S = 2.5e-4
GROWS_ABOVE_RAD_S = 30.0
#: a guess that takes longer is none
LONGEST_S = 60.0


@dataclass(frozen=True)
class Policy:
    """What a guess does: it holds a slip, and below a speed of the car it gives full torque.

    slip:      as a part of the best constant slip if `of_best`, else as such.
    full_below_m_s: infinite for full torque from the start.
    """
    slip: float
    of_best: bool = True
    full_below_m_s: float = 0.0


@dataclass
class Phase:
    """A part of a guess on one piece of road, in which the braked wheel turns, or stands."""
    piece: Piece
    stands: bool
    last_of_piece: bool = False
    time_s: list[float] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)
    commands_Nm: list[float] = field(default_factory=list)

    @property
    def duration_s(self) -> float:
        return self.time_s[-1] - self.time_s[0]

    @property
    def distance_m(self) -> float:
        """Where it ends."""
        return float(self.states[-1][DISTANCE])

    @functools.cached_property
    def _rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Of a finished phase: times and states."""
        return np.array(self.time_s), np.array(self.states)

    def state_at(self, time_s: float) -> np.ndarray:
        times, states = self._rows
        return np.array([np.interp(time_s, times, column) for column in states.T])

    def command_at(self, time_s: float) -> float:
        after = int(np.searchsorted(self._rows[0], time_s))
        return self.commands_Nm[min(max(after - 1, 0), len(self.commands_Nm) - 1)]


def best_slip(rig: Rig, friction: float) -> float:
    """The constant slip of the strongest braking force on this road."""
    slips = np.linspace(0.005, 0.5, 200)
    torque = np.full_like(slips, 0.5 * rig.max_torque_Nm)
    r1, r2 = rig['r1_m'], rig['r2_m']
    force_of = rig.force_function().map(len(slips))
    for _ in range(40):  # with the lever the force depends on the torque
        states = np.stack([slips, np.full_like(slips, 100.0), torque, np.zeros_like(slips)])
        force = force_of(states, np.full((1, len(slips)), friction)).full().ravel()
        torque = np.minimum(r1 * force + rig['J1_kg_m2'] * (1.0 - slips) * r2 / r1 * r2 * force / rig['J2_kg_m2'],
                            rig.max_torque_Nm)
    return float(slips[int(np.argmax(force))])


class Guesser:
    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        x, f, slip, full, h = ca.SX.sym('x', 4), ca.SX.sym('f'), ca.SX.sym('slip'), ca.SX.sym('full'), ca.SX.sym('h')
        force = rig.force_N(x, f)
        _, lower = rig.wheel_rates(x, force)
        # The torque that lets the slip approach the wanted one, and the command that lets the torque approach that.
        wanted_upper = ((1.0 - x[SLIP]) * lower - 25.0 * (slip - x[SLIP]) * x[OMEGA2]) * rig['r2_m'] / rig['r1_m']
        torque = rig['r1_m'] * force - rig['d1_Nms_rad'] * rig.omega1_rad_s(x) - rig['M10_Nm'] - rig['J1_kg_m2'] * wanted_upper
        wanted = ca.fmin(ca.fmax(torque + 100.0 / rig['c31_per_s'] * (torque - x[TORQUE]), 0.0), rig.max_torque_Nm)
        command = ca.if_else(full > 0.5, rig.max_torque_Nm, wanted)

        def step(stands: bool) -> ca.Function:
            def slope(at: ca.SX) -> ca.SX:
                return rig.rates(at, rig.torque_rate_Nm_s(at, command), f, stands)
            return ca.Function('step', [x, f, slip, full, h], [x + h * slope(x + 0.5 * h * slope(x)), command])
        self._steps = {stands: step(stands) for stands in (False, True)}

    def phases(self, policy: Policy, start: np.ndarray, start_s: float, road: Sequence[Piece],
               end_speed_m_s: float) -> list[Phase]:
        """The braking of a policy over `road` to the end speed on its last piece; [] if it does not get there."""
        rig, x, now_s = self._rig, np.array(start, dtype=float), start_s
        found: list[Phase] = []
        for number, piece in enumerate(road):
            last = number == len(road) - 1
            slip = min(policy.slip * (best_slip(rig, piece.value) if policy.of_best else 1.0), 0.98)
            phase = Phase(piece, self._holds(x, float(piece.friction(now_s, x[DISTANCE]))), False, [now_s], [x])
            while not self._done(piece, last, now_s, x, end_speed_m_s):
                speed_m_s = rig['r2_m'] * x[OMEGA2]
                if now_s - start_s > LONGEST_S or speed_m_s < 0.9 * end_speed_m_s:
                    return []
                friction = float(piece.friction(now_s, x[DISTANCE]))
                step_s = STEP_S * max(1.0, float(x[OMEGA2]) / GROWS_ABOVE_RAD_S)
                if piece.along == 'time' and not last:
                    step_s = min(step_s, piece.end - now_s)
                after, command = self._steps[phase.stands](x, friction, slip, speed_m_s < policy.full_below_m_s, step_s)
                x = after.full().ravel()
                now_s += step_s
                x[SLIP] = min(x[SLIP], 1.0)
                phase.time_s.append(now_s)
                phase.states.append(x)
                phase.commands_Nm.append(float(command))
                if (stands := self._holds(x, friction)) != phase.stands:
                    found.append(phase)
                    phase = Phase(piece, stands, False, [now_s], [x])
            if len(phase.time_s) < 2:  # nothing happened since the last change
                if not found or found[-1].piece is not piece:
                    return []
                phase = found.pop()
            phase.last_of_piece = True
            found.append(phase)
        return found

    def _holds(self, x: np.ndarray, friction: float) -> bool:
        return bool(x[SLIP] >= 1.0 and self._rig.holds_Nm(friction) <= x[TORQUE])

    def _done(self, piece: Piece, last: bool, now_s: float, x: np.ndarray, end_speed_m_s: float) -> bool:
        if last:
            return bool(self._rig['r2_m'] * x[OMEGA2] <= end_speed_m_s)
        return bool(now_s >= piece.end - 1e-9 if piece.along == 'time' else x[DISTANCE] >= piece.end)


def policies(rig: Rig, start_speed_m_s: float) -> tuple[list[Policy], list[Policy]]:
    """Those of which one is enough, and those to try besides.

    Under a constant load the force depends on the slip alone, so nothing is gained past the peak. Under the lever it rises
    with the brake's torque, and the curve may be flat: there it may be best to lock the wheel.
    """
    held = [Policy(0.8), Policy(0.5), Policy(1.0), Policy(0.25)]
    if rig.values['load'] == 'constant':
        return held, []
    return held, [Policy(0.0, full_below_m_s=math.inf), Policy(0.85, of_best=False),
                  Policy(0.9, full_below_m_s=0.6 * start_speed_m_s)]
