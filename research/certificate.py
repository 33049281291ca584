"""The certificate of research/unknown.py: every priced braking of a family anew, by a dense dynamic programme.

The dual of unknown.py is a mean over the members i, each over its known_m, of the least value of

    distance + integral of price_i(z) u(z) dz

over the member's own commands u in [0, most]; z is time, or distance where the road changes in distance. The prices of the
members that agree at z, each over its known_m, cancel; then by weak duality any prices give a lower bound for commands of any
form, not only for those that are constant in the collocation's intervals - if each value is the least one. The collocation finds
local optima. The programme compares commands at every point of a grid and has none. Its prices are the collocation's, linear
between the middles of the intervals: constant ones would pay for commands that change within an interval.

V over slip s, speed of the lower wheel w and brake torque T goes backwards over layers of length h (research/layers.py), from
the end of the agreement, where V is what the known rest of the road takes:

    V(x) = min over u in {0, half, most} of distance(x, u, h) + price(layer) u + V_after(x after h under u)

The problem is linear in u, so the ends of its range and switching between them are enough. On the even road to the end V is the
limit of such layers without prices. The loss is the mean of (V with prices - V without) / known_m on one grid, so that what is
common to both errors cancels. What does not cancel - a coarse grid blurs T, as noise would - shows on two grids.
"""
from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from dense import Field
from layers import Axes, Grid, Layer
from unknown import Ignorance, Member

from abs_hil.optimum.rig import OMEGA2, SLIP, TORQUE, Rig

#: of the sums of the prices, in parts of their sizes
CANCEL = 1e-6
LEAST_SPEEDS = 6
#: speeds of the grid below the lowest that can be reached
MARGIN = 6
#: of an interval on which prices change
PARTS = 8
#: of an even road's values, m
STILL_M = 1e-6
#: of a braking
LONGEST_S = 10.0


@dataclasses.dataclass(frozen=True)
class Track:
    """A member's braking before its even tail: friction up to each of the places `ends`, and what 1 N m from the start to each of
    the places `marks` costs, m per N m; the places in s, or in m."""
    ends: np.ndarray
    frictions: list[float]
    tail_friction: float
    marks: np.ndarray
    costs: np.ndarray

    @staticmethod
    def of(member: Member, prices: np.ndarray | None = None) -> Track:
        """Raises ValueError for a road between the agreement and the tail whose length is free."""
        parts, ends = member.parts[:-1], [0.0]
        for part in parts:
            if (part.lengths_m is None) == in_m(member) and part.until_m is None:
                raise ValueError('a part is neither of time nor of distance, as the others are')
            ends.append(ends[-1] + float(part.lengths.sum()) if part.until_m is None else part.until_m)
        marks, costs, used = [0.0], [0.0], 0
        for part in (part for part in parts if part.key):
            own = np.zeros(len(part.lengths)) if prices is None else prices[used:used + len(part.lengths)]
            used += len(own)
            lengths, spread = _spread(part.lengths, own)
            marks.extend(marks[-1] + np.cumsum(lengths))
            costs.extend(costs[-1] + np.cumsum(spread))
        return Track(np.round(ends[1:], 9), [part.friction for part in parts], member.parts[-1].friction, np.array(marks),
                     np.array(costs))


