#!/usr/bin/env python3
"""usage: unknown_rig.py SEED FILE.toml [--wanders]

Writes a simulated rig that a class does not know: the plant paper-table1 with a tyre, wheels, brake, bearings and motor of
its own, drawn from SEED. With --wanders its grip, brake, motor and bearings also change a little all the time, and both
encoder discs sit off their centres. Standard library only. J2 and r2 stay those of Table 1, as if somebody had measured them.
"""
import random
import sys

#: key: (value of paper-table1, largest relative change)
DRAWN = {'theta_N': (23.0, 0.4), 'B': (28.0, 0.15), 'C': (1.68, 0.05), 'J1_kg_m2': (7.54e-3, 0.1), 'r1_m': (0.0995, 0.005),
         'd1_Nms_rad': (118.74e-6, 0.2), 'd2_Nms_rad': (214.68e-6, 0.2), 'M10_Nm': (0.0032, 0.2), 'M20_Nm': (0.0925, 0.2),
         'b1_Nm': (15.24, 0.1), 'u0': (0.415, 0.05), 'c31_per_s': (20.37, 0.2),
         'motor_stall_torque_Nm': (2.1122, 0.05), 'motor_no_load_speed_rad_s': (220.0, 0.02)}
#: standard deviation of the factors, as research/identification_study.py --disturbed has them
WANDERS = {'friction': 0.01, 'brake_torque': 0.01, 'motor_torque': 0.005, 'upper_bearing': 0.05, 'lower_bearing': 0.05}
STEP_S, LAST_S = 0.2, 60.0
ECCENTRICITY_RAD = 0.004


def wandering(sd, chance):
    """A profile: straight lines between values every STEP_S."""
    values = [1 + chance.gauss(0, sd) for _ in range(int(LAST_S / STEP_S) + 1)]
    pieces = [f'{values[0]:.5f}'] + [f'{value:.5f} from {k * STEP_S:.1f} to {(k + 1) * STEP_S:.1f}'
                                     for k, value in enumerate(values[1:])]
    return 'time: ' + '; '.join(pieces)


def rig(seed, wanders):
    """The file's text."""
    chance = random.Random(seed)
    values = {key: value * (1 + spread * chance.uniform(-1, 1)) for key, (value, spread) in DRAWN.items()}
    values['b2_Nm'] = 0.1 - values['b1_Nm'] * values['u0']  # the map begins at u0 with a small torque
    lines = [f'description = "unknown rig {seed}"', '', '[plant]']
    lines += [f'{key} = {value:.6g}' for key, value in values.items()]
    if wanders:
        for wheel in ('upper', 'lower'):
            lines += [f'{wheel}_encoder_eccentricity_rad = {ECCENTRICITY_RAD * chance.uniform(0.5, 1):.6g}',
                      f'{wheel}_encoder_phase_rad = {chance.uniform(-3, 3):.6g}']
        lines += [f'{part}_profile = "{wandering(sd, chance)}"' for part, sd in WANDERS.items()]
    return '\n'.join(lines) + '\n'


def main():
    words = [word for word in sys.argv[1:] if word != '--wanders']
    if len(words) != 2 or not words[0].isdecimal() or not words[1].endswith('.toml'):
        print(__doc__, file=sys.stderr)
        return 2
    with open(words[1], 'w', encoding='utf-8') as file:
        file.write(rig(int(words[0]), '--wanders' in sys.argv[1:]))
    print(f'{words[1]}: use it with --plant {words[1]}; its parameters are the answer, so do not read it')
    return 0


if __name__ == '__main__':
    sys.exit(main())
