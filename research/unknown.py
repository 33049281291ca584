"""A lower bound of what it costs not to know tyre and road (docs/benchmark.md): dual control by information relaxation.

A family has equally likely members: the same rig on other tyres or roads. L_i is the braking distance on member i over that of
the optimum that knows the member, less 1. The controller knows the rig, the family and, at each control period, the counts of
both encoders: floor((angle + dither) / resolution), with dithers that are independent and uniform.

Theorem. Let m(n) be the least mean of L_i over all commands that agree among the members for the first n periods, and let
D(k) bound the spread of the members' angles at period k, upper plus lower wheel, in counts, whatever the common command was.
Let S(n) = max(0, 1 - D(0) - ... - D(n-1)). Then for n_0 = 0 < n_1 < n_2 ... every controller has
E[mean L_i] >= sum of (m(n_j) - m(n_j-1)) S(n_j), with m(0) = 0.

Proof. Let all members have the same dithers. While the counts agree, so do the commands; at period k the counts part with
probability D(k) at most, as its dithers are independent of all before. Say that the commands agree for N periods: then the mean
of L_i is at least m(N), even if the controller learns the truth thereafter. P(N >= n) >= S(n), m rises with n, and summing by
parts gives the theorem. Roads that are equal up to their changes need no dithers: nothing that moves before a change can tell
it, so that the commands agree until the first period that begins after it. When a change in distance meets the periods depends
on the braking, so there they agree up to the change; until then equal commands in time are equal commands in distance.

m(n) is computed by collocation of all members at once. That finds local optima, so the value used is that of the dual: the
prices of the agreement are added to each member's cost, and each is solved alone. By weak duality their sum lies below m(n),
if these single optima are right, as for the bounds of abs_hil.optimum.trajectory: research/certificate.py computes them anew.
The load is constant, and no wheel stands.
"""
from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from abs_hil.optimum.guess import Guesser, Policy
from abs_hil.optimum.rig import DISTANCE, OMEGA2, SLIP, Piece, Rig
from abs_hil.optimum.trajectory import POINTS, SCALE, SHORTEST_S, SLOPES, SMOOTHNESS, SOLVER, NoOptimum, _mesh

PERIOD_S = 1e-3
#: of the mean of the L_i in the solver's cost, which is to be about as large as its other numbers
COST = 10.0
#: S(n) at the n_j of the theorem: more of them raise the bound by little
AGREE = (0.8, 0.5, 0.25)
EVEN = Piece(1.0)
#: of the guesses, as parts of the best slip
GUESSES = (0.8, 0.5, 1.0, 0.25)
#: of the linear solver: with its default the joint problem of six roads does not converge
PIVOT_TOLERANCE = 1e-2
#: above what viscous friction adds to the spread of the angles
VISCOUS = 1.01


@dataclass(frozen=True)
class Part:
    """Intervals of a braking on one friction.

    key:    parts with the same key have the same commands in all members. free: the solver chooses the duration; until_m: the
    distance at which it then ends. lengths_m: of intervals that are fixed in distance, the durations then being guesses.
    """
    lengths_s: np.ndarray
    friction: float
    key: str = ''
    free: bool = False
    until_m: float | None = None
    lengths_m: np.ndarray | None = None

    @property
    def lengths(self) -> np.ndarray:
        """s, or m if they are fixed in distance."""
        return self.lengths_s if self.lengths_m is None else self.lengths_m


@dataclass(frozen=True)
class Member:
    rig: Rig
    start: np.ndarray
    road: Sequence[Piece]
    parts: Sequence[Part]
    end_speed_m_s: float = 0.3


