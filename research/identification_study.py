#!/usr/bin/env python3
"""usage: identification_study.py [--plants A,B] [--repetitions N] [--seed N] [--disturbed] [--more A,B] [--jobs N]
                                [--csv FILE] [--check] [--keep FOLDER] [--page]

Tries abs_identify on simulated rigs whose parameters it does not know: each within 25 % of the plant's, with other encoder
phases, from start values up to 25 % off. The logs are those of the series `identification`. Prints, for each parameter, the
median error, the share of intervals of 95 % that hold the truth, how well the identified model predicts `paper`, how far the
tyre's curve is off, how far controllers that believe the model stop from where they stop with the true one, and a
simulation-based calibration: where in their intervals the truths lie.
--disturbed: friction and brake wander by 1 %, the motor by 0.5 %, bearings by 5 %, over 0.2 s.
--more: experiments of which there is one log more each.
--check: status 1 unless all fits converge, errors stay within docs/identification.md's bounds for undisturbed rigs, and
the intervals of all parameters together hold the truth as often as intervals of 95 % do, and the ranks are uniform.
--keep: stores each rig's results in FOLDER, and takes those that it finds there, so that an interrupted study goes on.
--page: prints the table of docs/identification.md instead, of all the rigs that PAGE names.
"""
import argparse
import csv
import json
import os
import pathlib
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
import numpy as np  # noqa: E402
import scipy.stats  # noqa: E402

import abs_hil  # noqa: E402
from abs_hil.identification import identify  # noqa: E402
from abs_hil.identification.advice import log_of  # noqa: E402
from abs_hil.identification.intervals import WIDTH  # noqa: E402
from abs_hil.identification.parameters import FORMS  # noqa: E402
from abs_hil.identification.results import as_toml, braking_force_N, equivalent_tyre, plant_settings  # noqa: E402

EXPERIMENTS = ('lifted', 'duty-ramp', 'locked-stop', 'pulses', 'slip-sweep')
#: laws that use the model
CONTROLLERS = ('adaptive', 'adaptive-actuator', 'adaptive-optimal')
SPREAD = 0.25
#: narrower ones: geometry is measured to a few per cent, the tyre's shape must stay a shape, and the rig must reach 170 rad/s
SPREADS = {'r1_m': 0.02, 'u0': 0.1, 'motor_no_load_speed_rad_s': 0.1, 'C': 0.1, 'mu_p': 0.1}
WANDER = {'friction': 0.01, 'brake_torque': 0.01, 'motor_torque': 0.005, 'upper_bearing': 0.05, 'lower_bearing': 0.05}
WANDER_S = 0.2


#: of the page's table: disturbed, rigs of each plant, plants
PAGE = ((False, 60, ('paper-table1', 'paper-timing', 'inteco-manual')),
        (True, 30, ('paper-timing', 'paper-table1', 'inteco-manual')))


def values_of(plant):
    return {name.removeprefix('plant.'): row['value'] for name, row in abs_hil.keys(plant=plant).items()
            if name.startswith('plant.')}


def drawn(plant, random, most=SPREAD):
    """(form, truth, start values): by the plant's keys; the truth within `most` of the plant's."""
    values = values_of(plant)
    form = FORMS[values['tyre']]
    truth, start = {}, {}
    for p in form.parameters:
        spread = SPREADS.get(p.key, most)
        truth[p.key] = values[p.key] * (1 + spread * random.uniform(-1, 1))
        start[p.key] = values[p.key] * (1 + SPREAD * random.uniform(-1, 1))
    # b2 follows from the torque at the dead zone's end, which is small and not negative.
    truth['b2_Nm'] = random.uniform(0.02, 0.25) - truth['b1_Nm'] * truth['u0']
    start['C'] = min(start.get('C', 1.0), 1.95)
    start['mu_p'] = max(start.get('mu_p', 2.0), 1.1)
    return form, truth, {key: start[key] for key in truth}


def wandering(duration_s, random):
    """Profiles of the factors: straight lines between values every WANDER_S."""
    settings = {}
    for name, sd in WANDER.items():
        values = 1 + sd * random.standard_normal(int(duration_s / WANDER_S) + 2)
        pieces = [f'{values[0]:.6f}'] + [f'{b:.6f} from {i * WANDER_S:.3f} to {(i + 1) * WANDER_S:.3f}'
                                         for i, b in enumerate(values[1:])]
        settings[f'plant.{name}_profile'] = 'time: ' + '; '.join(pieces)
    return settings


