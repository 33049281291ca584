#!/usr/bin/env python3
"""Loads runs that abs_report --json exported and repeats their main figures, with Python's standard library alone.

usage: load_run.py RUNS.json

With pandas the CSV is enough: pandas.read_csv('run.csv'); with SciPy the MAT-file: scipy.io.loadmat('runs.mat').
"""
import json
import math
import sys

END_SPEED_M_S = 0.3  # experiment.end_speed_m_s
R2_M = 0.099  # plant.r2_m, radius of the lower wheel


def figures(columns):
    rows = [dict(zip(columns, values)) for values in zip(*columns.values())]
    start_s = next(row['time_s'] for row in rows if row['phase'] == 'brake')
    stopped = next(row for row in rows
                   if row['time_s'] > start_s and R2_M * row['omega2_rad_s'] < END_SPEED_M_S)
    errors = [row['slip'] - row['slip_ref'] for row in rows
              if row['phase'] == 'brake' and row['time_s'] > start_s + 0.3 and R2_M * row['omega2_rad_s'] > 3.0]
    slip_rms = math.sqrt(sum(error**2 for error in errors) / len(errors))
    return stopped['time_s'] - start_s, stopped['distance_m'], slip_rms


with open(sys.argv[1]) as file:
    for run in json.load(file)['runs']:
        stop_s, distance_m, slip_rms = figures(run['columns'])
        print(f'{run["name"]} ({run["summary"]["controller"]}): stop time {stop_s:.3f} s, '
              f'distance {distance_m:.3f} m, slip RMS error {slip_rms:.5f}')