class _Braking:
    """One member's collocation: variables with their limits and first values, constraints, distance and shared values."""

    def __init__(self, member: Member) -> None:
        rig, self._member = member.rig, member
        self._places: list[tuple[float, int]] = []
        self._low: list[float] = []
        self._high: list[float] = []
        self._w: list[ca.SX] = []
        self.shared: list[tuple[str, int]] = []
        zeros: list[ca.SX] = []
        rates = rig.rates_function()
        slowest, most = 0.5 * member.end_speed_m_s / rig['r2_m'], rig.max_torque_Nm
        low, high = np.array([-0.5, slowest, 0.0, 0.0]), np.array([1.0, 2.0 * member.start[OMEGA2], most, 1e3])
        x, before, now_s, roughness = ca.SX(np.asarray(member.start) / SCALE), None, 0.0, ca.SX(0.0)
        for part in member.parts:
            guess_s = float(part.lengths_s.sum())
            share = self._variable(np.nan, [SHORTEST_S / guess_s], [20.0]) if part.free else ca.SX(1.0)
            for number, length_s in enumerate(part.lengths_s):
                command = self._variable(now_s + 0.5 * length_s, [0.0], [most])
                if part.key:
                    self.shared.append((f'{part.key} {number}', len(self._low) - 1))
                points = [x]
                for j in range(len(SLOPES)):
                    points.append(self._variable(now_s + POINTS[j + 1] * length_s, low / SCALE, high / SCALE))
                for j, slopes in enumerate(SLOPES):
                    state = points[j + 1] * ca.DM(SCALE)
                    rate = rates(state, rig.torque_rate_Nm_s(state, command), part.friction)
                    lasts_s = float(part.lengths[number]) * (share if part.lengths_m is None else 1.0 / rate[DISTANCE])
                    zeros.append(ca.horzcat(*points) @ ca.DM(slopes) - lasts_s * rate / ca.DM(SCALE))
                roughness += 0.0 if before is None else (command - before) ** 2
                x, before, now_s = points[-1], command, now_s + length_s
            if part.until_m is not None:
                zeros.append(x[DISTANCE] - part.until_m / SCALE[DISTANCE])
        zeros.append(x[OMEGA2] - member.end_speed_m_s / rig['r2_m'] / SCALE[OMEGA2])
        w, defects, share = ca.vertcat(*self._w), ca.vertcat(*zeros), ca.SX.sym('share')
        distance_m, smooth_m, multipliers = x[DISTANCE] * SCALE[DISTANCE], SMOOTHNESS * roughness, ca.SX.sym('m', defects.numel())
        self.terms = ca.Function('terms', [w], [distance_m, smooth_m, defects])
        self.gradient = ca.Function('gradient', [w, share, multipliers], [ca.gradient(
            share * (distance_m + smooth_m) + ca.dot(multipliers, defects), w)])
        self.constraints = defects.numel()
        self.low, self.high = np.array(self._low), np.array(self._high)

    def _variable(self, at_s: float, low: Sequence[float], high: Sequence[float]) -> ca.SX:
        self._w.append(ca.SX.sym('w', len(low)))
        self._places.append((at_s, len(low)))
        self._low.extend(low)
        self._high.extend(high)
        return self._w[-1]

    def alone(self, problem: _Problem) -> tuple[np.ndarray, np.ndarray]:
        """A guess, and the variables of the optimum that knows the member. Raises NoOptimum."""
        member = self._member
        for slip in GUESSES:
            phases = Guesser(member.rig).phases(Policy(slip), member.start, 0.0, member.road, member.end_speed_m_s)
            if not phases:
                continue
            times = np.concatenate([phase.time_s for phase in phases])
            states = np.concatenate([phase.states for phase in phases]) / SCALE
            commands = np.concatenate([[*phase.commands_Nm, phase.commands_Nm[-1]] for phase in phases])
            guess = np.concatenate([[1.0] if np.isnan(at_s) else [np.interp(at_s, times, column) for column in (
                states.T if size == len(SCALE) else [commands])] for at_s, size in self._places])
            try:
                return guess, problem.least(guess, np.array([phases[-1].distance_m]))[1]
            except NoOptimum:
                continue
        raise NoOptimum('no optimal braking of a member of the family')


