"""abs_hil.identify with encoders that a computer reads early or late."""
import dataclasses
import pathlib

import numpy as np
import pytest

import abs_hil
from abs_hil.core import _core
from abs_hil.identification.advice import log_of
from abs_hil.identification.encoders import jitter_of
from abs_hil.identification.logs import Log, motion_of

COUNTS_PER_REV = 4096
PER_COUNT_RAD = 2 * np.pi / COUNTS_PER_REV
JITTER_S = 12e-6
TRUTH = {'plant.theta_N': 26.0, 'plant.J1_kg_m2': 8.2e-3, 'plant.c31_per_s': 22.0, 'plant.u0': 0.43}


def coasting(late_s, told_s=0.0, stamps_s=0.0):
    """20 s in which both wheels coast from 170 rad/s, in closed form, read late by late_s; told_s of that stands in the log
    beside its times, stamps_s in its times."""
    time_s = 1e-3 * np.arange(20_000)
    turned = 170.0 * 10.0 * (1.0 - np.exp(-(time_s + late_s) / 10.0))
    counts = np.floor(np.column_stack([turned, 0.97 * turned]) / PER_COUNT_RAD)
    nothing = np.zeros(len(time_s))
    return Log('coasting', pathlib.Path('coasting.csv'), '', time_s + stamps_s, counts, nothing, nothing, nothing,
               np.full(len(time_s), ''), np.column_stack([told_s + nothing] * 2))


def found_in(log):
    return jitter_of([log], [motion_of(log, COUNTS_PER_REV)], COUNTS_PER_REV)[0]


def test_jitter_is_found_where_it_is():
    late_s = JITTER_S * np.random.default_rng(1).standard_normal(20_000)
    assert found_in(coasting(late_s)) == pytest.approx(JITTER_S, rel=0.03)
    assert found_in(coasting(0.0)) == 0.0


def test_times_that_the_log_tells_are_no_jitter():
    late_s = JITTER_S * np.random.default_rng(2).standard_normal(20_000)
    assert found_in(coasting(late_s, told_s=late_s)) == 0.0
    assert found_in(coasting(late_s, stamps_s=late_s)) == 0.0
    assert found_in(coasting(0.0, stamps_s=late_s)) == pytest.approx(JITTER_S, rel=0.03)  # the times are wrong, not the readings


def test_errors_that_the_wheels_do_not_share_are_no_jitter():
    log = coasting(0.0)
    log.counts += np.round(2.0 * np.random.default_rng(3).standard_normal(log.counts.shape))
    assert found_in(log) == 0.0


def test_readings_weigh_as_in_generalised_least_squares():
    random = np.random.default_rng(4)
    rows, parameters = 60, 3
    piece = {'by_state': random.standard_normal((rows, 2, 3)), 'by_parameter': random.standard_normal((rows, 2, parameters)),
             'residual': random.standard_normal((rows, 2, 2)), 'weight': random.uniform(0.1, 1.0, (rows, 2)),
             'first': np.array([0, rows]), 'common_sd': random.uniform(0.0, 5.0, (rows, 2))}
    piece['weight'][[3, 5], [0, 1]] = 0.0
    piece['weight'][7] = 0.0
    sums = _core.condense(piece)
    angle = np.broadcast_to(np.eye(2), (rows, 2, 2))
    design = np.concatenate([angle, piece['by_state'], piece['by_parameter']], axis=2)
    gram, cross, square, logarithms = 0.0, 0.0, 0.0, 0.0
    for row in range(rows):
        there = piece['weight'][row] > 0.0
        shared = piece['common_sd'][row, there]
        weight = np.linalg.inv(np.diag(1.0 / piece['weight'][row, there]) + np.outer(shared, shared))
        by, left = design[row, there], piece['residual'][row, there]
        gram, cross, square = gram + by.T @ weight @ by, cross + by.T @ weight @ left, square + left.T @ weight @ left
        logarithms += np.linalg.slogdet(weight)[1]
    np.testing.assert_allclose(sums['gram'][0], gram, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(sums['cross'][0], cross, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(sums['square'][0], square, rtol=1e-11, atol=1e-11)
    assert sums['log_weight'][0] == pytest.approx(logarithms)
    assert sums['readings'][0] == pytest.approx([2 * rows - 4, piece['weight'].sum()])


def jittering(name, random):
    """The log of an experiment, with readings that jitter: from a simulation whose encoder has 64 times as many counts."""
    finer = 64
    log = log_of(name, TRUTH | {'plant.encoder_counts_per_rev': finer * COUNTS_PER_REV})
    speed = motion_of(log, finer * COUNTS_PER_REV).speed_rad_s / PER_COUNT_RAD
    late_s = JITTER_S * random.standard_normal((len(log), 1))
    return dataclasses.replace(log, counts=np.floor((log.counts + 0.5) / finer + late_s * speed), first_counts=np.zeros(2))


def test_a_rig_is_identified_all_the_same():
    random = np.random.default_rng(5)
    found = abs_hil.identify([jittering(name, random) for name in ('lifted', 'duty-ramp', 'locked-stop', 'pulses')],
                             form='magic-formula')
    assert found.misfit == ''
    assert found.residual_counts_rms < 0.30
    assert any('read 12 us early or late' in note for note in found.notes)
    for key, truth in TRUTH.items():
        estimate = found.parameters[key.removeprefix('plant.')]
        assert estimate.status in ('identified', 'bounded'), key
        # Three half widths, so that a right interval of 95 % does not fail by chance.
        assert abs(estimate.value - truth) < 1.5 * (estimate.high - estimate.low), key
        assert estimate.high - estimate.low < 0.02 * truth, key
