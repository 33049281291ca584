"""abs_hil rig: a simulated rig that a class does not know (docs/class.md).

The plant paper-table1 with a tyre, wheels, brake, bearings and motor of its own, drawn from a seed. A wandering one's grip,
brake, motor and bearings also change a little all the time, and both encoder discs sit off their centres. J2 and r2 stay those
of Table 1, as if somebody had measured them.
"""
import argparse
import random

from . import parsers
from .files import refuse_existing, write_text
from .options import as_main
from .simulation import keys

#: key: largest change, over the value of START
START = 'paper-table1'
SPREADS = {'theta_N': 0.4, 'B': 0.15, 'C': 0.05, 'J1_kg_m2': 0.1, 'r1_m': 0.005, 'd1_Nms_rad': 0.2, 'd2_Nms_rad': 0.2,
           'M10_Nm': 0.2, 'M20_Nm': 0.2, 'b1_Nm': 0.1, 'u0': 0.05, 'c31_per_s': 0.2, 'motor_stall_torque_Nm': 0.05,
           'motor_no_load_speed_rad_s': 0.02}
#: standard deviation of the factors, as research/identification_study.py --disturbed has them
WANDERS = {'friction': 0.01, 'brake_torque': 0.01, 'motor_torque': 0.005, 'upper_bearing': 0.05, 'lower_bearing': 0.05}
STEP_S, LAST_S = 0.2, 60.0
ECCENTRICITY_RAD = 0.004


def _wandering(sd: float, chance: random.Random) -> str:
    """A profile: straight lines between values every STEP_S."""
    values = [1 + chance.gauss(0, sd) for _ in range(int(LAST_S / STEP_S) + 1)]
    pieces = [f'{values[0]:.5f}'] + [f'{value:.5f} from {k * STEP_S:.1f} to {(k + 1) * STEP_S:.1f}'
                                     for k, value in enumerate(values[1:])]
    return 'time: ' + '; '.join(pieces)


def unknown_rig(seed: int, wanders: bool) -> str:
    """The text of its plant's file, which is the same for a seed on every computer."""
    chance = random.Random(seed)
    start = keys(plant=START)
    values = {key: start[f'plant.{key}']['value'] * (1 + spread * chance.uniform(-1, 1)) for key, spread in SPREADS.items()}
    values['b2_Nm'] = 0.1 - values['b1_Nm'] * values['u0']  # the map begins at u0 with a small torque
    lines = [f'description = "unknown rig {seed}"', '', '[plant]']
    lines += [f'{key} = {value:.6g}' for key, value in values.items()]
    if wanders:
        for wheel in ('upper', 'lower'):
            lines += [f'{wheel}_encoder_eccentricity_rad = {ECCENTRICITY_RAD * chance.uniform(0.5, 1):.6g}',
                      f'{wheel}_encoder_phase_rad = {chance.uniform(-3, 3):.6g}']
        lines += [f'{part}_profile = "{_wandering(sd, chance)}"' for part, sd in WANDERS.items()]
    return '\n'.join(lines) + '\n'


@as_main(parsers.rig)
def main(o: argparse.Namespace) -> None:
    refuse_existing(o.out, '--out', o.force)
    write_text(o.out, unknown_rig(o.seed, o.kind == 'wandering'))
    print(f'{o.out}: use it with --plant {o.out}; its parameters are the answer, so do not read it')