class _Problem:
    """Brakings whose variable k is variable places[k] of the problem, so that they may share some.

    The cost is COST times the sum of the distances over those in `known_m`, and the variables times prices; each solution has
    its own.
    """

    def __init__(self, brakings: Sequence[_Braking], places: Sequence[np.ndarray]) -> None:
        count = 1 + max(int(place.max()) for place in places)
        self._low, self._high = np.zeros(count), np.zeros(count)
        w, price, known_m = ca.SX.sym('w', count), ca.SX.sym('p', count), ca.SX.sym('k', len(brakings))
        cost, smooth, zeros = ca.dot(price, w), ca.SX(0.0), []
        for number, (braking, place) in enumerate(zip(brakings, places)):
            self._low[place], self._high[place] = braking.low, braking.high
            distance_m, smooth_m, defects = braking.terms(w[place])
            cost += COST / known_m[number] * distance_m
            smooth += COST / known_m[number] * smooth_m
            zeros.append(defects)
        self._cost = ca.Function('cost', [w, price, known_m], [cost])
        self._solver = ca.nlpsol('family', 'ipopt', {'x': w, 'f': cost + smooth, 'g': ca.vertcat(*zeros),
                                                     'p': ca.vertcat(price, known_m)},
                                 {**SOLVER, 'ipopt': {**SOLVER['ipopt'], 'mumps_pivtol': PIVOT_TOLERANCE}})

    def least(self, first: np.ndarray, known_m: np.ndarray,
              prices: np.ndarray | None = None) -> tuple[float, np.ndarray, np.ndarray]:
        """Least cost, its variables, and the multipliers of the constraints. Raises NoOptimum."""
        price = np.zeros(len(first)) if prices is None else prices
        found = self._solver(x0=first, lbx=self._low, ubx=self._high, lbg=0.0, ubg=0.0, p=np.concatenate([price, known_m]))
        status = self._solver.stats()['return_status']
        if status not in ('Solve_Succeeded', 'Solved_To_Acceptable_Level'):
            raise NoOptimum(f'no optimal braking: IPOPT says {status}')
        return float(self._cost(found['x'], price, known_m)), found['x'].full().ravel(), found['lam_g'].full().ravel()


@dataclass(frozen=True)
class Ignorance:
    """known_m: of the optimum that knows the member. loss: m(n), of the dual. primal: of the brakings found, which lies above.

    prices: of the shared commands of each member in the order of its parts, in m per N m; those of a command, each over the
    known_m of its member, cancel. priced_m: the least sum of distance and priced commands of each member.
    """
    known_m: list[float]
    loss: float
    primal: float
    prices: list[np.ndarray]
    priced_m: list[float]


