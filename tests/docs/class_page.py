#!/usr/bin/env python3
"""usage: class_page.py ROOT BUILD

Runs what the handouts of docs/class.md ask for, and looks whether its answers for the lecturer have these figures.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import tomllib

SLIDING = ('--controller', 'sliding-mode')
NOT_OF_THE_RIG = ('brake_rate_limit_Nm_s', 'M10_plus_M20_Nm')  # no draw of the rig, and a sum of two that are counted


class Program:
    def __init__(self, build, folder):
        self.folder, self.bin = folder, build / 'bin'
        self.call('rig', 'steady', '2', '--out', 'steady.toml')
        self.call('rig', 'wandering', '7', '--out', 'wandering.toml')

    def call(self, *arguments):
        subprocess.run([self.bin / 'abs_hil', *arguments], cwd=self.folder, check=True, capture_output=True,
                       env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'})

    def run(self, *arguments, plant='paper-table1', model='paper-table1'):
        """The summary of a run."""
        summary = self.folder / 'summary.json'
        summary.unlink(missing_ok=True)
        self.call('--fast', '--no-lcm', '--plant', plant, '--model', model, *arguments, '--summary', summary)
        return json.loads(summary.read_text())

    def identified(self, out, logs):
        """name -> value, low, high, status; and the predicted stop distance."""
        self.call('identify', *logs, '--fix', 'J2_kg_m2=0.0256', '--validate', 'runs/judge', '--out', out)
        found = json.loads((self.folder / out / 'identified.json').read_text())
        return found['parameters'], found['validation']['predicted_stop_distance_m']


def first(program):
    def stop(*arguments):
        return program.run(*arguments, plant='steady.toml')['stop_distance_m']
    sweep = program.run('--experiment', 'slip-sweep', plant='steady.toml')['friction_curve']
    yield f'(1) {stop():.2f} m; the sweep finds the peak at λ = {sweep["peak_slip"]:.3f}, {sweep["peak_force_N"]:.1f} N'
    at = [stop('--set', f'control.slip_ref={slip}') for slip in (0.03, 0.05, 0.06, 0.08, 0.15, 0.25)]
    both = ' or '.join(dict.fromkeys(f'{distance:.1f}' for distance in at[2:4]))  # the page says it once
    yield (f'(2) {at[0]:.1f} m at 0.03, {at[1]:.1f} at 0.05, {both} at 0.06 and 0.08, {at[4]:.1f} at 0.15, '
           f'{at[5]:.1f} at 0.25, {stop("--controller", "locked"):.1f} with locked wheels')
    peak = program.run('--controller', 'adaptive-peak', plant='steady.toml')
    yield f'(5) {peak["stop_distance_m"]:.1f} m.'
    yield f'{peak["torque_total_variation_Nm"]:.0f} against'


def second(program):
    rig = 'wandering.toml'
    program.call('--fast', '--no-lcm', '--plant', rig, '--model', 'paper-table1', '--experiment', 'identification',
                 '--out', 'runs/rig')
    judge = program.run('--out', 'runs/judge', plant=rig)
    logs = [f'runs/rig/run-000{number}' for number in range(1, 6)]
    known, predicted = program.identified('identified', logs)
    without, _ = program.identified('without', logs[1:])

    def width(found, name):
        return 0.5 * (found[name]['high'] - found[name]['low'])

    def per_cent(found, name):
        return 100.0 * width(found, name) / found[name]['value']
    assert per_cent(known, 'r1_m') < 0.001
    yield 'r1, within 0.001 %'
    yield ' and '.join(f'{known[f"{wheel}_encoder_eccentricity_rad"]["value"]:.5f}' for wheel in ('upper', 'lower')) + ' rad'
    yield f'M10, within {per_cent(known, "M10_Nm"):.0f} %, M20 within {per_cent(known, "M20_Nm"):.0f} %'
    yield f'`{", ".join(name for name in known if known[name]["status"] == "bounded")}` is `bounded`'
    yield f'after {judge["stop_distance_m"]:.2f} m, predicted {predicted:.2f} m'
    lost = [name for name in known if without[name]['status'] != known[name]['status'] == 'identified']
    assert {without[name]['status'] for name in lost} == {'not-identifiable'}
    yield f'{", ".join(name.split("_")[0] for name in lost)} are `not-identifiable`'
    yield f'within {per_cent(without, "M10_plus_M20_Nm"):.0f} %'
    yield f'{width(without, "r1_m") / width(known, "r1_m"):.0f} times as wide'
    own = program.run(plant=rig, model='identified/model.toml')
    yield f'{judge["stop_distance_m"]:.2f} m with the paper\'s model, {own["stop_distance_m"]:.2f} m with yours'
    paper, own = (program.run('--controller', 'nominal', plant=rig, model=model)
                  for model in ('paper-table1', 'identified/model.toml'))
    yield (f'{paper["stop_distance_m"]:.2f} m and slip error {paper["slip_rms"]:.3f} against {own["stop_distance_m"]:.2f} m and '
           f'{own["slip_rms"]:.3f}')
    truth = tomllib.loads((program.folder / rig).read_text())['plant']
    counted = [name for name, found in known.items() if found['status'] != 'fixed' and name not in NOT_OF_THE_RIG]
    held = sum(known[name]['low'] <= truth[name] <= known[name]['high'] for name in counted)
    yield f'{"All" if held == len(counted) else held} {len(counted)} do; of {len(counted)} intervals of 95 %'


def third(program):
    def error(*arguments):
        return program.run(*SLIDING, *arguments)['slip_rms']
    yield f'slip error {error():.3f}.'
    yield ', '.join(f'K = {gain}: {error("--set", f"control.sliding_mode.gain_m_s2={gain}"):.3f}' for gain in (100, 5))
    ideal = ('--set', 'plant.ideal_actuator=true')
    whole = program.run(*SLIDING, *ideal, '--set', 'plant.ideal_sensors=true')
    yield f'error is {error(*ideal):.3f}, without lag and encoder steps {whole["slip_rms"]:.4f}'
    yield f'{whole["torque_total_variation_Nm"]:.0f} N m'
    smooth = [program.run('--controller', 'sliding-mode-smooth', '--set', f'control.sliding_mode_smooth.boundary_m_s={m_s}')
              ['slip_rms'] for m_s in (0.1, 0.5, 2.93, 10)]
    yield f'{smooth[0]:.3f} at 0.1 m/s, {smooth[1]:.3f} at 0.5, {smooth[2]:.3f} at 2.93, {smooth[3]:.3f} at 10'


def main(root, build):
    page = (root / 'docs' / 'class.md').read_text()
    answers = page.partition('## For the lecturer')[2].split('**Handout ')[1:]
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        program = Program(build, pathlib.Path(folder))
        for handout, answer in zip((first, second, third), answers):
            text = ' '.join(answer.split())
            wrong += [f'handout {answer[0]}: "{words}"' for words in handout(program) if words not in text]
    print('\n'.join(['docs/class.md lacks, as the runs give it now:', *wrong]) if wrong else 'as the page says')
    return 1 if wrong else 0


if __name__ == '__main__':
    sys.exit(main(*(pathlib.Path(path).resolve() for path in sys.argv[1:3])))
