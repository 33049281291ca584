"""What can be identified: one row for each parameter, and the forms of the plant."""
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ..core import _core
from ..options import PathLike, options

#: the inputs' delay behind the row's time, s; of logs, not of the plant
DELAY = 'delay_s'


@dataclass(frozen=True)
class Parameter:
    """A number of the plant: its key without "plant."; `acts` says when it matters (python/src/identification.cpp);
    `floor` is the least size that a step relates to, for those that may be 0; `cure` is what would tell it; `prior` is the
    relative standard deviation of the first value, which decides only what the logs do not; `none` is the value of a flaw
    that is not there."""
    key: str
    unit: str
    acts: str
    cure: str
    floor: float = 0.0
    least: float = 0.0
    most: float = np.inf
    prior: float = 0.7
    none: float = 0.0


_SHARED = (
    Parameter('r1_m', 'm', 'contact', 'any log with both wheels rolling together', least=0.011, most=0.9, prior=0.2),
    Parameter('J1_kg_m2', 'kg m^2', 'always', 'lifted', least=1e-4, most=0.9),
    Parameter('d1_Nms_rad', 'N m s/rad', 'always', 'lifted', floor=1e-4, most=0.09),
    Parameter('d2_Nms_rad', 'N m s/rad', 'always', 'lifted', floor=1e-4, most=0.09),
    Parameter('M10_Nm', 'N m', 'always', 'lifted', floor=5e-3, most=9.0),
    Parameter('M20_Nm', 'N m', 'always', 'lifted', floor=2e-2, most=9.0),
    Parameter('b1_Nm', 'N m', 'brake', 'duty-ramp', most=900.0),
    Parameter('b2_Nm', 'N m', 'brake', 'duty-ramp', floor=0.5, least=-900.0, most=900.0),
    Parameter('c31_per_s', '1/s', 'brake', 'pulses', most=900.0),
    Parameter('u0', '1', 'brake', 'duty-ramp', most=0.999),
    Parameter('motor_stall_torque_Nm', 'N m', 'motor', 'pulses', most=90.0),
    Parameter('motor_no_load_speed_rad_s', 'rad/s', 'motor', 'lifted', most=1900.0),
)
_THETA = Parameter('theta_N', 'N', 'contact', 'slip-sweep or locked-stop', most=450.0)
_LEVER = Parameter('lever_Mg_Nm', 'N m', 'contact', 'slip-sweep and pulses', most=900.0)
_MU_PEAK = Parameter('mu_peak', '1', 'contact', 'slip-sweep or locked-stop', most=9.0)
_MAGIC = (
    Parameter('B', '1', 'contact', 'slip-sweep', most=190.0),
    Parameter('C', '1', 'contact', 'slip-sweep or locked-stop', most=2.0),
)
_MAKERS = (
    Parameter('mu_w4', '1', 'contact', 'slip-sweep or locked-stop', most=9.0),
    Parameter('mu_a', '1', 'contact', 'slip-sweep', most=9.0, prior=2.0),
    Parameter('mu_p', '1', 'contact', 'slip-sweep', least=1.0, most=10.0),
    Parameter('mu_w1', '1', 'contact', 'locked-stop', floor=0.05, least=-1.0, most=1.0, prior=1.0),
    Parameter('mu_w3', '1', 'contact', 'locked-stop', floor=0.05, least=-1.0, most=1.0, prior=1.0),
)
#: the fastest change of the brake's torque; fitted where the logs show one
RATE_LIMIT = Parameter('brake_rate_limit_Nm_s', 'N m/s', 'brake', 'locked-stop or pulses', least=0.5, most=9e5)
#: flaws of brake and tyre; fitted where the logs show them (structure.py). The prior is wide: it must not hold them at
#: `none`. Those that act as "flaw" change the duties that the fit simulates (brake_flaws.py), the others its plant
FADING = Parameter('brake_fading_per_J', '1/J', 'flaw', '', floor=1e-4, most=0.1, prior=20.0)
COOLING = Parameter('brake_cooling_per_s', '1/s', 'flaw', '', floor=0.05, most=10.0, prior=20.0)
HYSTERESIS = Parameter('brake_hysteresis', '1', 'flaw', '', floor=0.05, most=0.5, prior=20.0)
DEAD_TIME = Parameter('brake_dead_time_s', 's', 'flaw', '', floor=1e-3, most=0.05, prior=20.0)
CURVATURE = Parameter('brake_curvature', '1', 'flaw', '', floor=0.05, least=-0.9, most=0.9, prior=20.0)
RELEASE = Parameter('brake_release_ratio', '1', 'brake', '', least=0.1, most=10.0, prior=20.0, none=1.0)
FRICTION_FALL = Parameter('friction_fall_s_m', 's/m', 'contact', '', floor=1e-3, most=0.05, prior=20.0)
FLAWS = (FADING, COOLING, HYSTERESIS, DEAD_TIME, CURVATURE, RELEASE, FRICTION_FALL)
#: all that may join a form's parameters, in this order
JOINING = {one.key: one for one in (RATE_LIMIT, *FLAWS, Parameter(DELAY, 's', 'always', '', floor=1e-3))}
WHEELS = ('upper', 'lower')


