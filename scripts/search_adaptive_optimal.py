#!/usr/bin/env python3
"""usage: search_adaptive_optimal.py BUILD [--rounds N] [--seed S] [--threads N]

Searches the keys of adaptive-optimal on config/training/adaptive-optimal.toml: in each round some keys are changed at
random, and what scores better is kept. The score is the mean over the runs of the distance over that of adaptive-peak, in
per cent above 100, plus a tenth of the mean of the worst twentieth, plus one per cent for 100 N m of torque variation; a
locked wheel or a fault costs 100. Prints the score of the defaults, each better one, and its keys as --set takes them.
"""
import argparse
import csv
import gzip
import math
import pathlib
import random
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
STUDY = ROOT / 'config' / 'training' / 'adaptive-optimal.toml'
PREFIX = 'control.adaptive_optimal.'
#: keys that are searched, all of them in logarithms
KEYS = ('slip_gain_per_s', 'slip_gain_near_per_s', 'slip_near_m_s', 'torque_gain_per_s', 'torque_gain_near_per_s',
        'torque_near_Nm', 'play_Nm', 'authority', 'bold_slip', 'model_error_per_s', 'peak_factor', 'slip_rate_per_s',
        'search_part', 'search_rad_s', 'force_bandwidth_rad_s', 'force_noise_N2_s', 'force_error', 'timing_error_s',
        'start_s', 'slip0', 'slip_spread', 'level0_N', 'level_spread_N', 'zero_spread', 'level_drift_per_s',
        'zero_drift_per_s', 'share_per_s', 'jump_share', 'jump_confirm_s', 'jump_hold_s', 'jump_time_constant_s',
        'force_rate_N2_s', 'brake_rate_Nm2_s')
#: keys with little room around them
SMALL_STEPS = {'peak_factor': 0.04, 'slip0': 0.1}
STEP = 0.3
FAILED = 100.0
VARIATION_PER_CENT_NM = 100.0


class Training:
    def __init__(self, program, threads, folder):
        self.program, self.threads, self.folder, self.calls = program, threads, pathlib.Path(folder), 0
        self.reference = [row['stop_distance_m'] for row in self.rows({}, 'adaptive-peak')]

    def rows(self, keys, controller='adaptive-optimal'):
        self.calls += 1
        text = STUDY.read_text()
        if controller != 'adaptive-optimal':
            text = text.replace('"adaptive-optimal"', f'"{controller}"')
        settings = ''.join(f'{PREFIX}{key} = {value:.6g}\n' for key, value in keys.items())
        path = self.folder / 'study.toml'
        path.write_text(text.replace('[settings]\n', '[settings]\n' + settings, 1))
        out = self.folder / f'out-{self.calls}'
        subprocess.run([self.program, 'study', path, '--out', out, '--threads', str(self.threads)], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=ROOT)
        with gzip.open(out / 'results.csv.gz', 'rt') as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith('#')))
        for row in rows:
            whole = row['result'] == 'completed'
            row['stop_distance_m'] = float(row['stop_distance_m']) if whole else math.nan
        return rows

    def score(self, keys):
        loss, variation = [], []
        for row, reference in zip(self.rows(keys), self.reference, strict=True):
            ratio = row['stop_distance_m'] / reference
            if math.isnan(reference):
                continue  # not even the reference can brake there
            loss.append(FAILED if math.isnan(ratio) else 100.0 * (ratio - 1.0))
            if not math.isnan(ratio):
                variation.append(float(row['torque_total_variation_Nm']))
        loss.sort(reverse=True)
        worst = loss[:max(1, len(loss) // 20)]
        variation_Nm = sum(variation) / len(variation)
        return (sum(loss) / len(loss) + 0.1 * sum(worst) / len(worst) + variation_Nm / VARIATION_PER_CENT_NM,
                f'mean {sum(loss) / len(loss):+.2f} %, worst twentieth {sum(worst) / len(worst):+.1f} %, '
                f'{variation_Nm:.0f} N m')


def defaults(program):
    """The keys' values of an unchanged build."""
    listed = subprocess.run([program, 'list', '--keys'], check=True, capture_output=True, text=True).stdout
    values = {}
    for line in listed.splitlines():
        words = line.split()
        if words and words[0].startswith(PREFIX) and words[0][len(PREFIX):] in KEYS:
            values[words[0][len(PREFIX):]] = float(words[1].lstrip('='))
    if set(values) != set(KEYS):
        raise SystemExit(f'no such keys: {set(KEYS) - set(values)}')
    return values


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('build', type=pathlib.Path)
    parser.add_argument('--rounds', type=int, default=500)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--threads', type=int, default=1)
    options = parser.parse_args()
    program = (options.build / 'bin' / 'abs_hil').resolve()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as folder:
        training = Training(program, options.threads, folder)
        best = defaults(program)
        least, text = training.score(best)
        print(f'defaults: {least:.3f} ({text})', flush=True)
        for number in range(1, options.rounds + 1):
            keys = dict(best)
            for key in rng.sample(KEYS, rng.choice((1, 2, 3, 5))):
                keys[key] *= math.exp(rng.gauss(0.0, SMALL_STEPS.get(key, STEP)))
            try:
                score, text = training.score(keys)
            except subprocess.CalledProcessError:
                continue  # a value out of its range
            if score < least:
                least, best = score, keys
                print(f'round {number}: {score:.3f} ({text})', flush=True)
        print(' '.join(f'--set {PREFIX}{key}={value:.4g}' for key, value in best.items()))


if __name__ == '__main__':
    main()
