"""The plant and the controllers, stepped by hand."""
import copy
from collections.abc import Mapping
from typing import Any

from .core import _core
from .options import PathLike, Value, options

PlantState = _core.PlantState
SlipInput = _core.SlipInput
SlipOutput = _core.SlipOutput


class _Kept:
    """A C++ object that can be copied and pickled: made again with its options, then it takes the state over."""

    def _begin(self, given: dict[str, Any]) -> None:
        super().__init__(given)  # type: ignore[call-arg]
        self._given = given

    def copy(self) -> Any:
        """The same with all of its state."""
        return copy.copy(self)

    def __reduce__(self) -> tuple[Any, ...]:
        return _made_again, (type(self), self._given, _core.version, self.state_bytes())  # type: ignore[attr-defined]


def _made_again(kind: Any, given: dict[str, Any], version: str, state: bytes) -> Any:
    if version != _core.version:
        raise ValueError(f'{kind.__name__} of abs_hil {version}: this is {_core.version}, which takes states of its own alone')
    made = kind.__new__(kind)
    made._begin(given)
    made.take_state_bytes(state)
    return made


class Plant(_Kept, _core.Plant):  # type: ignore[misc]
    """The simulated rig's mechanics, tyre, brake and motor (docs/plants.md), advanced by hand; deterministic.

    plant: a name or a TOML file. set: configuration values by dotted key, as {"plant.theta_N": 30}.

    reset(omega1_rad_s=0, omega2_rad_s=0, brake_torque_Nm=0, angle1_rad=0, angle2_rad=0): sets the state, and returns
        every profile to its start. Index 1: the upper, braked wheel; 2: the lower wheel.
    advance(duration_s, motor_duty=0, brake_duty=0, brake_torque_Nm=0): advances the plant by duration_s in [0, 1e6] s
        under constant inputs: duties in [0, 1]; brake_torque_Nm >= 0 needs plant.ideal_actuator.
    brake_duty_for(torque_Nm): the brake's duty whose static torque b(u) is nearest, in [0, 1]. The torque follows it with the
        brake's lag.
    state: an abs_hil.PlantState: angle1_rad, angle2_rad, omega1_rad_s, omega2_rad_s, brake_torque_Nm. It can be set; the
        profiles of road and drift then stay where they are.
    copy(), copy.copy(plant): the same plant with all of its state, to branch from (a controller that predicts). It can be
        pickled, too, for the same version of abs_hil; a plant from a file then reads the file again.
    slip, tyre_force_N, theta_N (the largest force that any slip could give now) and friction are the present values.
    Raises ValueError for an input that is no number or outside its range.
    """

    def __init__(self, plant: PathLike = 'paper-table1', set: Mapping[str, Value] | None = None) -> None:
        self._begin(options(plant=plant, set=set))


class Controller(_Kept, _core.Controller):  # type: ignore[misc]
    """A slip controller of the program, stepped by hand.

    name: as in abs_hil.controllers(). plant: the model that the controller believes in, a name or a TOML file.
    set: configuration values by dotted key, as {"control.adaptive.gamma": 60}.

    reset(input): starts braking. step(input): one control period; returns an abs_hil.SlipOutput. The first step has the
    input of reset and dt_s = 0. signals: name -> meaning of the values in SlipOutput.signals. copy() and pickle as Plant.
    """

    def __init__(self, name: str = 'adaptive', plant: PathLike = 'paper-table1',
                 set: Mapping[str, Value] | None = None) -> None:
        self._begin(options(controller=name, plant=plant, set=set))

    def __repr__(self) -> str:
        return f'<abs_hil.Controller {self.name}>'


SlipInput.__doc__ = """What a slip controller gets in one cycle, SI units (include/abs_hil/control/slip_controller.hpp).

dt_s: time since the previous step, > 0; 0 in the first step. omega1_rad_s, omega2_rad_s: estimated wheel speeds.
slip, slip_ref: estimated slip and its reference. brake_torque_Nm: torque estimated to act now; mean_brake_torque_Nm: its
mean over the past interval; max_brake_torque_Nm: the largest that the actuator can give. alpha1_rad_s2, alpha2_rad_s2:
estimated accelerations. upper_travel_rad, lower_travel_rad: angles over the past interval, NaN if unknown.
sent_brake_torque_Nm: static torque that was sent in the previous cycle; unsent_torque_Nm: what was missing in it of the
controller's previous output; while it is not 0, an integral that drives the output further out must stand.
"""
SlipOutput.__doc__ = """What a slip controller returns: brake_torque_Nm, the static torque b(u); NaN or infinity end the run.

slip_velocity_error_m_s, theta_est_N, slip_ref: NaN if the controller does not give them. signals: at most 8 values, in the
order of the controller's signals.
"""
