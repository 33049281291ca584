#!/usr/bin/env python3
"""usage: model_mismatch.py --check|--write [BUILD]

Every controller brakes the plant paper-table1 with models that are wrong in one part by 20 %. The table of stop distance
and slip error is docs/reference/model-mismatch.csv. --write makes it, --check fails where it says something else. BUILD is the folder of a build, by default
build/release.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib

sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / 'scripts'))
from marked_tables import ROOT, csv_text, keep  # noqa: E402


PLANT = 'paper-table1'
WRONG_BY = 0.2
# heading -> the values of the model that are wrong together
PARTS = {'J1': ('J1_kg_m2',), 'J2': ('J2_kg_m2',), 'c31': ('c31_per_s',), 'b(u)': ('b1_Nm', 'b2_Nm')}


def controllers(program):
    text = subprocess.run([program, 'list'], check=True, capture_output=True, text=True).stdout
    lines = text.split('controllers\n', 1)[1].splitlines()
    names = []
    for line in lines:
        if not line.startswith(' '):
            break
        names.append(line.split()[0])
    return names


def braking(program, names, model):
    """{controller: (stop distance, slip error RMS)}; None for a run that ended by a fault."""
    with tempfile.NamedTemporaryFile(suffix='.json') as file:
        sets = [word for key, value in model.items() for word in ('--set', f'model.{key}={value!r}')]
        subprocess.run([program, 'compare', '--plant', PLANT, '--controllers', ','.join(names), '--repeat', '1', '--vary',
                        'none', '--json', file.name, *sets], check=True, capture_output=True)
        found = json.loads(pathlib.Path(file.name).read_text(encoding='utf-8'))
    return {c['name']: None if c['faults'] else (c['metrics']['stop_distance_m']['mean'],
                                                 c['metrics']['slip_rms']['mean']) for c in found['controllers']}


def table(program):
    nominal = tomllib.loads((ROOT / 'config' / 'plants' / f'{PLANT}.toml').read_text(encoding='utf-8'))['plant']
    names = controllers(program)
    columns = {'right model': braking(program, names, {})}
    for part, keys in PARTS.items():
        for sign, factor in (('−', 1 - WRONG_BY), ('+', 1 + WRONG_BY)):
            model = {key: round(nominal[key] * factor, 9) for key in keys}
            columns[f'{part} {sign}{100 * WRONG_BY:.0f} %'] = braking(program, names, model)
    rows = [[name, model, *(['', ''] if found[name] is None else ['{:.2f}'.format(found[name][0]), '{:.3f}'.format(found[name][1])])]
            for name in names for model, found in columns.items()]
    return csv_text(['controller', 'model', 'stop_distance_m', 'slip_rms'], rows)


def main():
    mode, *build = sys.argv[1:] or ['']
    if mode not in ('--check', '--write') or len(build) > 1:
        print(__doc__, file=sys.stderr)
        return 2
    program = pathlib.Path(build[0] if build else ROOT / 'build' / 'release').resolve() / 'bin' / 'abs_hil'
    return keep(mode, [('reference/model-mismatch.csv', None, lambda: table(program))])


if __name__ == '__main__':
    sys.exit(main())