def _spread(lengths: np.ndarray, prices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Parts of the intervals of a part, and their prices: the density is that of the interval in its middle and linear between."""
    fine = np.repeat(lengths / PARTS, PARTS)
    if len(lengths) < 2:
        return fine, np.repeat(prices / PARTS, PARTS)
    (middles, at), density = (np.cumsum(each) - 0.5 * each for each in (lengths, fine)), prices / lengths
    before = np.clip(np.searchsorted(middles, at) - 1, 0, len(lengths) - 2)
    share = (at - middles[before]) / (middles[before + 1] - middles[before])
    return fine, fine * ((1.0 - share) * density[before] + share * density[before + 1])


def in_m(member: Member) -> bool:
    return any(part.lengths_m is not None for part in member.parts)


class Programme:
    """The programme of one rig from one start, while the lower wheel is not slower than `lowest_rad_s`."""

    def __init__(self, member: Member, lowest_rad_s: float, grid: Grid) -> None:
        self._member, self._grid, self._rig = member, grid, member.rig
        self._fields: dict[float, Field] = {}
        self._layers: dict[tuple[float, float], Layer] = {}
        self._tails: dict[float, np.ndarray] = {}
        highest, least = float(member.start[OMEGA2]), member.end_speed_m_s / self._rig['r2_m']
        speeds = np.geomspace(least, highest, 1 + math.ceil(math.log(highest / least) / math.log1p(grid.speed_share)))
        self._first = max(0, min(int(np.searchsorted(speeds, lowest_rad_s)) - MARGIN, len(speeds) - LEAST_SPEEDS))
        self._every, self._axes = Axes(self._rig, speeds, grid), Axes(self._rig, speeds[self._first:], grid)
        self._commands = np.linspace(0.0, self._rig.max_torque_Nm, grid.commands)

    def _field(self, friction: float) -> Field:
        if friction not in self._fields:
            self._fields[friction] = field_of(self._rig, friction)
        return self._fields[friction]

    def _tail(self, friction: float) -> np.ndarray:
        """What the even road to the end takes from each point of the grid, m: layers from a guess on, until nothing changes."""
        if friction not in self._tails:
            layer = Layer(self._field(friction), self._every, self._commands, self._grid.layer_s, False)
            speeds = self._every.speed.points
            guess = 0.5 * self._rig['J2_kg_m2'] * (speeds ** 2 - speeds[0] ** 2) / (friction * self._rig['theta_N'])
            value = np.tile(guess[:, None, None], (self._grid.slips, 1, self._grid.torques, 1))
            for _ in range(math.ceil(LONGEST_S / self._grid.layer_s)):
                before, value = value, layer.before(value, np.zeros((len(self._commands), 1)))
                value[:, 0] = 0.0
                if np.abs(value - before).max() < STILL_M:
                    break
            else:
                raise ValueError('the values of an even road do not settle')
            self._tails[friction] = value[:, self._first:, :, 0]
        return self._tails[friction]

    def _back(self, value: np.ndarray, friction: float, places: np.ndarray, tracks: Sequence[Track]) -> np.ndarray:
        """The values at the first place from those at the last one, over even layers."""
        key = friction, round(places[1] - places[0], 9)
        if key not in self._layers:
            self._layers[key] = Layer(self._field(friction), self._axes, self._commands, key[1], in_m(self._member))
        costs = np.stack([np.diff(np.interp(places, track.marks, track.costs)) for track in tracks], axis=1)
        for cost in costs[::-1]:
            value = self._layers[key].before(value, self._commands[:, None] * cost)
        return value

    def values(self, tracks: Sequence[Track]) -> np.ndarray:
        """The least sums of distance and priced commands, m."""
        every = np.unique(np.concatenate([[0.0], *(track.ends for track in tracks)]))
        value = np.stack([self._tail(track.tail_friction) for track in tracks], axis=3)
        longest = self._grid.layer_m if in_m(self._member) else self._grid.layer_s
        for begin, end in zip(every[-2::-1], every[:0:-1]):
            groups: dict[float, list[int]] = {}
            for number, track in enumerate(tracks):
                if track.ends[-1] >= end:
                    groups.setdefault(track.frictions[int(np.searchsorted(track.ends, end))], []).append(number)
            places = np.linspace(begin, end, 1 + math.ceil((end - begin) / longest - 1e-6))
            for friction, numbers in groups.items():
                value[..., numbers] = self._back(value[..., numbers], friction, places, [tracks[n] for n in numbers])
        start = self._member.start
        for axis, at in ((self._axes.slip, self._axes.bent(0, start[SLIP])), (self._axes.speed, start[OMEGA2]),
                         (self._axes.torque, self._axes.bent(1, start[TORQUE]))):
            _, first, weights = axis.weights(np.array([at]))
            value = np.tensordot(weights[0], value[first[0]:first[0] + 4], 1)
        return np.asarray(value)


def field_of(rig: Rig, friction: float) -> Field:
    return Field('paper-table1', {f'plant.{name}': value for name, value in rig.values.items() if name != 'friction_profile'},
                 friction)


def lowest_rad_s(member: Member) -> float:
    """The lower wheel's speed before the tail if the tyre always had its largest force."""
    slips, speed, place = np.linspace(0.0, 1.0, 400), float(member.start[OMEGA2]), 0.0
    track = Track.of(member)
    for end, friction in zip(track.ends, track.frictions):
        field = field_of(member.rig, friction)
        for step in np.diff(np.linspace(place, end, 1 + math.ceil((end - place) / (0.05 if in_m(member) else 5e-3)))):
            x = np.stack([slips, np.full_like(slips, speed), np.full_like(slips, 0.0), np.zeros_like(slips)])
            slowing = float(field.rates(x, slips)[1].min())
            speed += step * slowing / (member.rig['r2_m'] * speed if in_m(member) else 1.0)
        place = end
    return speed


@dataclasses.dataclass(frozen=True)
class Certificate:
    """loss: of the programme. known_m, priced_m: the programme's, for each member."""
    loss: float
    known_m: list[float]
    priced_m: list[float]


def certify(families: Sequence[tuple[Sequence[Member], Ignorance]], grid: Grid | None = None) -> list[Certificate]:
    """Of families; members with the same rig and start share their grid. Raises ValueError where the prices do not cancel."""
    grid = grid or Grid()
    for members, found in families:
        _cancelling(members, found)
    cells: dict[str, list[tuple[int, int]]] = {}
    for row, (members, _) in enumerate(families):
        for number, member in enumerate(members):
            cells.setdefault(repr((sorted(member.rig.values.items()), list(member.start))), []).append((row, number))
    values: dict[tuple[int, int], tuple[float, float]] = {}
    for places in cells.values():
        members = [families[row][0][number] for row, number in places]
        programme = Programme(members[0], min(lowest_rad_s(member) for member in members), grid)
        free = [Track.of(member) for member in members]
        priced = [Track.of(member, families[row][1].prices[number]) for member, (row, number) in zip(members, places)]
        for place, *both in zip(places, *programme.values([*free, *priced]).reshape(2, -1)):
            values[place] = float(both[0]), float(both[1])
    made = []
    for row, (members, found) in enumerate(families):
        known_m, priced_m = zip(*(values[row, number] for number in range(len(members))))
        made.append(Certificate(float(np.mean((np.array(priced_m) - known_m) / found.known_m)), list(known_m), list(priced_m)))
    return made


def _cancelling(members: Sequence[Member], found: Ignorance) -> None:
    sums: dict[str, list[float]] = {}
    for member, known_m, prices in zip(members, found.known_m, found.prices):
        keys = [f'{part.key} {number}' for part in member.parts if part.key for number in range(len(part.lengths))]
        for key, price in zip(keys, prices, strict=True):
            sums.setdefault(key, []).append(float(price) / known_m)
    for key, parts in sums.items():
        if abs(sum(parts)) > CANCEL * max(1e-9, sum(map(abs, parts))):
            raise ValueError(f'the prices of command {key} do not cancel: {parts}')
