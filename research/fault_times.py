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
import sys

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import ROOT, keep  # noqa: E402

RIGS = {'sim': '`paper-table1`', 'measured-step': '`measured-step`', 'measured-relay': '`measured-relay`'}
SIGNALS = ('encoder_upper', 'encoder_lower', 'encoders', 'motor_pwm', 'enable', 'brake_pwm', 'write')
PHASES = ('accelerate', 'brake')


def cell(row):
    if row['after_ms']:
        return row['after_ms']
    return f'goes on ({row["stop_distance_change_percent"]} %)' if row['stop_distance_change_percent'] else 'goes on'


def table():
    with open(ROOT / 'docs' / 'reference' / 'fault-matrix.csv', encoding='utf-8') as file:
        rows = {(row['backend'], row['phase'], row['signal'], row['fault']): row for row in csv.DictReader(file)}
    faults = list(dict.fromkeys(key[2:] for key in rows if key[2] in SIGNALS))
    lines = ['| ms until the safe state, from 0.1 s of acceleration; of braking | ' + ' | '.join(RIGS.values()) + ' |',
             '|---' * (1 + len(RIGS)) + '|']
    for signal, fault in faults:
        cells = ['; '.join(cell(rows[rig, phase, signal, fault]) for phase in PHASES) for rig in RIGS]
        lines.append(f'| `{signal}:{fault}` | ' + ' | '.join(cells) + ' |')
    return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    if sys.argv[1:] not in (['--check'], ['--write']):
        sys.exit(__doc__)
    sys.exit(keep(sys.argv[1], [('fault-injection.md', 'fault times', table)]))
