#!/usr/bin/env python3
"""Writes the tables of docs/paper.md, between its markers, from fresh runs.

usage: scripts/paper_numbers.py [--check]      (needs build/release, or ABS_BIN=FOLDER of the programs)
       --check: changes nothing, exit status 1 if the page differs from the program's present results
"""
import csv
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = pathlib.Path(os.environ.get('ABS_BIN', ROOT / 'build/release/bin')) / 'abs_hil'
PAGE = ROOT / 'docs/paper.md'
PLANTS = ('paper-timing', 'paper-table1')
PAIR = ('adaptive', 'sliding-mode')
ALL = 'adaptive,sliding-mode,sliding-mode-smooth,super-twisting,pi,relay,five-phase,locked'
IDEAL = ('--set', 'plant.ideal_actuator=true', '--set', 'plant.ideal_sensors=true')
ONCE = ('--repeat', '1', '--vary', 'none')
MANY = ('--repeat', '200', '--seed', '1')


def run(*args):
    return subprocess.run([PROGRAM, *args], check=True, capture_output=True, text=True).stdout


def compare(*args):
    """The comparison as (Markdown, JSON)."""
    with tempfile.TemporaryDirectory() as folder:
        markdown, table = pathlib.Path(folder) / 'm', pathlib.Path(folder) / 'j'
        run('compare', *args, '--markdown', markdown, '--json', table)
        return markdown.read_text(), json.loads(table.read_text())


def brake_rows(plant, controller):
    """The rows in phase brake of a whole experiment, from rest, and its summary."""
    with tempfile.TemporaryDirectory() as folder:
        log, summary = pathlib.Path(folder) / 'c', pathlib.Path(folder) / 's'
        run('--backend', 'sim', '--fast', '--no-lcm', '--plant', plant, '--controller', controller,
            '--csv', log, '--summary', summary)
        with log.open(newline='') as file:
            rows = [{key: value if key == 'phase' else float(value) for key, value in row.items()}
                    for row in csv.DictReader(file) if row['phase'] == 'brake']
        return rows, json.loads(summary.read_text())


def first_time(rows, holds):
    start = rows[0]['time_s']
    return next((f'{row["time_s"] - start:.3f}' for row in rows if holds(row)), 'never')


def figures_table():
    """One row for each quantity in the paper's figures, for both controllers on both plants."""
    columns = [(plant, controller, *brake_rows(plant, controller)) for plant in PLANTS for controller in PAIR]
    lines = ['| figure | quantity | ' + ' | '.join(f'{plant}: {controller}' for plant, controller, _, _ in columns) + ' |',
             '|---|---|' + '---:|' * len(columns)]

    def line(figure, quantity, value):
        lines.append(f'| {figure} | {quantity} | ' + ' | '.join(value(rows, s) for _, _, rows, s in columns) + ' |')

    fast = lambda rows: [row for row in rows if row['omega2_rad_s'] * 0.099 > 3.0]
    late = lambda rows: [row for row in fast(rows) if row['time_s'] - rows[0]['time_s'] > 0.3]
    line('5, 6', 'braking starts at / s', lambda rows, s: f'{s["brake_start_s"]:.3f}')
    line('5, 6', 'stop time / s', lambda rows, s: f'{s["stop_time_s"]:.3f}')
    line('7', 'slip first within 0.02 of 0.15 after / s',
         lambda rows, s: first_time(rows, lambda row: abs(row['slip'] - 0.15) <= 0.02))
    line('7', 'mean slip, later than 0.3 s, above 3 m/s',
         lambda rows, s: f'{sum(row["slip"] for row in late(rows)) / len(late(rows)):.3f}')
    line('7', 'slip RMS error, the same', lambda rows, s: f'{s["slip_rms"]:.4f}')
    line('7', 'largest slip above 3 m/s', lambda rows, s: f'{max(row["slip"] for row in fast(rows)):.3f}')
    line('8', 'total variation of the torque asked for / N m',
         lambda rows, s: f'{s["torque_total_variation_Nm"]:.0f}')
    line('8', 'the same per second of braking / (N m/s)',
         lambda rows, s: f'{s["torque_total_variation_Nm"] / s["stop_time_s"]:.0f}')
    line('9', 'estimate of θ first within 5 % after / s',
         lambda rows, s: first_time(rows, lambda row: abs(row['theta_est_N'] / row['theta_N'] - 1.0) <= 0.05))
    line('9', 'error of the estimate at 3 m/s', lambda rows, s: f'{100.0 * s["theta_error_final"]:+.1f} %')
    line('10', 'stop distance / m', lambda rows, s: f'{s["stop_distance_m"]:.2f}')
    return '\n'.join(lines)


def ratio_table():
    lines = ['| plant | actuator, sensors | runs | stop time | stop distance | torque variation |',
             '|---|---|---|---|---|---|']
    alone = ('--config', ROOT / 'config/tuned/paper-timing/sliding-mode.toml')
    for plant, kind, sets in (*((plant, *kind) for plant in PLANTS for kind in (('real', ()), ('ideal', IDEAL))),
                              ('paper-timing, sliding-mode tuned on it alone', 'real', alone)):
        for name, series in (('1, as it is', ONCE), ('200, varied', MANY)):
            ratios = compare('--plant', plant.split(',')[0], '--controllers', ','.join(PAIR), *series, *sets)[1]
            cells = []
            for key in ('stop_time', 'stop_distance', 'torque_total_variation'):
                e = ratios['adaptive_over_sliding_mode'][key]
                interval = '' if e['ci95_low'] is None else f' [{e["ci95_low"]:.3f}, {e["ci95_high"]:.3f}]'
                cells.append(f'{e["mean"]:.3f}{interval}')
            lines.append(f'| {plant} | {kind} | {name} | ' + ' | '.join(cells) + ' |')
    lines.append('| the paper | its rig | 1 | 0.933 | 0.933 | not given |')
    return '\n'.join(lines)


def sections():
    yield 'ratios', ratio_table()
    yield 'figures', figures_table()
    yield 'timing', compare('--plant', 'paper-timing', '--controllers', ALL, *MANY)[0]
    yield 'table1', compare('--plant', 'paper-table1', '--controllers', ALL, *MANY)[0]
    yield 'tuned', compare('--plant', 'paper-timing', '--controllers', ','.join(PAIR), *MANY,
                           '--config', ROOT / 'config/tuned/adaptive.toml')[0]


def main():
    page = before = PAGE.read_text()
    for name, text in sections():
        pattern = re.compile(f'(<!-- begin {name} -->\n).*?(<!-- end {name} -->)', re.S)
        page, count = pattern.subn(lambda found, text=text: found[1] + '\n' + text.strip() + '\n\n' + found[2], page)
        if count != 1:
            sys.exit(f'{PAGE}: expected the markers of {name} once, found them {count} times')
    if '--check' in sys.argv:
        return int(page != before)
    PAGE.write_text(page)
    return 0


if __name__ == '__main__':
    sys.exit(main())
