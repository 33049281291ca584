#!/usr/bin/env python3
"""Fits the controllers' tyre model for the plant inteco-manual: theta, B and C of theta sin(C atan(B slip)).

usage: research/fit_inteco_tyre.py [PLANT.toml | --sentences]    default: config/plants/inteco-manual.toml
--sentences prints the sentence of docs/plants.md alone.

The plant's tyre force depends on the slip and, through the lever, on the brake torque. In braking at a constant slip
the slip determines the brake torque. The fit therefore uses the force F(slip) there, at half the initial speed of
braking (the force changes by 0.2 % between 170 rad/s and standstill). With r1 w1 = (1 - s) r2 w2, hence w1' = k w2',
k = (1 - s) r2 / r1:
    F = mu Fn,  Fn L (sin phi - mu cos phi) = Mg + M10 + M1 + d1 w1 = Mg + r1 F - J1 k w2',
    J2 w2' = -(r2 F + d2 w2 + M20)
which is linear in F. The fit is by least squares over slips 0.005, 0.01 ... 0.5, the range of a slip controller; slip 1
is outside. For given B and C the best theta has a closed form. The script searches (B, C) with halving steps.
"""
import math
import pathlib
import sys
import tomllib

OMEGA2_RAD_S = 85.0
SLIPS = [0.005 * i for i in range(1, 101)]


def friction(p, slip):
    power = slip ** p['mu_p']
    return (p['mu_w4'] * power / (p['mu_a'] + power) + p['mu_w3'] * slip ** 3 + p['mu_w2'] * slip ** 2
            + p['mu_w1'] * slip)


def force_N(p, slip, omega2_rad_s=OMEGA2_RAD_S):
    mu = friction(p, slip)
    phi = math.radians(p['lever_phi_deg'])
    arm_m = p['lever_L_m'] * (math.sin(phi) - mu * math.cos(phi))
    k = (1.0 - slip) * p['r2_m'] / p['r1_m']
    drag_Nm = p['d2_Nms_rad'] * omega2_rad_s + p['M20_Nm']
    inertia = p['J1_kg_m2'] * k / p['J2_kg_m2']
    return (p['lever_Mg_Nm'] + inertia * drag_Nm) / (arm_m / mu - p['r1_m'] - inertia * p['r2_m'])


def best_theta(forces, B, C):
    """theta and the sum of squared errors it leaves."""
    shapes = [math.sin(C * math.atan(B * slip)) for slip in SLIPS]
    theta = sum(f * s for f, s in zip(forces, shapes)) / sum(s * s for s in shapes)
    return theta, sum((f - theta * s) ** 2 for f, s in zip(forces, shapes))


def fit(forces):
    B, C = 30.0, 1.2
    step_B, step_C = 8.0, 0.2
    best = best_theta(forces, B, C)[1]
    while step_B > 1e-9:
        moves = [(B + i * step_B, C + j * step_C) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        moves = [(b, c) for b, c in moves if b > 0.0 and 0.0 < c <= 2.0]
        errors = [best_theta(forces, b, c)[1] for b, c in moves]
        if min(errors) < best:
            best = min(errors)
            B, C = moves[errors.index(best)]
        else:
            step_B, step_C = 0.5 * step_B, 0.5 * step_C
    return best_theta(forces, B, C)[0], B, C, best


def main():
    default = pathlib.Path(__file__).parents[1] / 'config' / 'plants' / 'inteco-manual.toml'
    sentences = sys.argv[1:] == ['--sentences']
    file = default if sentences or len(sys.argv) < 2 else pathlib.Path(sys.argv[1])
    plant = tomllib.loads(file.read_text())['plant']
    forces = [force_N(plant, slip) for slip in SLIPS]
    theta, B, C, squares = fit(forces)
    if sentences:
        print(f'prints θ = {theta:.2f} N, B = {B:.2f}, C = {C:.4f} and leaves {math.sqrt(squares / len(SLIPS)):.2f} N RMS')
        return
    print(f'theta_N = {theta:.2f}\nB = {B:.2f}\nC = {C:.4f}')
    print(f'rms error {math.sqrt(squares / len(SLIPS)):.3f} N')
    print('slip   force N   fit N')
    for slip in (0.01, 0.02, 0.03, 0.05, 0.07, 0.10, 0.15, 0.20, 0.30, 0.50, 1.0):
        print(f'{slip:4.2f}   {force_N(plant, slip):7.2f}   {theta * math.sin(C * math.atan(B * slip)):7.2f}')


if __name__ == '__main__':
    main()
