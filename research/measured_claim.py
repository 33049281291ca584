#!/usr/bin/env python3
"""usage: measured_claim.py --check|--write

What the paper's claim becomes on rigs as measured: stops from 170 rad/s by several laws with their shipped gains, each on the
plants of the two measured sessions and on rigs that are drawn as measured (`--vary measured,phase`). Ratios are those to
`sliding-mode`, run by run. And how long a stop at a constant slip takes with each friction. --write puts the laws' figures into
docs/reference/measured-claim.csv, and tables into docs/paper.md behind <!-- measured claim --> and <!-- measured stop -->,
--check fails where the page says something else. Needs the package abs_hil of a build
(PYTHONPATH=build/release/share/abs_hil/python).
"""
import functools
import pathlib
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
import numpy as np
from marked_tables import csv_text, keep  # noqa: E402

import abs_hil

# A stop at the constant slip s on the maker's lever. With w1 = (1 - s) r2/r1 w2 and what the brake and the bearing take from the
# upper wheel, M = r1 F - J1 w1', the force is F = mu (Mg + M) / (L (sin phi - mu cos phi)), so
#   F = mu (Mg - J1 w1') / (L (sin phi - mu cos phi) - mu r1),   J2 w2' = -r2 F - d2 w2 - M20:
# linear in w2, w2' = -(a + b w2), and the time from w_from to w_to is ln((a + b w_from) / (a + b w_to)) / b.

SLIP, FROM_RAD_S, TO_RAD_S = 0.15, 170.0, 1.0
#: (title, friction over the printed curve, J1 / kg m^2): least, best and largest value of each session
STOPS = (('printed', (1.0,), 7.53e-3), ('steps', (0.98, 1.01, 1.05), 6.4e-3), ('relay session', (0.51, 0.53, 0.56), 6.4e-3))


def stop_s(friction, J1):
    rig = {name.removeprefix('plant.'): row['value'] for name, row in abs_hil.keys(plant='inteco-manual').items()}
    s_p = SLIP ** rig['mu_p']
    curve = rig['mu_w4'] * s_p / (rig['mu_a'] + s_p) + sum(rig[f'mu_w{n}'] * SLIP ** n for n in (1, 2, 3))
    mu = friction * curve
    phi, r1, r2 = np.radians(rig['lever_phi_deg']), rig['r1_m'], rig['r2_m']
    per_Nm = mu / (rig['lever_L_m'] * (np.sin(phi) - mu * np.cos(phi)) - mu * r1)
    inertia = rig['J2_kg_m2'] - r2 * per_Nm * J1 * (1.0 - SLIP) * r2 / r1
    a, b = (r2 * per_Nm * rig['lever_Mg_Nm'] + rig['M20_Nm']) / inertia, rig['d2_Nms_rad'] / inertia
    return float(np.log((a + b * FROM_RAD_S) / (a + b * TO_RAD_S)) / b)


def stop_table():
    lines = ['| friction | over the printed curve | time at slip 0.15 from 170 to 1 rad/s / s |', '|---|---|---|']
    for title, frictions, J1 in STOPS:
        times = [f'{stop_s(friction, J1):.2f}' for friction in frictions]
        lines.append(f'| {title} | {", ".join(f"{friction:g}" for friction in frictions)} | {", ".join(times)} |')
    return '\n'.join(lines) + '\n'


BASELINE = 'sliding-mode'
LAWS = (BASELINE, 'adaptive', 'adaptive-actuator', 'sliding-mode-actuator', 'pi', 'adaptive-optimal', 'locked')
#: (title, plant, what varies, runs of each law)
RIGS = (('`measured-step`', 'measured-step', 'phase', 20), ('`measured-relay`', 'measured-relay', 'phase', 20),
        ('drawn, believed to be `measured-step`', 'measured-step', 'measured,phase', 400),
        ('drawn, believed to be `inteco-manual`', 'inteco-manual', 'measured,phase', 400))


def figures(plant, vary, runs):
    """law -> (times, distances) of its runs, s and m; NaN where a fault ended one."""
    given = [{'controller': law, 'plant': plant, 'set': {'experiment.start_speed_rad_s': 170.0}} for law in LAWS]
    study = abs_hil.simulate_many(given, vary=vary, repeat=runs)
    sound = study['fault'] == ''
    columns = (np.where(sound, study[name], np.nan).reshape(len(LAWS), runs) for name in ('stop_time_s', 'stop_distance_m'))
    return dict(zip(LAWS, zip(*columns)))


@functools.cache
def medians():
    """title of the rig -> law -> medians of time and distance, s and m, of their ratios to sliding-mode's, and failed runs."""
    found = {}
    for title, plant, vary, runs in RIGS:
        its = figures(plant, vary, runs)
        found[title] = {law: (*(float(np.nanmedian(column)) for column in columns),
                              *(float(np.nanmedian(column / base)) for column, base in zip(columns, its[BASELINE])),
                              int(np.isnan(columns[0]).sum())) for law, columns in its.items()}
    return found


def all_rows():
    rows = [[title.replace('`', ''), law, f'{time_s:.2f}', f'{way_m:.1f}', f'{faster:.2f}', f'{shorter:.2f}', failed]
            for title, its in medians().items() for law, (time_s, way_m, faster, shorter, failed) in its.items()]
    return csv_text(['rig', 'controller', 'stop_time_s', 'stop_distance_m', 'time_over_sliding_mode', 'distance_over_sliding_mode',
                     'failed_runs'], rows)


def table():
    lines = ['| rig | `sliding-mode` | `adaptive` over it: time, distance | shortest: distance over it |', '|---|---|---|---|']
    for title, its in medians().items():
        best = min(its, key=lambda law: its[law][3])
        lines.append(f'| {title} | {its[BASELINE][0]:.2f} s, {its[BASELINE][1]:.1f} m | {its["adaptive"][2]:.2f}, '
                     f'{its["adaptive"][3]:.2f} | `{best}`: {its[best][3]:.2f} |')
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    if sys.argv[1:] not in (['--check'], ['--write']):
        sys.exit(__doc__)
    sys.exit(keep(sys.argv[1], [('paper.md', 'measured stop', stop_table), ('paper.md', 'measured claim', table),
                                ('reference/measured-claim.csv', None, all_rows)]))
