"""abs_hil.identify finds a limit of the brake's rate and eccentric encoders where a rig has them, and only there."""
import tomllib

import numpy as np
import pytest

import abs_hil
from abs_hil.identification.advice import log_of
from abs_hil.identification.results import as_toml

TRUTH = {'plant.theta_N': 26.0, 'plant.J1_kg_m2': 8.2e-3, 'plant.c31_per_s': 22.0, 'plant.u0': 0.43}
LIMIT = {'plant.brake_rate_limit_Nm_s': 100.0}
DISCS = {'plant.upper_encoder_eccentricity_rad': 5e-3, 'plant.upper_encoder_phase_rad': 1.0,
         'plant.lower_encoder_eccentricity_rad': 2e-3, 'plant.lower_encoder_phase_rad': -2.0}
EXPERIMENTS = ('lifted', 'duty-ramp', 'locked-stop', 'pulses')


def logs_of(*flaws):
    settings = TRUTH | {key: value for flaw in flaws for key, value in flaw.items()}
    return [log_of(name, settings, (0.3, 0.8)) for name in EXPERIMENTS]


@pytest.fixture(scope='module')
def flawed():
    return abs_hil.identify(logs_of(LIMIT, DISCS))


def holds(found, name, truth, within):
    estimate = found.parameters[name]
    assert estimate.status == 'identified', name
    assert estimate.value == pytest.approx(truth, abs=within), name
    # Three half widths, so that a right interval of 95 % does not fail by chance.
    assert abs(estimate.value - truth) < 1.5 * (estimate.high - estimate.low), name


def test_both_are_found(flawed):
    assert flawed.residual_counts_rms < 0.30
    holds(flawed, 'brake_rate_limit_Nm_s', 100.0, 0.05)
    for key, value in DISCS.items():
        holds(flawed, key.removeprefix('plant.'), value, 0.01 if 'phase' in key else 1e-5)
    for key, value in TRUTH.items():
        if key != 'plant.u0':
            assert flawed.values()[key.removeprefix('plant.')] == pytest.approx(value, rel=5e-4), key


def test_the_model_file_has_them(flawed, tmp_path):
    file = tmp_path / 'model.toml'
    file.write_text(as_toml(flawed))
    content = tomllib.loads(file.read_text())
    assert content['plant']['brake_rate_limit_Nm_s'] == pytest.approx(100.0, abs=0.05)
    believed = abs_hil.keys(model=file)
    for key in DISCS:
        name = key.removeprefix('plant.')
        assert believed[f'model.{name}']['value'] == content['plant'][name] != 0.0


def test_one_run_in_which_the_wheels_coast_is_enough_for_the_discs():
    """The commands of docs/plants.md."""
    found = abs_hil.identify([log_of('coast-and-brake', TRUTH | DISCS, (0.3, 0.8))], form='magic-formula')
    for key, value in DISCS.items():
        holds(found, key.removeprefix('plant.'), value, 0.02 if 'phase' in key else 3e-5)


def test_counters_that_begin_anew_leave_the_phase_open(tmp_path):
    logs = logs_of(DISCS)
    for log, begins_at in zip(logs, (0, 1000, 2500, 3300)):
        log.first_counts = log.first_counts - begins_at
    found = abs_hil.identify(logs, form='magic-formula')
    holds(found, 'upper_encoder_eccentricity_rad', 5e-3, 1e-5)
    assert found.parameters['upper_encoder_phase_rad'].status == 'not-identifiable'
    assert any('its counter began at another place' in note for note in found.notes)
    file = tmp_path / 'model.toml'
    file.write_text(as_toml(found))
    # A correction with a wrong phase would be worse than none.
    assert abs_hil.keys(model=file)['model.upper_encoder_eccentricity_rad']['value'] == 0.0
    assert abs_hil.keys(plant=file)['plant.upper_encoder_eccentricity_rad']['value'] == pytest.approx(5e-3, abs=1e-5)


def test_a_rig_without_them_keeps_zero():
    found = abs_hil.identify(logs_of(), form='magic-formula')
    limit = found.parameters['brake_rate_limit_Nm_s']
    assert (limit.value, limit.low, limit.status) == (0.0, 0.0, 'bounded')
    assert any("no limit of the brake's rate" in note for note in found.notes)
    for wheel in ('upper', 'lower'):
        disc = found.parameters[f'{wheel}_encoder_eccentricity_rad']
        assert (disc.value, disc.low, disc.status) == (0.0, 0.0, 'bounded')
        assert 0.0 < disc.high < 1e-4
        assert f'{wheel}_encoder_phase_rad' not in found.parameters


def test_a_given_limit_is_kept():
    logs = logs_of(LIMIT)
    found = abs_hil.identify(logs, form='magic-formula', fix={'brake_rate_limit_Nm_s': 100.0})
    assert found.parameters['brake_rate_limit_Nm_s'].status == 'fixed'
    assert found.residual_counts_rms < 0.30
    assert found.values()['c31_per_s'] == pytest.approx(22.0, rel=1e-5)


def test_counters_of_the_log_are_those_of_the_encoder():
    log = logs_of(DISCS)[0]
    run = abs_hil.simulate(experiment='lifted', set=TRUTH | DISCS)
    counts = np.stack([run.columns['upper_counts'], run.columns['lower_counts']], axis=1)
    # The same motion from another place within the first count.
    assert np.abs(log.counts + log.first_counts - counts).max() <= 1.0
