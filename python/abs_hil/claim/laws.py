"""The laws of the comparison, their gains as configuration keys, and the files that hold them."""
from __future__ import annotations

import pathlib
from collections.abc import Mapping
from dataclasses import dataclass

from .criteria import THETA0_N


@dataclass(frozen=True)
class Law:
    """A law that the comparison searches gains for."""
    controller: str
    meaning: str
    theta0: str  #: key of its first estimate
    gain: str | None = None  #: key of its switching gain K, m/s^2
    theta_bound: str | None = None  #: key of the largest estimate, above the theta of every plant

    def fixed(self) -> dict[str, float]:
        """What is the same for every law."""
        return {self.theta0: THETA0_N}


LAWS: Mapping[str, Law] = {law.controller: law for law in (
    Law('adaptive', "the paper's law (17)-(18)", 'control.adaptive.zeta0'),
    Law('sliding-mode', 'first order: equivalent control, theta_hat and -K sign(e_v)', 'control.sliding_mode.theta0_N',
        'control.sliding_mode.gain_m_s2'),
    Law('sliding-mode-smooth', 'the same with a boundary layer', 'control.sliding_mode_smooth.theta0_N',
        'control.sliding_mode_smooth.gain_m_s2'),
    Law('super-twisting', 'second order: continuous, without K', 'control.super_twisting.theta0_N'),
    Law('sliding-mode-actuator', "stepped back through the brake's lag (6)", 'control.sliding_mode_actuator.theta0_N',
        'control.sliding_mode_actuator.gain_m_s2'),
)}

#: K and gamma of the first-order law, over which the map is drawn
MAP_KEYS = ('control.sliding_mode.gain_m_s2', 'control.sliding_mode.gamma')


def gains_file(folder: pathlib.Path, actuator: str, controller: str) -> pathlib.Path:
    """config/paper/real/sliding-mode.toml and so on."""
    return folder / actuator / f'{controller}.toml'