@cache
def disc_of(wheel: str, log: int) -> tuple[Parameter, Parameter]:
    """What an eccentric disc adds to the readings of one log: sine and cosine of its angle, from the counter's zero. Each
    log has its own, because counters may begin anew."""
    sine, cosine = (Parameter(f'{wheel}_disc_{part}_{log + 1}_rad', 'rad', 'reading', 'lifted', floor=0.02, least=-0.1,
                              most=0.1, prior=1.0) for part in ('sine', 'cosine'))
    return sine, cosine


#: the shipped ones that serve, in the order in which a report weighs them
EXPERIMENTS = ('lifted', 'duty-ramp', 'pulses', 'slip-sweep', 'locked-stop', 'coast-down')
#: given by the person: no log tells the scale of all torques and inertias, nor the scale of length
GIVEN = {'J2_kg_m2': 'kg m^2', 'r2_m': 'm'}


@dataclass(frozen=True)
class Form:
    """A form of the plant. `road` names the parameters that a factor over the tyre's force multiplies, its height first."""
    name: str
    meaning: str
    settings: Mapping[str, str]
    parameters: tuple[Parameter, ...]
    road: tuple[str, ...]

    @property
    def tyre(self) -> tuple[Parameter, ...]:
        """What no other form has."""
        return tuple(p for p in self.parameters if p not in _SHARED)


def _form(tyre: str, load: str, own: tuple[Parameter, ...], *road: str) -> Form:
    meaning = ', '.join(({'magic-formula': 'magic formula', 'inteco-mu': "the maker's curve"}[tyre],
                         {'constant': 'constant load', 'lever': 'load by the lever'}[load]))
    return Form(tyre, meaning, {'plant.tyre': tyre, 'plant.load': load}, _SHARED + own, road)


#: all pairs of a tyre and a load
ALL_FORMS = (_form('magic-formula', 'constant', (_THETA, *_MAGIC), 'theta_N'),
             _form('inteco-mu', 'lever', (_LEVER, *_MAKERS), 'mu_w4', 'mu_w1', 'mu_w3'),
             _form('magic-formula', 'lever', (_LEVER, _MU_PEAK, *_MAGIC), 'mu_peak'),
             _form('inteco-mu', 'constant', (_THETA, *_MAKERS), 'theta_N'))
#: by tyre, those that are tried unless the start is one of the others
FORMS = {one.name: one for one in ALL_FORMS[:2]}

#: combinations that are known where their parts are not: name -> unit, parts, what tells them apart
COMBINATIONS = {
    'M10_plus_M20_Nm': ('N m', ('M10_Nm', 'M20_Nm'), 'lifted'),
    'd1_plus_d2_Nms_rad': ('N m s/rad', ('d1_Nms_rad', 'd2_Nms_rad'), 'lifted'),
    'theta_B_C_N': ('N', ('theta_N', 'B', 'C'), 'slip-sweep'),
}


def base_options(form: Form, start: PathLike) -> Any:
    """The start plant in this form, without what a log does not know: profiles of friction and drift."""
    given: dict[str, Any] = {**form.settings, 'plant.friction_profile': '', 'plant.ideal_actuator': False,
                             'plant.ideal_sensors': False, 'plant.max_step_s': 1e-3}
    # Flaws of brake, tyre and encoders that are estimated, or that no form of the plant has.
    given.update({f'plant.{flaw.key}': flaw.none for flaw in (RATE_LIMIT, *FLAWS)} | {'plant.encoder_eccentricity_rad': 0.0})
    given.update({f'plant.{wheel}_encoder_{flaw}': 0 for wheel in WHEELS
                  for flaw in ('eccentricity_rad', 'phase_rad', 'slot_error_counts', 'lost_counts')})
    given.update({f'plant.{key}': 0.0 for key in ('brake_overshoot', 'brake_ripple_Nm', 'brake_release_lead_s')})
    given.update({f'plant.{part}_profile': '' for part in ('brake_torque', 'motor_torque', 'upper_bearing', 'lower_bearing')})
    return _core.PlantOptions(options(plant=start, set=given))


def checked_keys(fixed: Mapping[str, float | None], start: PathLike) -> None:
    """Raises ValueError for a key that is no parameter of any form, and for a value outside its range."""
    known = {p.key for form in ALL_FORMS for p in form.parameters} | {*GIVEN, RATE_LIMIT.key}
    for key in fixed:
        if key not in known:
            raise ValueError(f'--fix {key}: no such parameter; give one of {", ".join(sorted(known))}')
    try:
        _core.PlantOptions(options(plant=start, set={f'plant.{key}': value for key, value in fixed.items() if value is not None}))
    except ValueError as error:
        raise ValueError(str(error).replace('--set: plant.', '--fix ')) from None