def kept(folder, name, make):
    """What `make` returns; with a folder from its file of that name, which is made where it is missing."""
    if folder is None:
        return make()
    file = folder / f'{name.replace(" ", "-")}.json'
    if not file.exists():
        file.write_text(json.dumps(make(), default=lambda value: value.item()), encoding='utf-8')
    return json.loads(file.read_text(encoding='utf-8'))


def one(plant, seed, disturbed, more, keep=None):
    """A row of results: name -> value."""
    return kept(keep, '-'.join([plant, str(seed), *(['disturbed'] if disturbed else []), *more]),
                lambda: measured(plant, seed, disturbed, more))


def measured(plant, seed, disturbed, more):
    random = np.random.default_rng([seed, *plant.encode()])
    form, truth, start = drawn(plant, random)
    nominal = values_of(plant)
    settings = {**{f'plant.{key}': value for key, value in nominal.items()},
                **{f'plant.{key}': value for key, value in truth.items()}}
    logs = []
    for name in (*EXPERIMENTS, *more):
        wander = wandering(60.0, random) if disturbed else {}
        logs.append(log_of(name, {**settings, **wander}, random.uniform(size=2)))
    paper = abs_hil.simulate(experiment='paper', set=settings)
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / 'start.toml'
        given = {**start, 'J2_kg_m2': nominal['J2_kg_m2'], 'r2_m': nominal['r2_m']}
        file.write_text('description = "start"\n[plant]\n' + f'tyre = "{nominal["tyre"]}"\nload = "{nominal["load"]}"\n'
                        + '\n'.join(f'{key} = {value!r}' for key, value in given.items()) + '\n')
        begin = time.process_time()
        found = identify(logs, file, seed=seed)
        cpu_s = time.process_time() - begin
        model = pathlib.Path(folder) / 'model.toml'
        model.write_text(as_toml(found))
        stops = {name: stopped_apart(name, settings, form, found, model) for name in CONTROLLERS}
    # Predicted as a user would: the same controller and the same beliefs, on the identified plant.
    beliefs = {f'model.{key}': settings[f'plant.{key}'] for key in nominal if f'model.{key}' in MODEL}
    again = abs_hil.simulate(experiment='paper', set={**settings, **plant_settings(found), **beliefs})
    row = {'plant': plant, 'seed': seed, 'form_right': found.form == form.name, 'cpu_s': cpu_s,
           'rms_counts': found.residual_counts_rms,
           'distance_error': again.summary['stop_distance_m'] / paper.summary['stop_distance_m'] - 1,
           'force apart': force_apart(settings, form, found),
           **{f'{name} stop': apart for name, apart in stops.items()}}
    for key, value in truth.items():
        estimate = found.parameters.get(key)
        row[f'{key} error'] = estimate.value / value - 1 if estimate else np.nan
        row[f'{key} holds'] = np.nan if estimate is None or estimate.low is None else float(
            estimate.low <= value <= estimate.high)
        row[f'{key} rank'] = rank(estimate if key != 'u0' else None, value)
        row[f'{key} half width'] = np.nan if estimate is None or estimate.low is None else (
            estimate.high - estimate.low) / 2 / abs(value)
        row[f'{key} status'] = estimate.status if estimate else 'other form'
    return row


def force_apart(settings, form, found):
    """The largest difference of the tyre's force while braking, over its largest force; NaN for the wrong form."""
    if found.form != form.name:
        return np.nan
    base = found.fit.problem.base
    truth = {key: settings[f'plant.{key}'] for key in found.values() if f'plant.{key}' in settings}
    true = braking_force_N(base, truth)
    return np.abs(braking_force_N(base, found.values()) - true).max() / true.max()


def rank(estimate, truth):
    """The share of the estimate's distribution (normal, by its interval of 95 %) that lies below the truth, 0 to 1; NaN without
    an interval. If the intervals are right, the ranks of many rigs are uniform: simulation-based calibration (Talts and others,
    arXiv 1804.06788). The interval of u0 lies between duties and has no such distribution."""
    if estimate is None or estimate.low is None or estimate.high <= estimate.low:
        return np.nan
    return float(scipy.stats.norm.cdf((2 * truth - estimate.low - estimate.high) / (estimate.high - estimate.low) * WIDTH))