def ignorance(members: Sequence[Member]) -> Ignorance:
    """m(n) of a family, whose parts say by their keys how long the commands agree. Raises NoOptimum."""
    brakings = [_Braking(member) for member in members]
    problems = [_Problem([braking], [np.arange(len(braking.low))]) for braking in brakings]
    guesses, alone = zip(*(b.alone(problem) for b, problem in zip(brakings, problems)))
    known_m = np.array([float(b.terms(w)[0]) for b, w in zip(brakings, alone)])
    seen: dict[str, int] = {}
    places, count = [], 0
    for braking, single in zip(brakings, alone):
        place = np.full(len(single), -1)
        for key, index in braking.shared:
            if key in seen:
                place[index] = seen[key]
        own = place < 0
        place[own] = count + np.arange(int(own.sum()))
        count += int(own.sum())
        seen.update((key, int(place[index])) for key, index in braking.shared)
        places.append(place)
    joint, shares = _Problem(brakings, places), len(members) * known_m
    for firsts in (guesses, alone):  # in the guesses the commands agree
        first = np.zeros(count)
        for place, one in zip(places, firsts):
            first[place] = one
        try:
            value, w, multipliers = joint.least(first, shares)
            break
        except NoOptimum:
            if firsts is alone:
                raise
    # The price of a shared command is what a member would gain by another one; a limit's own is even among the members.
    at, prices = 0, []
    total, sharing = np.zeros(count), np.zeros(count)
    for braking, place, share in zip(brakings, places, shares):
        price = np.zeros(len(place))
        mine = np.array([index for _, index in braking.shared], dtype=int)
        price[mine] = -braking.gradient(w[place], COST / share, multipliers[at:at + braking.constraints]).full().ravel()[mine]
        total[place[mine]] += price[mine]
        sharing[place[mine]] += 1.0
        at += braking.constraints
        prices.append(price)
    for braking, place, price in zip(brakings, places, prices):
        mine = np.array([index for _, index in braking.shared], dtype=int)
        price[mine] -= (total / np.maximum(sharing, 1.0))[place[mine]]
    duals = []
    together = [w[place] for place in places]
    for problem, share, price, *firsts in zip(problems, shares, prices, together, alone):
        duals.append(min(problem.least(first, np.array([share]), price)[0] for first in firsts))
    shared = [price[[index for _, index in braking.shared]] for braking, price in zip(brakings, prices)]
    return Ignorance([float(one) for one in known_m], min(sum(duals), value) / COST - 1.0, value / COST - 1.0,
                     [price * share / COST for price, share in zip(shared, shares)],
                     [float(dual * share / COST) for dual, share in zip(duals, shares)])


def _guess(rig: Rig, start: np.ndarray, road: Sequence[Piece], end_speed_m_s: float) -> list[np.ndarray]:
    """Times and distances on each of a road's pieces, shape (2, points), in a plain braking, which may stop before the end."""
    for count in range(len(road), 0, -1):
        passed = [*road[:count - 1], dataclasses.replace(road[count - 1], end=math.inf)]
        phases = Guesser(rig).phases(Policy(GUESSES[0]), start, 0.0, passed, end_speed_m_s)
        if phases:
            return [np.concatenate([(phase.time_s, np.array(phase.states)[:, DISTANCE]) for phase in phases
                                    if phase.piece is piece], axis=1) for piece in passed]
    raise NoOptimum('no first guess gets to the end of the road')


def _intervals(duration_s: float) -> np.ndarray:
    return _mesh(duration_s) * duration_s


def of_tyres(rigs: Sequence[Rig], start: np.ndarray, periods: int, end_speed_m_s: float) -> list[Member]:
    """A family of tyres on an even road, whose commands agree for some periods."""
    common, members = Part(np.full(periods, PERIOD_S), 1.0, 'start'), []
    for rig in rigs:
        stop_s = _guess(rig, start, [EVEN], end_speed_m_s)[0][0, -1]
        members.append(Member(rig, start, [EVEN], [common, Part(_intervals(stop_s - periods * PERIOD_S), 1.0, free=True)],
                              end_speed_m_s))
    return members


