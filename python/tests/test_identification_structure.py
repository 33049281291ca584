"""abs_hil.identify on rigs with a brake or tyre of their own: it finds what the plant has, and refuses the rest by name."""
import dataclasses
import pathlib
import re
import sys
import tomllib

import numpy as np
import pytest

import abs_hil
from abs_hil.core import _core
from abs_hil.identification import program, structure
from abs_hil.identification.advice import information, log_of
from abs_hil.identification.brake_flaws import leaky
from abs_hil.identification.encoders import middles, slots_of
from abs_hil.identification.logs import motion_of
from abs_hil.identification.results import as_toml
from abs_hil.options import options

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / 'research'))
from other_rig import driven  # noqa: E402

START = 'paper-timing'
EXPERIMENTS = ('lifted', 'duty-ramp', 'locked-stop', 'pulses')
VALUES = {name.removeprefix('plant.'): row['value'] for name, row in abs_hil.keys(plant=START).items()
          if name.startswith('plant.')}
TRUTH = VALUES | {'theta_N': 44.0, 'J1_kg_m2': 8.0e-3, 'c31_per_s': 21.5, 'u0': 0.41, 'b2_Nm': 0.1 - VALUES['b1_Nm'] * 0.41}
SETTINGS = {f'plant.{key}': value for key, value in TRUTH.items()}


def wandering(random):
    """Factors over friction, brake and motor: straight lines between values every 0.2 s."""
    out = {}
    for name, sd in (('friction', 0.01), ('brake_torque', 0.01), ('motor_torque', 0.005)):
        values = 1 + sd * random.standard_normal(300)
        pieces = [f'{value:.6f} from {0.2 * i:.1f} to {0.2 * i + 0.2:.1f}' for i, value in enumerate(values[1:])]
        out[f'plant.{name}_profile'] = 'time: ' + '; '.join([f'{values[0]:.6f}', *pieces])
    return out


def logs_of(flaws, seed, more=()):
    random = np.random.default_rng(seed)
    return [log_of(name, SETTINGS | flaws | wandering(random), random.uniform(size=2)) for name in (*EXPERIMENTS, *more)]


def others(seed, **lacks):
    """Logs of a rig that shares no line with the simulator and wanders."""
    random = np.random.default_rng(seed)
    return [driven(log_of(name, SETTINGS), TRUTH, random, **lacks) for name in EXPERIMENTS]


def quiet(flaws):
    random = np.random.default_rng(5)
    return [log_of(name, SETTINGS | flaws, random.uniform(size=2)) for name in EXPERIMENTS]


def identify(logs):
    return abs_hil.identify(logs, START, form='magic-formula')


def holds(found, name, truth):
    estimate = found.parameters[name]
    # Cooling is told apart from fading, and a straight fall of the friction from a bent one, by few stops: within a quarter,
    # which is enough for an interval.
    assert estimate.status in ('identified', 'bounded') or (name in ('brake_cooling_per_s', 'friction_fall_s_m')
                                                            and estimate.low is not None), name
    # Three half widths, so that a right interval of 95 % does not fail by chance.
    assert abs(estimate.value - truth) < 1.5 * (estimate.high - estimate.low), name


@pytest.mark.parametrize('flaws', [{'brake_fading_per_J': 4e-4, 'brake_dead_time_s': 3e-3}, {'brake_hysteresis': 0.08},
                                   {'brake_fading_per_J': 6e-4, 'brake_cooling_per_s': 0.4}])
def test_flaws_of_the_brake_are_found_on_a_rig_that_wanders(flaws, tmp_path):
    # Hysteresis shows where a duty falls while the brake holds on.
    found = identify(logs_of({f'plant.{key}': value for key, value in flaws.items()}, 1, ['slip-sweep']))
    assert not found.misfit, found.misfit
    assert set(found.fit.problem.flaws) == set(flaws)
    for key, value in flaws.items():
        assert found.parameters[key].value == pytest.approx(value, rel=0.15), key
    for key in (*flaws, 'theta_N', 'J1_kg_m2', 'c31_per_s', 'b1_Nm'):
        holds(found, key, (TRUTH | flaws)[key])
    # What the advice counts with for one more log like this one.
    fit = found.fit
    for key in flaws:
        at = fit.keys.index(key)
        most = int(np.argmax(fit.normal[:, at, at]))
        more = information(fit, found.logs[most], fit.window_s, found.disturbances)
        assert more[at, at] == pytest.approx(fit.normal[most, at, at], rel=0.2)
    file = tmp_path / 'model.toml'
    file.write_text(as_toml(found))
    plant = tomllib.loads(file.read_text())['plant']
    assert all(plant[key] == found.parameters[key].value for key in flaws)
    # As a plant and as a controllers' model, which has no such keys.
    assert abs_hil.simulate(plant=file, model=file).summary['stop_distance_m'] > 1.0


