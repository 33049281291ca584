#!/usr/bin/env python3
"""usage: flawed_rigs.py [--rigs N] [--seed N] [--jobs N] [--check] [--keep FOLDER] [--sentences]

Tries abs_identify on rigs with features that a fit lacks or has, N of each kind, with parameters within 15 % of the plant's
(those of identification_study.py) and the logs of five experiments. All but those called quiet wander. Prints for each kind
how many were refused and for what cause, how many intervals of 95 % hold the truth, and how many forms are right.
--check: status 1 unless, of the intervals given, 90 % hold, all forms are right or undecided, and each refusal names the cause, or says honestly that it has no name for it.
--keep: stores each rig's result in FOLDER, and takes those that it finds there, so that an interrupted run goes on.
--sentences: prints those of docs/identification.md alone.
"""
import argparse
import os
import pathlib
import sys
from concurrent.futures import ProcessPoolExecutor

os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
import numpy as np  # noqa: E402
from identification_study import EXPERIMENTS, drawn, kept, values_of, wandering  # noqa: E402
from other_rig import driven  # noqa: E402

import abs_hil  # noqa: E402
from abs_hil.identification.advice import log_of  # noqa: E402

FLAWS = {'fading': ('brake_fading_per_J', 1e-4, 4e-4), 'dead time': ('brake_dead_time_s', 1e-3, 6e-3),
         'hysteresis': ('brake_hysteresis', 0.03, 0.12), 'rate limit': ('brake_rate_limit_Nm_s', 60.0, 140.0),
         'eccentric disc': ('upper_encoder_eccentricity_rad', 1e-3, 4e-3), 'release': ('brake_release_ratio', 0.6, 1.8),
         'cooling': ('brake_cooling_per_s', 0.15, 0.5), 'slots': ('upper_encoder_slot_error_counts', 0.15, 0.5),
         'curved map': ('brake_curvature', -0.2, 0.3), 'falling friction': ('friction_fall_s_m', 0.005, 0.03)}
#: of rigs with equations of their own: arguments of other_rig.driven, and the plant's parameters that have these values, or
#: the words that a refusal must hold
OTHERS = {'two lags': ({'release': 1.5}, {'brake_release_ratio': 1.5}), 'bent map': ({'curvature': 0.2}, {'brake_curvature': 0.2}),
          'friction by sliding speed': ({'by_sliding_s_m': 0.02}, {'friction_fall_s_m': 0.02}),
          'friction by car speed': ({'by_speed_s_m': 0.01}, "changes with the lower wheel's speed"),
          'bearings that warm up': ({'stiff': 0.6}, 'bearing drags less as time goes'),
          'friction by Stribeck': ({'at_rest': 0.25}, 'the friction is no straight line of the sliding speed'),
          'readings that jitter': ({'jitter_s': 15e-6}, {}),
          'unequal slots': ({'slots': 0.3}, {'upper_encoder_slot_error_counts': 0.3}),
          'brake that cools': ({'fading_per_J': 4e-4, 'cools_in_s': 4.0},
                               {'brake_fading_per_J': 4e-4, 'brake_cooling_per_s': 0.25})}
#: what one may say of a feature for which identify has no name
HONEST = ('the model lacks something', 'the fit did not get there')
OTHERS |= {'lever with play': ({'play': 0.06}, HONEST), 'lever that lags': ({'lever_s': 0.02}, HONEST),
           'second lag': ({'second_lag_s': 0.012}, HONEST), 'bearings with stiction': ({'stiction': 0.6}, HONEST),
           'duty of 8 bits': ({'bits': 8}, {}), 'disc off its middle': ({'eccentric_rad': 3e-3}, {})}
#: features of each kind, joined by " + "
KINDS = ('', 'fading', 'dead time', 'hysteresis', 'rate limit', 'eccentric disc', 'fading + dead time', 'hysteresis + rate limit',
         'fading + dead time + hysteresis + rate limit + eccentric disc', 'quiet', 'quiet + fading', 'quiet + dead time',
         'release', 'curved map', 'falling friction', 'release + curved map + fading', 'fading + cooling', 'slots',
         'quiet + slots')
KINDS_OF_OTHERS = ('other', 'two lags', 'bent map', 'friction by sliding speed', 'two lags + quiet',
                   'friction by car speed', 'brake that cools', 'unequal slots', 'bearings that warm up', 'friction by Stribeck',
                   'readings that jitter', 'readings that jitter + quiet', 'lever with play', 'lever that lags', 'second lag',
                   'bearings with stiction', 'duty of 8 bits', 'disc off its middle', 'duty of 8 bits + quiet',
                   'disc off its middle + brake that cools')