def stopped_apart(controller, settings, form, found, model):
    """How much farther the true rig stops with the identified model than with the true one, relative; NaN where a run ends
    before it stops."""
    true = dict(settings)
    if form.name == 'inteco-mu':
        truth = {key: settings[f'plant.{key}'] for key in found.values()}
        true.update({f'model.{key}': value for key, value in equivalent_tyre(found.fit.problem.base, truth).items()})
    distances = [abs_hil.simulate(controller=controller, **how).summary['stop_distance_m']
                 for how in ({'set': settings, 'model': model}, {'set': true})]
    return distances[0] / distances[1] - 1 if None not in distances else np.nan


MODEL = {name for name in abs_hil.keys() if name.startswith('model.')}


def table(plant, rows):
    print(f'\n{plant}: {len(rows)} rigs, {sum(row["form_right"] for row in rows)} with the right form; residual '
          f'{np.median([row["rms_counts"] for row in rows]):.4f} counts RMS; `paper` predicted within '
          f'{100 * np.median(np.abs([row["distance_error"] for row in rows])):.4f} % (median), '
          f'{100 * np.max(np.abs([row["distance_error"] for row in rows])):.4f} % (worst); '
          f'{np.median([row["cpu_s"] for row in rows]):.1f} s of CPU. The tyre\'s force in braking differs by at most '
          f'{100 * np.nanmedian([row["force apart"] for row in rows]):.4f} % of its largest (median), '
          f'{100 * np.nanmax([row["force apart"] for row in rows]):.4f} % (worst). Stops with the identified model '
          'instead of the true one, median and worst: ' + ', '.join(
              f'`{name}` {100 * np.nanmedian(apart):.4f} %, {100 * np.nanmax(apart):.4f} %' for name in CONTROLLERS
              if np.isfinite(apart := np.abs([row[f'{name} stop'] for row in rows])).any()))
    print('\n| parameter | median error | worst error | intervals that hold | identified |\n|---|---|---|---|---|')
    for key in [name.removesuffix(' error') for name in rows[0] if name.endswith(' error')]:
        errors = np.abs([row[f'{key} error'] for row in rows])
        holds = np.array([row[f'{key} holds'] for row in rows])
        share = f'{100 * np.nanmean(holds):.0f} % of {int(np.isfinite(holds).sum())}' if np.isfinite(holds).any() else '–'
        identified = sum(row[f'{key} status'] == 'identified' for row in rows)
        print(f'| `{key}` | {np.nanmedian(errors):.1e} | {np.nanmax(errors):.1e} | {share} | {identified} |')


def ranks_of(rows):
    """parameter -> its ranks, shape (rigs with an interval,)."""
    keys = sorted({name.removesuffix(' rank') for row in rows for name in row if name.endswith(' rank')})
    ranks = {key: np.array([row.get(f'{key} rank', np.nan) for row in rows], dtype=float) for key in keys}
    return {key: one[np.isfinite(one)] for key, one in ranks.items() if np.isfinite(one).any()}


def within(ranks):
    """The shares of ranks in the middle 50, 80 and 95 %, in per cent."""
    return [100 * float(np.mean(np.abs(ranks - 0.5) <= share / 2)) for share in (0.5, 0.8, 0.95)]


def calibration(rows):
    """Prints, for each parameter, how often intervals of 50, 80 and 95 % hold the truth, and how likely uniform ranks would be
    as far from uniform (Kolmogorov, Smirnov). Returns the parameters of which chance would make that once in 1,000 studies."""
    print('\n| parameter | rigs | in 50 % | in 80 % | in 95 % | chance of such ranks |\n|---|---|---|---|---|---|')
    every = ranks_of(rows)
    chances = {key: float(scipy.stats.kstest(ranks, 'uniform').pvalue) for key, ranks in every.items()}
    for key, ranks in every.items():
        shares = ' | '.join(f'{share:.0f} %' for share in within(ranks))
        print(f'| `{key}` | {len(ranks)} | {shares} | {chances[key]:.2g} |')
    return [key for key, chance in chances.items() if chance * len(chances) < 1e-3]


def page_rows(rows_of, disturbed):
    """Lines of the page's table. rows_of: plant -> rows."""
    ranks = np.concatenate(list(ranks_of([row for rows in rows_of.values() for row in rows]).values()))
    together = (', '.join(f'{share:.1f}' for share in within(ranks)), f'of {len(ranks):,},', 'all three together')
    for (plant, rows), words in zip(rows_of.items(), together):
        distance, force = (100 * np.abs([row[name] for row in rows]) for name in ('distance_error', 'force apart'))
        rms = np.median([row['rms_counts'] for row in rows])
        yield (f'| `{plant}`{" that wanders" if disturbed else ""} | {len(rows)} | {rms:.4f} | {np.median(distance):.4f} '
               f'({distance.max():.4f}) | {np.nanmedian(force):.4f} ({np.nanmax(force):.4f}) | {words} |')