def test_a_rig_that_wanders_at_random_has_no_flaws():
    for logs in (logs_of({}, 2), others(3)):
        found = identify(logs)
        assert not found.misfit, found.misfit
        assert found.fit.problem.flaws == ()
        for key in ('theta_N', 'J1_kg_m2', 'c31_per_s', 'b1_Nm'):
            holds(found, key, TRUTH[key])
        # The causes that are not sure enough to be named widen the intervals.
        more = found.spread.covariance - found.fit.covariance()
        assert more == pytest.approx(structure.unsettled(found.fit, found.disturbances))
        assert np.max(np.diag(more)[found.fit.free] / np.diag(found.fit.covariance())[found.fit.free]) > 0.01


@pytest.mark.parametrize(('lacks', 'flaw'), [({'release': 1.5}, 'brake_release_ratio'), ({'curvature': 0.2}, 'brake_curvature'),
                                             ({'by_sliding_s_m': 0.02}, 'friction_fall_s_m')])
def test_lags_maps_and_tyres_of_another_simulator_are_found(lacks, flaw):
    found = identify(others(4, **lacks))
    assert not found.misfit, found.misfit
    assert found.fit.problem.flaws == (flaw,)
    holds(found, flaw, next(iter(lacks.values())))
    for key in ('theta_N', 'B', 'J1_kg_m2', 'c31_per_s', 'b1_Nm'):
        holds(found, key, TRUTH[key])


def test_unequal_slots_of_a_disc_are_named_and_disturb_nothing():
    # Of another simulator that wanders, and of ours where only the counts' steps are left: they are larger then.
    for logs, truth in ((others(6, slots=0.3), 0.3), (quiet({'plant.upper_encoder_slot_error_counts': 0.6}), 0.6)):
        found = identify(logs)
        assert not found.misfit, found.misfit
        assert found.parameters['upper_encoder_slot_error_counts'].value == pytest.approx(truth, abs=0.02)
        assert 'lower_encoder_slot_error_counts' not in found.parameters
        for key in ('upper_encoder_slot_error_counts', 'theta_N', 'J1_kg_m2', 'c31_per_s', 'b1_Nm'):
            holds(found, key, (TRUTH | {'upper_encoder_slot_error_counts': truth})[key])
    assert found.disturbances is None
    assert found.fit.problem.flaws == ()
    assert slots_of(found.logs, found.fit.problem.motions, 4096).keys() == {'upper'}
    assert not slots_of(quiet({}), [motion_of(log, 4096) for log in quiet({})], 4096)


def test_a_reading_of_unequal_slots_lies_in_their_middle():
    s = 0.3
    base = _core.PlantOptions(options(set={'plant.upper_encoder_slot_error_counts': s}))
    angles = np.random.default_rng(1).uniform(-20.0, 20.0, (200000, 2))
    exact = angles / (2 * np.pi / 4096)
    counts, late = _core.encoder_counts(base, angles), np.array([s, 0.0])
    assert middles(exact, late) == pytest.approx(counts + 0.5 * (1.0 + late), abs=1e-9)
    errors = middles(exact, late) - exact
    even = counts[:, 0] % 2 == 0
    assert np.mean(even) == pytest.approx(0.5 * (1.0 + s), abs=0.005)
    for chosen, width in ((errors[even, 0], 1.0 + s), (errors[~even, 0], 1.0 - s), (errors[:, 1], 1.0)):
        assert np.mean(chosen) == pytest.approx(0.0, abs=0.005)
        assert np.var(chosen) == pytest.approx(width**2 / 12.0, rel=0.02)


def assert_named(misfit, words):
    """The right cause, or none where it does not suffice or has a rival; never another one."""
    assert f'{words} (' in misfit or re.match(r'the model lacks something, most in .*no single cause explains it', misfit), misfit


@pytest.mark.parametrize(('lacks', 'words'), [
    ({'stiff': 0.6}, "bearing drags less as time goes"),
    ({'at_rest': 0.15}, 'the friction is no straight line of the sliding speed')])
def test_bearings_that_warm_up_and_friction_by_stribeck_are_refused_by_their_name_or_none(lacks, words):
    assert_named(identify(others(4, **lacks)).misfit, words)


def test_a_rig_whose_logs_disagree_by_a_little_is_not_refused_but_less_certain():
    # Between the logs the brake's lag changed by 0.1 %, which only a rig that nothing else disturbs can show.
    random = np.random.default_rng(5)
    logs = [log_of(name, SETTINGS | ({'plant.c31_per_s': 1.001 * TRUTH['c31_per_s']} if name == 'pulses' else {}),
                   random.uniform(size=2)) for name in EXPERIMENTS]
    found = identify(logs)
    assert not found.misfit, found.misfit
    assert found.disturbances is not None
    for key in ('theta_N', 'J1_kg_m2', 'c31_per_s', 'b1_Nm'):
        holds(found, key, TRUTH[key])


