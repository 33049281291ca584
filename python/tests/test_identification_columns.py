"""The columns of a fit, against differences of the likelihood; its quiet residual and its logs' disagreement, against chance."""
import dataclasses

import numpy as np
import pytest

from abs_hil.core import _core
from abs_hil.identification.advice import log_of
from abs_hil.identification.encoders import middles
from abs_hil.identification.found import disagreement
from abs_hil.identification.intervals import bootstrap
from abs_hil.identification.linear import filtered, keep_normals, linearise, run_filter, solved, step
from abs_hil.identification.parameters import ALL_FORMS, DELAY, FLAWS, FORMS
from abs_hil.identification.problem import QUIET, Fit, Problem, pieces_of

FLAWED = {'brake_dead_time_s': 0.0124, 'brake_fading_per_J': 2e-4, 'brake_cooling_per_s': 0.3, 'brake_hysteresis': 0.05,
          'brake_curvature': 0.1, 'brake_release_ratio': 1.3, 'friction_fall_s_m': 0.01}
LATE = {'brake_dead_time_s': 0.0124}


def cost_at(fit, values):
    """-2 log likelihood at these values, with the states of the fit."""
    moved = fit.copy(values={**fit.values, **values})
    moved.scale = linearise(moved.problem, moved.values, moved.pieces)
    return sum(float(one[2][0]) + one[3] for one in run_filter(moved, QUIET)[1])


def problem_of(plant, truth, names, flaws, more=()):
    form = next(one for one in ALL_FORMS if one.settings == {f'plant.{key}': _value(plant, key) for key in ('tyre', 'load')})
    logs = [log_of(name, {**_settings(plant), **{f'plant.{key}': value for key, value in truth.items()}}, (0.3, 0.8))
            for name in names]
    problem = dataclasses.replace(Problem.of(form, plant, logs, {}), flaws=(*flaws, *more))
    given = {p.key: float(_value(plant, p.key)) for p in form.parameters}
    values = {**given, **truth, **{key: {DELAY: 4e-4, 'brake_rate_limit_Nm_s': 150.0}[key] for key in more}}
    return Fit(problem, values, pieces_of(problem, values, 0.05), QUIET, 0.05, np.zeros(len(problem.parameters), bool))


def _settings(plant):
    import abs_hil
    return {name: row['value'] for name, row in abs_hil.keys(plant=plant).items() if name.startswith('plant.')}


def _value(plant, key):
    return _settings(plant)[f'plant.{key}']


@pytest.mark.parametrize(('plant', 'truth', 'more'), [
    ('paper-timing', FLAWED, ()), ('paper-table1', LATE, (DELAY, 'brake_rate_limit_Nm_s')), ('inteco-manual', {}, ()),
    ('paper-table1', {**LATE, 'c31_per_s': 300.0}, ())], ids=['all flaws', 'late and limited', 'the maker', 'fast lag'])
def test_each_column_is_the_slope_of_the_likelihood(plant, truth, more):
    """Motor and brake change within one window, and wheels stand, part and lock."""
    fit = problem_of(plant, truth, ('pulses', 'locked-stop'), [flaw.key for flaw in FLAWS if flaw.key in truth], more)
    for _ in range(2):
        step(fit, QUIET)  # nothing is free: the states alone come to rest
    fit.scale = linearise(fit.problem, fit.values, fit.pieces)
    N, _ = keep_normals(fit, run_filter(fit, QUIET)[1])
    for i, p in enumerate(fit.problem.parameters):
        if p.key == 'u0':
            continue
        own = 1.0 / np.sqrt(N[i, i])  # a standard deviation, if all others were known
        # Away from the truth by so much that the slope does not vanish.
        away = fit.copy(values={**fit.values, p.key: fit.values[p.key] + 4.0 * own * fit.scale[i]}, moved=None)
        away.scale = linearise(away.problem, away.values, away.pieces)
        slope = -2.0 * keep_normals(away, run_filter(away, QUIET)[1])[1][i] / away.scale[i]
        h = 0.5 * own * fit.scale[i]
        costs = [cost_at(away, {p.key: away.values[p.key] + sign * h}) for sign in (1.0, -1.0)]
        assert slope == pytest.approx((costs[0] - costs[1]) / (2.0 * h), rel=0.02), p.key


@pytest.mark.parametrize('errors', ['white', 'phases'])
def test_logs_of_one_rig_disagree_as_by_chance(errors):
    """40 draws at the truth, estimated anew: chi-square over its degrees of freedom has the mean 1. Independent errors are what
    the filter assumes. Those of counts at other phases follow each other, and have variances of other draws."""
    fit = problem_of('paper-timing', LATE, ('lifted', 'duty-ramp', 'locked-stop', 'pulses'), LATE)
    fit.free = np.array([p.key != 'u0' for p in fit.problem.parameters])
    for _ in range(2):
        step(fit, QUIET)
    fit.scale = linearise(fit.problem, fit.values, fit.pieces)
    keep_normals(fit, run_filter(fit, QUIET)[1])
    scores = bootstrap(fit, seed=7).scores if errors == 'phases' else None
    per_count, random = fit.problem.radians_per_count, np.random.default_rng(1)
    none, draws, batch = np.zeros(2)[:, None], 40, 20
    found = []
    for _ in range(0, draws, batch):
        every = []
        for piece in fit.pieces:
            from_edge = piece.linear['read'] / per_count + random.uniform(size=(1, 2, batch))
            error = (middles(from_edge, none) - from_edge if errors == 'phases' else
                     random.uniform(-0.5, 0.5, from_edge.shape) / np.sqrt(np.maximum(piece.linear['weight'], 1e-9))[:, :, None])
            changed = {**piece.linear, 'residual': error * per_count, 'gap': np.zeros((*piece.states.shape, batch))}
            changed.update(_core.condense(changed))
            every += filtered(fit, [dataclasses.replace(piece, linear=changed)], QUIET)
        for draw in range(batch):
            N, n = keep_normals(fit, [(one[0], one[1][:, draw:draw + 1], one[2][draw:draw + 1], *one[3:]) for one in every])
            fit.right = fit.right - fit.normal @ solved(fit, N, n)  # at the estimate of this draw
            found.append(list(disagreement(fit, scores).values()))
    assert 0.9 < np.mean(found) < 1.1
    assert np.max(found) < 6.0


def test_the_bound_of_the_residual_is_that_of_its_readings():
    """Of even errors alone, the residual's square is beyond four standard deviations once in 30,000 draws, and it shrinks with the
    number of readings as 1 / sqrt(n)."""
    fit = problem_of('paper-table1', {}, ('locked-stop',), ())
    fit.scale = linearise(fit.problem, fit.values, fit.pieces)
    n = sum(float(piece.linear['weight'].sum()) for piece in fit.pieces)
    squares = np.random.default_rng(2).uniform(-0.5, 0.5, (200, int(n)))**2
    rms = np.sqrt(squares.mean(axis=1))
    assert (rms < fit.bound_rms).all()
    assert fit.bound_rms**2 - 1 / 12 == pytest.approx(4.0 * np.std(squares.mean(axis=1)), rel=0.15)
    # Jitter that is known to 3 % only.
    jitters = dataclasses.replace(fit, problem=dataclasses.replace(fit.problem, jitter_s=1e-5, jitter_doubt=0.06))
    assert 0.31 > jitters.bound_rms > fit.bound_rms


def test_forms_free_what_bends_the_makers_curve():
    assert {'mu_w1', 'mu_w3'} <= {p.key for p in FORMS['inteco-mu'].parameters}
