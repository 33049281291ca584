"""One layer of the programme of research/certificate.py: motion and values on a grid of slip s, speed of the lower wheel w, and
brake torque T.

Every point of the grid moves under each command u for a length h, by Runge-Kutta steps of the plant's equations and forces in
C++ (dense.py); V(x) = distance(x, u, h) + V_after(x after h) takes V_after between the points by cubics. As the
friction is even within a layer, the ends are the same for all layers of a length: the weights are one sparse matrix. In a layer
of time T moves by itself, T' = c31 (u - T), so that the weights of T are a small matrix of their own.
"""
from __future__ import annotations

import dataclasses
import math

import numpy as np
from dense import STEP_SHARE, Field, on_road
from scipy.sparse import csr_array

from abs_hil.optimum.rig import Rig

#: part of the points that are dense
BENT = 0.6


@dataclasses.dataclass(frozen=True)
class Grid:
    """Points of slip and torque, largest step of the speed as a part of it, and layers."""
    slips: int = 60
    torques: int = 24
    speed_share: float = 0.08
    layer_s: float = 3e-3
    layer_m: float = 0.025
    commands: int = 3


class Axis:
    """Interpolation between points of a line: a cubic through four of them."""

    def __init__(self, points: np.ndarray) -> None:
        self.points = points

    def weights(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The cell of each place, the first of its four points, and their weights, shape (places, 4)."""
        cell = np.clip(np.searchsorted(self.points, at, side='right') - 1, 0, len(self.points) - 2)
        first = np.clip(cell - 1, 0, len(self.points) - 4)
        four = self.points[first[:, None] + np.arange(4)]
        parts = [np.prod([(at - four[:, other]) / (four[:, one] - four[:, other]) for other in range(4) if other != one], axis=0)
                 for one in range(4)]
        return cell, first, np.stack(parts, axis=1)


class Axes:
    """Of the grid. The axes of slip and torque are bent: part of their points is dense, by atan, up to the slip of the peak and to
    the torque that holds it."""

    def __init__(self, rig: Rig, speeds: np.ndarray, grid: Grid) -> None:
        self.speed = Axis(speeds)
        self.slip, self.torque = (Axis(np.linspace(0.0, 1.0, count)) for count in (grid.slips, grid.torques))
        self.counts = grid.slips, len(speeds), grid.torques
        even, self._values = np.linspace(0.0, 1.0, 100_001), []
        self._points = []
        for most, bent in ((1.0, rig['B']), (rig.max_torque_Nm, rig.max_torque_Nm / (rig['r1_m'] * rig['theta_N']))):
            self._values.append(most * even)
            self._points.append(BENT * np.arctan(bent * even) / math.atan(bent) + (1.0 - BENT) * even)

    def straight(self, number: int, points: np.ndarray) -> np.ndarray:
        """Slips (number 0) or torques (1) of points of the axis."""
        return np.interp(points, self._points[number], self._values[number])

    def bent(self, number: int, values: np.ndarray) -> np.ndarray:
        return np.interp(values, self._values[number], self._points[number])


class Layer:
    """One layer on one friction: where each point of the grid gets to under each command."""

    def __init__(self, field: Field, axes: Axes, commands: np.ndarray, length: float, in_m: bool) -> None:
        self._counts = axes.counts
        self._parts = [self._under(field, axes, u, length, in_m) for u in commands]

    def _under(self, field: Field, axes: Axes, u: float, length: float, in_m: bool) -> tuple[
            csr_array, np.ndarray | None, np.ndarray, np.ndarray]:
        """Weights of the values, those of the torques alone, the cells in which the ends lie, and the distances, m."""
        slip, torque = np.meshgrid(axes.straight(0, axes.slip.points), axes.straight(1, axes.torque.points), indexing='ij')
        ends = np.empty((4, *axes.counts))
        for number, speed in enumerate(axes.speed.points):
            x = np.stack([slip, np.full_like(slip, speed), torque, np.zeros_like(slip)]).reshape(4, -1)
            longest = STEP_SHARE * speed / field.steepest * (field.rig['r2_m'] * speed if in_m else 1.0)
            end = _drive(field, x, np.full(slip.size, u), length, math.ceil(length / longest), in_m)
            ends[:, :, number] = end.reshape(4, *slip.shape)
        before, least = axes.speed.points[:, None], axes.speed.points[0]
        ends[3] *= np.minimum(1.0, (before - least) / np.maximum(before - ends[1], 1e-9))
        ends[1] = np.maximum(ends[1], least)
        slips, speeds, torques = axes.slip.weights(axes.bent(0, ends[0].ravel())), axes.speed.weights(ends[1].ravel()), (
            axes.torque.weights(axes.bent(1, ends[2].ravel())))
        cells, mix = np.ravel_multi_index((slips[0], speeds[0], torques[0]), tuple(count - 1 for count in axes.counts)), None
        if not in_m:  # then the torque's way depends on nothing else, and the values are mixed before
            mix, own = np.zeros((axes.counts[2], axes.counts[2])), np.arange(axes.counts[2])
            np.put_along_axis(mix, torques[1][own][:, None] + np.arange(4), torques[2][own], axis=1)
            torques = torques[0], np.arange(len(cells)) % axes.counts[2], np.ones((len(cells), 1))
        places = np.ravel_multi_index((_near(slips)[:, :, None, None], _near(speeds)[:, None, :, None],
                                       _near(torques)[:, None, None]), axes.counts)
        weights = slips[2][:, :, None, None] * speeds[2][:, None, :, None] * torques[2][:, None, None]
        slide = csr_array((weights.ravel(), places.ravel().astype(np.int32),
                           np.arange(0, weights.size + 1, weights[0].size, dtype=np.int32)), shape=(len(cells), len(cells)))
        return slide, mix, cells, ends[3].reshape(-1, 1)

    def before(self, value: np.ndarray, prices: np.ndarray) -> np.ndarray:
        """The values one layer earlier, shape (slips, speeds, torques, columns), under prices of the commands, shape (commands,
        columns). No value goes beyond the corners of its cell: else the overshoots of cubics at steps grow from layer to layer."""
        columns, limits, best = value.shape[-1], [], np.inf
        for limit, near in ((np.maximum, np.minimum), (np.minimum, np.maximum)):
            corners = near(value[1:], value[:-1])
            corners = near(corners[:, 1:], corners[:, :-1])
            limits.append((limit, near(corners[:, :, 1:], corners[:, :, :-1]).reshape(-1, columns)))
        for (slide, mix, cells, distance_m), price in zip(self._parts, prices):
            whole = slide @ (value if mix is None else mix @ value).reshape(-1, columns)
            for limit, corners in limits:
                limit(whole, corners[cells], out=whole)
            whole += distance_m
            whole += price
            best = np.minimum(best, whole, out=whole)
        return np.asarray(best).reshape(*self._counts, columns)


def _near(weights: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    """Numbers of the points that the weights belong to."""
    return weights[1][:, None] + np.arange(weights[2].shape[1])


def _drive(field: Field, x: np.ndarray, u: np.ndarray, length: float, steps: int, in_m: bool) -> np.ndarray:
    """The states after a length in s or m."""
    def rates(at: np.ndarray) -> np.ndarray:
        slopes = field.rates(on_road(at), u)
        return slopes / slopes[3] if in_m else slopes
    h = length / steps
    for _ in range(steps):
        k1 = rates(x)
        k2 = rates(x + 0.5 * h * k1)
        k3 = rates(x + 0.5 * h * k2)
        x = on_road(x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + rates(x + h * k3)))
    return x
