#!/usr/bin/env python3
"""usage: fault_times.py --check|--write

How soon the faults of encoders and outputs are found on the simulated rigs, from docs/reference/fault-matrix.csv: the table of
docs/fault-injection.md between the lines

    <!-- fault times -->
    <!-- end -->

--write puts it there, --check fails where the page says something else.
"""
import csv
import pathlib
import statistics
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import ROOT, keep  # noqa: E402

RIGS = {'sim': '`paper-table1`', 'measured-step': '`measured-step`', 'measured-relay': '`measured-relay`'}
#: what is asked of the encoders' and the outputs' faults, and in which phases
SIGNALS = {'encoders': ('encoder_upper', 'encoder_lower', 'encoders'), 'motor, enable': ('motor_pwm', 'enable'),
           'brake': ('brake_pwm',), 'both outputs': ('write',)}
PHASES = ('accelerate', 'brake')


def cell(rows):
    found = sorted(float(row['after_ms']) for row in rows if row['after_ms'])
    on = len(rows) - len(found)
    return ', '.join(([f'{statistics.median(found):.0f}, {found[-1]:.0f}'] if found else []) + ([f'{on} go on'] if on else []))


def table():
    with open(ROOT / 'docs' / 'reference' / 'fault-matrix.csv', encoding='utf-8') as file:
        rows = [row for row in csv.DictReader(file) if row['phase'] in PHASES]
    lines = ['| ms until the safe state: median, longest | ' + ' | '.join(RIGS.values()) + ' |', '|---' * (1 + len(RIGS)) + '|']
    for title, signals in SIGNALS.items():
        cells = [cell([row for row in rows if row['backend'] == rig and row['signal'] in signals]) for rig in RIGS]
        lines.append(f'| {title} | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    if sys.argv[1:] not in (['--check'], ['--write']):
        sys.exit(__doc__)
    sys.exit(keep(sys.argv[1], [('fault-injection.md', 'fault times', table)]))