def right_words(misfit, cause):
    """Whether a result says what it must of its rig: nothing; the cause, if there is a name for it; else nothing or honest words."""
    if isinstance(cause, str):
        return bool(misfit) == bool(cause) and cause in misfit
    return not misfit or misfit.startswith(tuple(cause))


def one(plant, kind, seed, keep=None):
    """As `tried`, from the folder `keep` if it is there."""
    return kept(keep, f'{plant}-{kind}-{seed}', lambda: tried(plant, kind, seed))


def tried(plant, kind, seed):
    """(form is right or undecided, intervals that hold, intervals, misfit, the cause that it must name or HONEST)."""
    random = np.random.default_rng([seed, *f'{plant} {kind}'.encode()])
    features = [word for word in kind.split(' + ') if word]
    form, truth, _ = drawn(plant, random, 0.15)
    for word in features:
        if word in FLAWS:
            key, low, high = FLAWS[word]
            truth[key] = random.uniform(low, high)
    if 'eccentric disc' in features:
        truth['upper_encoder_phase_rad'] = random.uniform(-3, 3)
    settings = {f'plant.{key}': value for key, value in {**values_of(plant), **truth}.items()}
    others = [OTHERS[word] for word in features if word in OTHERS]
    lacks = {key: value for arguments, _ in others for key, value in arguments.items()}
    by_others = bool(lacks) or 'other' in features
    logs = []
    for name in EXPERIMENTS:
        quiet = 'quiet' in features or by_others
        log = log_of(name, settings if quiet else {**settings, **wandering(60.0, random)}, random.uniform(size=2))
        if by_others:
            values = {key.removeprefix('plant.'): value for key, value in settings.items()}
            log = driven(log, values, random, wander=0.0 if 'quiet' in features else 1.0, **lacks)
        logs.append(log)
    for _, known in others:
        truth.update(known if isinstance(known, dict) else {})
    found = abs_hil.identify(logs, plant, seed=seed)
    held = [e.low <= truth[key] <= e.high for key, e in found.parameters.items() if key in truth and e.low is not None]
    cause = next((words for _, words in others if not isinstance(words, dict)), '')
    return bool(found.undecided or found.form == form.name), int(sum(held)), len(held), found.misfit, cause


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--rigs', type=int, default=3)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--jobs', type=int, default=os.cpu_count())
    parser.add_argument('--check', action='store_true')
    parser.add_argument('--keep', type=pathlib.Path)
    parser.add_argument('--sentences', action='store_true')
    o = parser.parse_args()
    say = (lambda *_, **__: None) if o.sentences else print
    kinds = [(plant, kind) for kind in KINDS for plant in ('paper-timing', 'inteco-manual')]
    kinds += [('paper-timing', kind) for kind in KINDS_OF_OTHERS]
    wrong, held, given, formed, refused, lacking, named = [], 0, 0, 0, 0, 0, 0
    with ProcessPoolExecutor(o.jobs) as pool:
        jobs = [(kind, [pool.submit(one, *kind, o.seed + i, o.keep) for i in range(o.rigs)]) for kind in kinds]
        say('| plant | features | right form | refused | intervals that hold |\n|---|---|---|---|---|', flush=True)
        for (plant, kind), runs in jobs:
            rows = [run.result() for run in runs]
            for number, (right, _, _, misfit, cause) in enumerate(rows):
                if not right or not right_words(misfit, cause):
                    wrong.append(f'{plant}, {kind or "none"}, seed {o.seed + number}: '
                                 f'{"" if right else "wrong form; "}{misfit or "not refused"}')
            hold, of = sum(row[1] for row in rows), sum(row[2] for row in rows)
            held, given, formed = held + hold, given + of, formed + sum(row[0] for row in rows)
            lacking += sum(bool(row[4]) for row in rows)
            named += sum(bool(row[4]) and right_words(row[3], row[4]) for row in rows)
            refused += sum(bool(row[3]) for row in rows if not row[4])
            say(f'| `{plant}` | {kind or "none"} | {sum(row[0] for row in rows)} of {len(rows)} | '
                  f'{sum(bool(row[3]) for row in rows)} | {f"{hold} of {of}" if of else "–"} |', flush=True)
    say(f'\n{held} of {given} intervals hold: {100 * held / max(given, 1):.1f} %')
    say('\n'.join(wrong))
    if o.sentences:
        rigs = o.rigs * len(kinds)
        print(f'Of {rigs} rigs {formed} had the right form. Of the {lacking} with a feature that the plant lacks {named} were '
              f'refused\n'
              f'of the other {rigs - lacking} rigs {refused} were refused too\n'
              f'Of {given} intervals {held} held the truth ({100 * held / max(given, 1):.1f} %)')
    if o.check and (wrong or held < 0.9 * given):
        sys.exit(1)


if __name__ == '__main__':
    main()