def of_roads(rig: Rig, start: np.ndarray, roads: Sequence[Sequence[Piece]], end_speed_m_s: float) -> list[Member]:
    """A family of roads that differ by the place of their first change, in its order. The commands agree up to the change if it is
    at a distance: its time within a control period is unknown. They agree up to the next control period if it is at a time."""
    spine: list[Part] = []
    before, members = 0.0, []  # the place up to which there are parts
    for number, road in enumerate(roads):
        guess, first = _guess(rig, start, road, end_speed_m_s), road[0]
        (times, distances), in_m, waited_s = guess[0], first.along == 'distance', 0.0
        own: list[Part] = []
        begin_s = float(np.interp(before, distances, times)) if in_m else before
        lengths_s = _intervals(times[-1] - begin_s)
        places_m = np.interp(begin_s + np.cumsum([0.0, *lengths_s]), times, distances)
        places_m[[0, -1]] = before, first.end
        spine.append(Part(lengths_s, first.value, f'{number}', lengths_m=np.diff(places_m) if in_m else None))
        if not in_m:
            waited_s = (math.floor(first.end / PERIOD_S + 1e-6) + 1) * PERIOD_S - first.end
            own.append(Part(np.array([waited_s]), road[1].value, f'{number} period'))
        durations_s = [times[-1] - times[0] for times, _ in guess]
        durations_s[1] -= waited_s
        for piece, duration_s, last in zip(road[1:], durations_s[1:], [False] * (len(guess) - 2) + [True]):
            own.append(Part(_intervals(duration_s), piece.value, '', in_m or last, piece.end if in_m and not last else None))
        members.append(Member(rig, start, road[:len(guess)], [*spine, *own], end_speed_m_s))
        if not in_m:
            spine.append(Part(np.array([waited_s]), first.value, f'{number} period'))
        before = first.end + waited_s
    return members


def spread_counts(rigs: Sequence[Rig], start: np.ndarray, periods: int) -> np.ndarray:
    """D(k) of two tyres for k below `periods`, by which their force at a slip may differ.

    Under a common command the difference of the slips is held back by the tyre whose force still rises, so the forces differ
    by no more than the curves do at the slips that full torque reaches. Infinite where neither rises.
    """
    rises_to = max(math.tan(0.5 * math.pi / max(rig['C'], 1.0 + 1e-9)) / rig['B'] for rig in rigs)
    slips = np.linspace(0.0, 1.0, 4001)
    one, other = (rig['theta_N'] * np.sin(rig['C'] * np.arctan(rig['B'] * slips)) for rig in rigs)
    apart = np.maximum.accumulate(np.abs(one - other))
    each, steps = 10, 10 * periods
    step_s, reached = PERIOD_S / each, np.zeros(steps + 1)
    for rig in rigs:
        rates, x = rig.rates_function(), np.asarray(start, dtype=float)
        for k in range(1, steps + 1):
            middle = x + 0.5 * step_s * rates(x, rig.torque_rate_Nm_s(x, rig.max_torque_Nm), 1.0).full().ravel()
            x = x + step_s * rates(middle, rig.torque_rate_Nm_s(middle, rig.max_torque_Nm), 1.0).full().ravel()
            x[SLIP] = min(x[SLIP], 1.0)
            reached[k] = max(reached[k], reached[k - 1], x[SLIP])
    rig = rigs[0]
    angle = np.cumsum(np.cumsum(np.interp(reached, slips, apart))) * step_s ** 2
    counts = VISCOUS * angle * (rig['r1_m'] / rig['J1_kg_m2'] + rig['r2_m'] / rig['J2_kg_m2']) / (
        2.0 * math.pi / rig['encoder_counts_per_rev'])
    return np.asarray(np.where(reached <= rises_to, counts, np.inf)[::each][:periods])


def of_tyres_parting(rigs: Sequence[Rig], start: np.ndarray, end_speed_m_s: float) -> list[tuple[float, list[Member]]]:
    """S(n_j) and the family of two tyres that agree for n_j periods; both start with the same slip."""
    apart = spread_counts(rigs, start, 100)
    agree = np.maximum(0.0, 1.0 - np.concatenate([[0.0], np.cumsum(apart)[:-1]]))  # S(n)
    periods = [int(np.sum(agree >= least)) - 1 for least in AGREE]
    return [(float(agree[count]), of_tyres(rigs, start, count, end_speed_m_s)) for count in periods]


def bound(losses: Iterable[tuple[float, float]]) -> float:
    """Of the theorem, from S(n_j) and lower bounds of m(n_j)."""
    whole, before = 0.0, 0.0
    for agree, loss in losses:
        whole += max(loss - before, 0.0) * agree
        before = max(loss, before)
    return whole
