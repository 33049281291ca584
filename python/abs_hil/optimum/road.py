"""Pieces of road, as `plant.friction_profile` gives them."""
import math
from dataclasses import dataclass
from typing import TypeVar

import casadi as ca

from ..core import _core
from .rig import Rig

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


def road_of(rig: Rig) -> list[Piece]:
    """The pieces of the plant's friction profile. Braking begins at once, so both origins of a profile are the same."""
    text = str(rig.values['friction_profile'])
    if not text:
        return [Piece(1.0)]
    axis, _, parts = _core.profile_of(text, 'plant.friction_profile')
    ends = [begin for begin, _, _ in parts[1:]] + [math.inf]
    return [Piece(value, slope, begin, end, axis) for (begin, value, slope), end in zip(parts, ends)]
