"""Eccentric encoder discs: in the model, and learnt within a run before braking."""
from __future__ import annotations

import numpy as np
import pytest

import abs_hil

FLAWS = {'plant.upper_encoder_eccentricity_rad': 0.01, 'plant.upper_encoder_phase_rad': 1.0,
         'plant.lower_encoder_eccentricity_rad': 0.006, 'plant.lower_encoder_phase_rad': -2.0}
UNKNOWN = {'model.upper_encoder_eccentricity_rad': 0.0, 'model.lower_encoder_eccentricity_rad': 0.0}
NOT_LEARNT = {**UNKNOWN, 'control.observer.learn_eccentricity_s': 0.0}
PLANTS = ('paper-table1', 'paper-timing', 'inteco-manual')


def braking(controller='adaptive-peak', **changes):
    return abs_hil.simulate(controller, experiment='coast-and-brake', set={**FLAWS, **changes})


def speed_error(run, wheel):
    """Largest error of a wheel's estimated speed in the first quarter of braking, as a part of its speed."""
    rows = np.flatnonzero(run.columns['phase'] == 'brake')
    rows = rows[:len(rows) // 4]
    true = run.columns[f'omega{wheel}_rad_s'][rows]
    return float(np.abs(run.columns[f'omega{wheel}_est_rad_s'][rows] / true - 1.0).max())


def test_learning_while_coasting_does_as_well_as_knowing():
    unknown, known, learnt = braking(**NOT_LEARNT), braking(), braking(**UNKNOWN)
    without = abs_hil.simulate('adaptive-peak', experiment='coast-and-brake', set={key: 0.0 for key in FLAWS})
    for wheel in (1, 2):
        assert speed_error(unknown, wheel) > 2.0 * speed_error(known, wheel)
        assert speed_error(learnt, wheel) < 1.2 * speed_error(known, wheel)
    distance = {name: run.summary['stop_distance_m'] for name, run in
                (('unknown', unknown), ('known', known), ('learnt', learnt), ('without', without))}
    assert distance['unknown'] > 1.05 * distance['without']
    assert distance['known'] == pytest.approx(distance['without'], rel=0.03)
    assert distance['learnt'] == pytest.approx(distance['without'], rel=0.03)


def distances(start_rad_s, e_rad, **values):
    """Of adaptive-optimal at default settings, over three plants and several places of the discs."""
    places = ((1.0, -2.0), (-2.5, 0.5), (2.5, 2.0), (-1.5, 1.5))
    runs = [{'controller': 'adaptive-optimal', 'plant': plant, 'set': {
        'experiment.start_speed_rad_s': start_rad_s, **UNKNOWN, **values,
        'plant.upper_encoder_eccentricity_rad': e_rad, 'plant.upper_encoder_phase_rad': upper,
        'plant.lower_encoder_eccentricity_rad': e_rad, 'plant.lower_encoder_phase_rad': lower}}
        for plant in PLANTS for upper, lower in places]
    results = abs_hil.simulate_many(runs)
    assert set(results['fault']) == {''}
    return np.asarray(results['stop_distance_m'])


def test_discs_of_3_mrad_cost_little_by_default():
    """After a run-up, in which they are learnt, and from a start speed, where nothing can be learnt before braking."""
    for start_rad_s, most in ((0.0, 0.005), (170.0, 0.03)):
        excess = distances(start_rad_s, 0.003) / distances(start_rad_s, 0.0) - 1.0
        assert excess.mean() < most, start_rad_s
    ignored = distances(170.0, 0.003, **{'control.observer.unlearnt_eccentricity_rad': 0.0}) / distances(170.0, 0.0) - 1.0
    assert ignored.mean() > 0.1, 'the case is none'


def test_learning_leaves_sound_discs_alone_and_says_what_it_found():
    sound = abs_hil.simulate('adaptive-optimal')
    assert sound.summary['encoder_eccentricity_rad'] == {'upper': 0.0, 'lower': 0.0}
    off = abs_hil.simulate('adaptive-optimal', set=NOT_LEARNT)
    assert off.summary['encoder_eccentricity_rad'] == {'upper': None, 'lower': None}
    for name in ('omega1_est_rad_s', 'brake_torque_ref_Nm', 'slip'):
        np.testing.assert_array_equal(sound[name], off[name])
    found = abs_hil.simulate('adaptive', set={**FLAWS, **UNKNOWN}).summary['encoder_eccentricity_rad']
    assert found == {'upper': pytest.approx(0.01, rel=0.02), 'lower': pytest.approx(0.006, rel=0.02)}
