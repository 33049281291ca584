#!/usr/bin/env python3
"""usage: late_rigs.py [--rigs N] [--seed N] [--jobs N] [--clean] [--check] [--keep FOLDER] [--sentences]

Tries abs_identify on rigs whose brake acts late, as measured ones do (docs/plants.md): a dead time of 5 to 30 ms and a lag of 2 to
50 ms, both loads, all parameters drawn (identification_study.py), without noise, from the plant's own values as the start. Prints
how many of the intervals of 95 % hold the truth, which forms are right, who was refused, and how long `--form auto` takes against
the right form.
--clean: rigs without a late brake instead, with one or two experiments of the series each, whose duties or readings are as other
         people's logs may have them: duties as asked for, boards of 8 bit, jitter. None has a cause.
--check: status 1 unless the intervals hold in 95 +- 3 % of cases (and 3 standard deviations of a quarter as many independent
         ones), no cause is named, and auto takes at most twice as long in the median.
--keep: stores each rig's result in FOLDER, and takes those that it finds there, so that an interrupted study goes on.
--sentences: prints those of docs/identification.md alone.
"""
import argparse
import dataclasses
import os
import pathlib
import sys
import time
from concurrent.futures import ProcessPoolExecutor

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
import numpy as np  # noqa: E402
from identification_study import EXPERIMENTS, drawn, kept, values_of  # noqa: E402

import abs_hil  # noqa: E402
from abs_hil.core import _core  # noqa: E402
from abs_hil.identification.advice import log_of  # noqa: E402
from abs_hil.options import options  # noqa: E402

PLANTS = ('paper-timing', 'inteco-manual', 'paper-table1')
DEAD_S = (5e-3, 30e-3)
LAG_S = (2e-3, 50e-3)
#: of two logs at least one brakes
BRAKING = ('duty-ramp', 'locked-stop', 'pulses', 'slip-sweep')
#: sentences that name a cause
NAMES = 'the logs do not fit this plant'


def asked(log, settings, random, steps):
    """The log with the duties that somebody asked for and a board of so many steps gave; the counts are those of the board's."""
    duty = np.clip(log.brake_pwm + (log.brake_pwm > 0.0) * random.uniform(-0.4, 0.4, len(log)) / steps, 0.0, 1.0)
    given = {'brake_pwm': duty, 'motor_pwm': log.motor_pwm}
    base = _core.PlantOptions(options(set=settings))
    inputs = {**log.inputs(), **{name: np.floor(asked_for * steps + 0.5) / steps for name, asked_for in given.items()}}
    counts = _core.encoder_counts(base, _core.trajectory(base, [], inputs, np.zeros(5))[:, :2]).astype(float)
    return dataclasses.replace(log, brake_pwm=duty, counts=counts - counts[0], first_counts=counts[0])


def tried(plant, seed, clean):
    random = np.random.default_rng([seed, clean, *plant.encode()])
    form, truth, _ = drawn(plant, random, 0.15)
    names, kind = EXPERIMENTS, 'late'
    if clean:
        kind = str(random.choice(['one', 'two', 'asked for', '8 bit']))
        names = tuple(random.permutation([str(random.choice(BRAKING)), str(random.choice(EXPERIMENTS))])[:2 - (kind == 'one')])
    else:
        truth['brake_dead_time_s'] = random.uniform(*DEAD_S)
        truth['c31_per_s'] = 1.0 / np.exp(random.uniform(*np.log(LAG_S)))
    settings = {f'plant.{key}': value for key, value in {**values_of(plant), **truth}.items()}
    logs = [log_of(name, settings, random.uniform(size=2)) for name in dict.fromkeys(names)]
    if kind in ('asked for', '8 bit'):
        logs = [asked(log, settings, random, 255 if kind == '8 bit' else 4095) for log in logs]
    out = {'plant': plant, 'seed': seed, 'kind': f'{kind}: {"+".join(names)}', 'truth': truth}
    for which, wanted in (('given', form.name), ('auto', 'auto')):
        begin = time.process_time()
        try:
            found = abs_hil.identify(logs, plant, seed=seed + 1, form=wanted)
        except ValueError as error:
            out[which] = {'misfit': str(error), 'cpu_s': time.process_time() - begin}
            continue
        known = {**values_of(plant), **truth}
        held = {key: bool(e.low <= known[key] <= e.high) for key, e in found.parameters.items()
                if key in known and e.low is not None and e.status != 'fixed' and not e.low == e.value == 0.0}
        out[which] = {'misfit': found.misfit, 'undecided': found.undecided, 'form': found.undecided or found.form == form.name,
                      'rms': found.residual_counts_rms, 'quiet': found.disturbances is None, 'held': held,
                      'cpu_s': time.process_time() - begin}
    return out


def one(plant, seed, clean, keep=None):
    return kept(keep, f'{"clean" if clean else "late"}-{plant}-{seed}', lambda: tried(plant, seed, clean))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rigs', type=int, default=6)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--jobs', type=int, default=os.cpu_count())
    parser.add_argument('--clean', action='store_true')
    parser.add_argument('--check', action='store_true')
    parser.add_argument('--keep', type=pathlib.Path)
    parser.add_argument('--sentences', action='store_true')
    o = parser.parse_args()
    rows, say = [], (lambda *_, **__: None) if o.sentences else print
    say('| plant | rig | residual, counts | quiet | hold | CPU s, form given | auto over that | refused |\n|' + '---|' * 8)
    with ProcessPoolExecutor(o.jobs) as pool:
        jobs = [pool.submit(one, PLANTS[i % len(PLANTS)], o.seed + i, o.clean, o.keep) for i in range(o.rigs)]
        for job in jobs:
            row = job.result()
            rows.append(row)
            given, auto = row['given'], row['auto']
            held = [*auto.get('held', {}).values()]
            say(f'| `{row["plant"]}` | {row["seed"]}, {row["kind"]} | {auto.get("rms", np.nan):.4f} | {auto.get("quiet")} | '
                  f'{sum(held)} of {len(held)} | {given["cpu_s"]:.1f} | {auto["cpu_s"] / given["cpu_s"]:.2f} | '
                  f'{auto["misfit"][:120]} |', flush=True)
    held = [one for row in rows for which in ('given', 'auto') for one in row[which].get('held', {}).values()]
    named = sum(NAMES in row[which]['misfit'] for row in rows for which in ('given', 'auto'))
    refused = sum(bool(row['auto']['misfit']) and not row['auto'].get('undecided') for row in rows)
    ratio = float(np.median([row['auto']['cpu_s'] / row['given']['cpu_s'] for row in rows]))
    forms = sum(bool(row['auto'].get('form')) for row in rows)
    share = float(np.mean(held)) if held else np.nan
    print(f'Of {len(held)} intervals {sum(held)} held the truth ({100 * share:.1f} %)\n'
          f'Of {len(rows)} rigs {refused} were refused, {named} by a cause')
    say(f'{forms} of {len(rows)} forms right or left open; auto takes {ratio:.2f} times as long as the right form (median)')
    if o.check:
        chance = 3.0 * np.sqrt(0.95 * 0.05 / max(len(held) / 4, 1))  # errors of a rig's parameters go together
        if not abs(share - 0.95) <= 0.03 + chance or named or not ratio <= 2.0:
            sys.exit(1)


if __name__ == '__main__':
    main()
