"""A rig by equations of its own, in Python, with a brake or a tyre that the plant has or lacks (docs/identification.md).

Wheels: J1 w1' = r1 F - T - M10 - d1 w1,  J2 w2' = M - r2 F - M20 - d2 w2. Magic formula under a constant load:
F = theta sin(C atan(B s)), s = (r2 w2 - r1 w1) / max(r2 w2, r1 w1). Brake: T' = c31 (b(u) - T). Motor:
M = stall u (1 - w2 / no-load).
It shares no line with plant_sim, and takes half a millisecond a step (midpoint rule).
"""
import dataclasses
import math

import numpy as np

#: of friction, brake, motor, upper and lower bearing: standard deviation of the factors, in straight lines over WANDER_S
WANDER = (0.01, 0.01, 0.005, 0.05, 0.05)
WANDER_S = 0.2
STEP_S = 5e-4
STRIBECK_M_S = 3.0
PER_COUNT_RAD = 2 * math.pi / 4096


def driven(log, values, random, wander=1.0, release=1.0, curvature=0.0, by_sliding_s_m=0.0, by_speed_s_m=0.0,
           fading_per_J=0.0, cools_in_s=math.inf, slots=0.0, stiff=0.0, at_rest=0.0, jitter_s=0.0, play=0.0, lever_s=0.0,
           second_lag_s=0.0, bits=0, eccentric_rad=0.0, stiction=0.0):
    """The log whose duties drive such a rig, with other counts.

    values: the plant's keys; wander: over WANDER; release: how much faster the brake lets go than it takes hold;
    curvature: share of the straight map that a small torque lacks; by_sliding_s_m, by_speed_s_m: by how much of itself the
    friction falls for each m/s between the wheels' surfaces, and of the lower one; fading_per_J: share of the brake's
    torque lost for each joule in it, which leaves it over `cools_in_s`; slots: by how much of a count every second edge of the
    upper disc comes late; stiff: by how much of itself more both bearings drag at first, which passes in 8 s; at_rest: share of
    the friction that a sliding tyre loses, most of it within STRIBECK_M_S; jitter_s: standard deviation of the time by which both
    encoders are read early or late; play: width of the lost motion between duty and lever; lever_s: lag of the lever, before the
    pads touch; second_lag_s: of a second lag behind the first; bits: of the board's duty, which the log does not know;
    eccentric_rad: of the upper disc, unknown where its middle lies; stiction: by how much of itself more both bearings drag at
    standstill, most of it within 3 rad/s
    """
    v = values
    angle1, angle2 = random.uniform(size=2) * PER_COUNT_RAD
    moved = (log.counts[40] - log.counts[0]) * PER_COUNT_RAD / (log.time_s[40] - log.time_s[0])
    w1, w2 = (float(speed) if moved[1] > 1.0 else 0.0 for speed in moved)
    torque = second = lever = held = heat_J = 0.0
    middle = random.uniform(-math.pi, math.pi) if eccentric_rad else 0.0
    places = int(log.time_s[-1] / WANDER_S) + 3
    factors = [1 + wander * sd * random.standard_normal(places) for sd in WANDER]

    def rates(w1, w2, torque, hot, drag, brake, motor, apart, factor):
        straight = max(0.0, v['b1_Nm'] * brake + v['b2_Nm']) if brake >= v['u0'] else 0.0
        target = straight * (1 + curvature * (straight / (v['b1_Nm'] + v['b2_Nm']) - 1)) * factor[1] * hot
        speed1, speed2 = v['r1_m'] * w1, v['r2_m'] * w2
        force, fastest = 0.0, max(abs(speed1), abs(speed2))
        if not apart and fastest > 0.02:
            theta = v['theta_N'] * factor[0] * (1 - by_sliding_s_m * abs(speed2 - speed1)) * (1 - by_speed_s_m * abs(speed2))
            theta *= 1 - at_rest * (1 - math.exp(-abs(speed2 - speed1) / STRIBECK_M_S))
            force = theta * math.sin(v['C'] * math.atan(v['B'] * (speed2 - speed1) / fastest))
        drive = v['motor_stall_torque_Nm'] * factor[2] * motor * (1 - w2 / v['motor_no_load_speed_rad_s'])
        slow1, slow2 = 1 + stiction * math.exp(-w1 / 3.0), 1 + stiction * math.exp(-w2 / 3.0)
        held1 = (second if second_lag_s else torque) + drag * factor[3] * (slow1 * v['M10_Nm'] + v['d1_Nms_rad'] * w1)
        held2 = drag * factor[4] * (slow2 * v['M20_Nm'] + v['d2_Nms_rad'] * w2)
        push1, push2 = v['r1_m'] * force, drive - v['r2_m'] * force
        return (0.0 if w1 <= 1e-9 and push1 <= held1 else (push1 - held1) / v['J1_kg_m2'],
                0.0 if w2 <= 1e-9 and push2 <= held2 else (push2 - held2) / v['J2_kg_m2'],
                v['c31_per_s'] * (release if target < torque else 1.0) * (target - torque))

    counts = np.zeros((len(log), 2))
    for row in range(len(log)):
        late_s = jitter_s * random.standard_normal() if jitter_s else 0.0
        seen = angle1 + late_s * w1
        pairs, part = divmod((seen + eccentric_rad * math.sin(seen + middle)) / PER_COUNT_RAD, 2.0)
        counts[row] = 2 * pairs + (part >= 1.0 + slots), math.floor((angle2 + late_s * w2) / PER_COUNT_RAD)
        if row + 1 == len(log):
            break
        interval = log.time_s[row + 1] - log.time_s[row]
        steps = max(1, round(interval / STEP_S))
        h = interval / steps
        place, part = divmod(log.time_s[row] / WANDER_S, 1.0)
        factor = [one[int(place)] * (1 - part) + one[int(place) + 1] * part for one in factors]
        asked = round(log.brake_pwm[row] * (2 ** bits - 1)) / (2 ** bits - 1) if bits else log.brake_pwm[row]
        held = min(max(held, asked - play / 2), asked + play / 2)
        for _ in range(steps):
            lever = lever + h / lever_s * (held - lever) if lever_s else held
            acts = lever, log.motor_pwm[row], log.wheels_apart[row] != 0, factor
            if second_lag_s:
                second += h / second_lag_s * (torque - second)
            hot = math.exp(-fading_per_J * heat_J)
            drag = 1 + stiff * math.exp(-log.time_s[row] / 8.0)
            heat_J += h * (torque * w1 - heat_J / cools_in_s)
            a = rates(w1, w2, torque, hot, drag, *acts)
            # A held wheel must not creep back by what the rule's half step overshoots.
            half1, half2 = max(0.0, w1 + 0.5 * h * a[0]), max(0.0, w2 + 0.5 * h * a[1])
            b = rates(half1, half2, torque + 0.5 * h * a[2], hot, drag, *acts)
            angle1, angle2 = angle1 + h * half1, angle2 + h * half2
            w1, w2, torque = max(0.0, w1 + h * b[0]), max(0.0, w2 + h * b[1]), max(0.0, torque + h * b[2])
    return dataclasses.replace(log, counts=counts - counts[0], first_counts=counts[0])