def test_a_cause_widens_the_intervals_by_its_probability():
    # Joint normal equations of two parameters and one column, whose solution by hand is the closed form.
    random = np.random.default_rng(3)
    rows, free, at = random.standard_normal((50, 4)), np.array([0, 1]), np.array([2, 3])
    N, n = rows.T @ rows, rows.T @ random.standard_normal(50)
    moves = structure._moves(N, n, free, at)
    alone, joint = np.linalg.inv(N[:2, :2]), np.linalg.inv(N)
    shift = (joint @ n)[:2] - alone @ n[:2]
    assert moves @ moves.T == pytest.approx(np.outer(shift, shift) + joint[:2, :2] - alone)


def test_friction_that_falls_with_the_cars_speed_is_refused_by_name(tmp_path, monkeypatch, capsys):
    logs = others(4, by_speed_s_m=0.01)
    found = identify(logs)
    assert "the friction changes with the lower wheel's speed (-0.0" in found.misfit
    assert any(log.name in found.misfit for log in logs)
    assert all(estimate.low is None for estimate in found.parameters.values() if estimate.status != 'fixed')
    # The program says so, by its status too, and leaves no model behind, not even an older one.
    monkeypatch.setattr(program, 'identify', lambda *_, **__: found)
    (tmp_path / 'model.toml').write_text('an older one')
    assert program.main(['any', '--no-report', '--force', '--out', str(tmp_path)]) == program.MISFIT
    assert "the friction changes with the lower wheel's speed" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ['identified.json']


def following(part, factor):
    """Logs of a rig on which this factor over `part` follows the log and its states (angles, speeds, torque)."""
    logs = []
    for name in EXPERIMENTS:
        log, profile = log_of(name, SETTINGS), ''
        for _ in range(6):  # the states follow the factor, too
            base = _core.PlantOptions(options(set={**SETTINGS, f'plant.{part}_profile': profile}))
            states = _core.trajectory(base, [], log.inputs(), np.zeros(5))
            at = np.arange(0, len(log), 10)
            knots = zip(factor(log, states)[at], log.time_s[at], log.time_s[at[1:]])
            profile = 'time: 1; ' + '; '.join(f'{value:.6f} from {a:.3f} to {b:.3f}' for value, a, b in knots)
        log.counts = _core.encoder_counts(base, states[:, :2]).astype(float)
        logs.append(log)
    return logs


@pytest.mark.parametrize(('part', 'factor', 'words'), [
    ('motor_torque', lambda log, _: 1.0 - 0.02 * leaky(log, 1 / 8, log.motor_pwm), 'the motor gets weaker with its use'),
    ('brake_torque', lambda _, states: 0.88 + 0.0012 * states[:, 2], "the brake's torque changes with the upper wheel's speed"),
    ('brake_torque', lambda _, states: 1.0 + 0.1 * np.sin(states[:, 0]), "the brake's torque follows the upper wheel's angle")])
def test_what_the_plant_lacks_is_named_with_a_phase_in_which_it_acts_and_without_advice(part, factor, words):
    found = identify(following(part, factor))
    assert_named(found.misfit, words)
    if 'no single cause' in found.misfit:
        return
    log, phase = re.search(r'most in ([\w-]+), phase ([\w-]+)', found.misfit).groups()
    named = next(one for one in found.logs if one.name == log)
    duty = named.motor_pwm if part == 'motor_torque' else named.brake_pwm
    assert np.any(duty[named.phase == phase] > 0.0), (log, phase)
    assert not any('lifted' in note and 'run' in note for note in found.notes[1:])


def test_a_cause_is_named_only_if_it_suffices_without_a_rival_and_in_left_out_logs(monkeypatch):
    monkeypatch.setattr(structure, '_where', lambda *_: ('locked', 'brake'))
    causes = {cause.words: cause for cause in structure.CAUSES}
    falls, acts_late, by_speed = (causes[words] for words in (
        'the friction falls with the sliding speed', 'the brake acts late', "the friction changes with the lower wheel's speed"))

    def surest(cause, coefficient=0.02, **more):
        return structure.Found(cause, coefficient, 31.0, 1.0, **{'together': 1.1 * 31.0**2, 'foretold': True, **more})
    beside = structure.Found(acts_late, 1e-3, 12.0, 1.0)
    assert structure.named([surest(by_speed), beside])
    assert not structure.named([surest(by_speed, foretold=False), beside])
    assert not structure.named([surest(by_speed, together=1.2 * 31.0**2), beside])
    assert not structure.named([surest(by_speed), dataclasses.replace(beside, sure=23.0)])
    assert not structure.named([surest(falls), beside])  # the plant has that: it was tried
    assert structure.named([surest(falls, -0.02), beside])  # it cannot have that
    said = structure.sentence([surest(falls, -0.02)], None)
    assert 'plant: the friction rises with the sliding speed (-0.02 per m/s, 31' in said