def page(o):
    """The table of docs/identification.md. Raises ValueError for a fit that does not converge."""
    with ProcessPoolExecutor(o.jobs) as pool:
        jobs = [(disturbed, {plant: [pool.submit(one, plant, o.seed + i, disturbed, [], o.keep) for i in range(count)]
                             for plant in plants}) for disturbed, count, plants in PAGE]
        lines = [line for disturbed, of in jobs
                 for line in page_rows({plant: [job.result() for job in runs] for plant, runs in of.items()}, disturbed)]
    head = ('median (worst)', 'rigs', 'residual, counts RMS', 'stop distance of `paper` predicted within %',
            "tyre's force in braking within %", '% of the intervals of 50, 80, 95 % that hold the truth')
    print('\n'.join([f'| {" | ".join(head)} |', '|' + '---|' * len(head), *lines]))


#: largest median error of an undisturbed rig's parameter, relative
LARGEST_ERROR = {'M10_Nm': 3e-3, **dict.fromkeys(('lever_Mg_Nm', 'mu_w4', 'mu_a', 'mu_w1', 'mu_w3'), 3e-3)}
LARGEST_ERROR_ELSE = 5e-4


def problems(rows, wanted):
    """What of the promises for undisturbed rigs does not hold, in words."""
    found = [] if len(rows) == wanted else [f'{wanted - len(rows)} of {wanted} fits failed']
    if wrong := sum(not row['form_right'] for row in rows):
        found.append(f'{wrong} rigs with the wrong form of the plant')
    keys = sorted({name.removesuffix(' error') for row in rows for name in row if name.endswith(' error')} - {'u0'})
    for key in keys:
        error = np.nanmedian(np.abs([row.get(f'{key} error', np.nan) for row in rows]))
        if not error <= LARGEST_ERROR.get(key, LARGEST_ERROR_ELSE):
            found.append(f'{key}: median error {error:.1e}')
    holds = np.array([row[name] for row in rows for name in row if name.endswith(' holds')])
    holds = holds[np.isfinite(holds)]
    # A thousandth of the samples of a right 95 % would fall outside of these, were all intervals independent.
    low, high = scipy.stats.binom.ppf([0.0005, 0.9995], len(holds), 0.95) / max(1, len(holds))
    print(f'\n{len(holds)} intervals, {100 * np.mean(holds):.1f} % hold; {100 * low:.1f} to {100 * high:.1f} % expected')
    if not low <= np.mean(holds) <= high:
        found.append(f'{100 * np.mean(holds):.1f} % of the intervals hold')
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--plants', default='paper-table1,paper-timing,inteco-manual')
    parser.add_argument('--repetitions', type=int, default=60)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--disturbed', action='store_true')
    parser.add_argument('--more', type=lambda names: names.split(','), default=[])
    parser.add_argument('--jobs', type=int, default=os.cpu_count())
    parser.add_argument('--csv', type=pathlib.Path)
    parser.add_argument('--check', action='store_true')
    parser.add_argument('--keep', type=pathlib.Path)
    parser.add_argument('--page', action='store_true')
    o = parser.parse_args()
    if o.page:
        return page(o)
    every = []
    with ProcessPoolExecutor(o.jobs) as pool:
        for plant in o.plants.split(','):
            jobs = [pool.submit(one, plant, o.seed + i, o.disturbed, o.more, o.keep) for i in range(o.repetitions)]
            rows = []
            for number, job in enumerate(jobs, 1):
                try:
                    rows.append(job.result())
                except ValueError as error:
                    print(f'{plant}, seed {o.seed + number - 1}: {error}', file=sys.stderr)
                print(f'{plant}: {number} of {len(jobs)}', file=sys.stderr, flush=True)
            if rows:
                table(plant, rows)
            every += rows
    skewed = calibration(every) if every else []
    if o.csv and every:
        names = list(dict.fromkeys(name for row in every for name in row))
        with open(o.csv, 'w', newline='', encoding='utf-8') as file:
            writer = csv.DictWriter(file, names)
            writer.writeheader()
            writer.writerows(every)
    if o.check:
        found = problems(every, o.repetitions * len(o.plants.split(',')))
        found += [f'the ranks of {key} are not uniform' for key in skewed]
        sys.exit('; '.join(found) if found else 0)


if __name__ == '__main__':
    main()
