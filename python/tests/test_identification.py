"""abs_hil.identify finds what the simulator knows, says what the logs do not tell, and refuses what is no log."""
import dataclasses
import gzip
import json
import re
import subprocess

import numpy as np
import pytest
from conftest import ABS_HIL

import abs_hil
from abs_hil import programs
from abs_hil.core import _core
from abs_hil.identification import intervals
from abs_hil.identification.advice import advise, log_of
from abs_hil.identification.fit import start_fit
from abs_hil.identification.linear import _relative, linearise, linearise_where_better, run_filter, slopes, step
from abs_hil.identification.logs import load_log, motion_of, segments_of
from abs_hil.identification.parameters import FORMS
from abs_hil.identification.problem import COUNT_VARIANCE, QUIET, Disturbances, Fit, Move, Problem, pieces_of
from abs_hil.identification.program import main
from abs_hil.identification.results import as_json, as_toml, equivalent_tyre

MAGIC = FORMS['magic-formula']
TRUTH = {'plant.theta_N': 26.0, 'plant.B': 24.0, 'plant.J1_kg_m2': 8.2e-3, 'plant.M10_Nm': 0.004, 'plant.c31_per_s': 17.0,
         'plant.motor_stall_torque_Nm': 2.3, 'plant.u0': 0.43}
#: what this rig has not
WITHOUT = ('brake_rate_limit_Nm_s', 'upper_encoder_eccentricity_rad', 'lower_encoder_eccentricity_rad')
#: wrong by 10 % to 25 %
START = {'theta_N': 20.0, 'B': 30.0, 'C': 1.5, 'J1_kg_m2': 6.5e-3, 'd1_Nms_rad': 1.4e-4, 'M10_Nm': 3e-3, 'b1_Nm': 17.0,
         'b2_Nm': -5.2, 'u0': 0.38, 'c31_per_s': 21.0, 'motor_stall_torque_Nm': 1.9}


@pytest.fixture(scope='module')
def logs():
    return [log_of(name, TRUTH, (0.3, 0.8)) for name in ('lifted', 'duty-ramp', 'locked-stop', 'pulses')]


@pytest.fixture(scope='module')
def start(tmp_path_factory):
    file = tmp_path_factory.mktemp('start') / 'start.toml'
    file.write_text('description = "start"\n[plant]\n' + '\n'.join(f'{key} = {value!r}' for key, value in START.items()))
    return file


@pytest.fixture(scope='module')
def found(logs, start):
    return abs_hil.identify(logs, start)


def truth_of(name):
    return abs_hil.keys(set=TRUTH)[f'plant.{name}']['value']


def test_a_run_is_a_log(tmp_path):
    run = abs_hil.simulate(experiment='pulses', set=TRUTH)
    run.to_csv(tmp_path / 'run.csv')
    of_run, of_file = load_log(run), load_log(tmp_path / 'run.csv')
    for name in ('time_s', 'counts', 'brake_pwm', 'motor_pwm', 'wheels_apart', 'phase', 'read_late_s', 'first_counts'):
        np.testing.assert_array_equal(getattr(of_run, name), getattr(of_file, name))
    assert (of_run.name, of_run.experiment) == ('pulses', 'pulses')
    with pytest.raises(ValueError, match='lacks the columns upper_counts'):
        load_log(abs_hil.Run({'time_s': run['time_s'], 'lower_counts': run['lower_counts'], 'brake_pwm': run['brake_pwm'],
                              'motor_pwm': run['motor_pwm']}))


def test_every_parameter_is_found(found):
    assert found.form == 'magic-formula'
    assert found.residual_counts_rms == pytest.approx(np.sqrt(COUNT_VARIANCE), rel=0.02)
    for name, estimate in found.parameters.items():
        if name == 'u0':
            assert abs(estimate.value - truth_of(name)) < 1 / 4095
        elif name in WITHOUT:
            assert (estimate.value, estimate.status) == (0.0, 'bounded'), name
        elif estimate.status != 'fixed':
            assert estimate.value == pytest.approx(truth_of(name), rel=3e-3 if name == 'M10_Nm' else 5e-4), name
        assert estimate.status in (('bounded',) if name in WITHOUT else ('identified', 'fixed')), name
        assert estimate.low <= estimate.value <= estimate.high


def test_a_wrong_given_inertia_scales_all_torques(found, logs, start):
    """The null direction: inertias and torques have one common scale."""
    scaled = abs_hil.identify(logs, start, fix={'J2_kg_m2': 1.1 * found.parameters['J2_kg_m2'].value}, form='magic-formula')
    for name in ('J1_kg_m2', 'b1_Nm', 'motor_stall_torque_Nm', 'M20_Nm', 'theta_N'):
        assert scaled.parameters[name].value == pytest.approx(1.1 * found.parameters[name].value, rel=1e-4), name
    for name in ('B', 'C', 'c31_per_s', 'r1_m'):
        assert scaled.parameters[name].value == pytest.approx(found.parameters[name].value, rel=1e-4), name


def rows_of(log, count):
    """The first rows of a log."""
    return dataclasses.replace(log, **{name: getattr(log, name)[:count] for name in (
        'time_s', 'counts', 'brake_pwm', 'motor_pwm', 'wheels_apart', 'phase', 'read_late_s')})


def gentle_logs(logs):
    """No braking of rolling wheels at all."""
    return [logs[0], log_of('coast-down', TRUTH, (0.1, 0.6))]


def test_gentle_braking_tells_only_the_product(logs, start):
    gentle = abs_hil.identify(gentle_logs(logs), start, form='magic-formula')
    product = truth_of('theta_N') * truth_of('B') * truth_of('C')
    found = gentle.combinations['theta_B_C_N']
    assert found.status == 'identified'
    assert found.low <= product <= found.high
    assert found.value == pytest.approx(product, rel=5e-3)
    assert (found.high - found.low) / product < 0.01
    apart = gentle.parameters['C']
    assert apart.low is None or (apart.high - apart.low) / apart.value > 0.01
    assert any('theta_N, B and C are known better together' in note and 'slip-sweep' in note for note in gentle.notes)
    assert gentle.parameters['u0'].status != 'identified'


def test_logs_that_do_not_tell_the_form_leave_it_open(logs, start):
    found = abs_hil.identify(logs[:1], start)  # rolling, and a free wheel
    assert 'do not tell the form' in found.misfit and found.undecided
    assert as_json(found)['form'] == 'undecided'
    assert all(found.parameters[name].low is None for name in ('theta_N', 'B', 'C'))
    holds = found.parameters['J1_kg_m2']  # what both forms share
    assert holds.status == 'identified' and holds.low <= truth_of('J1_kg_m2') <= holds.high


def test_a_start_with_the_magic_formula_on_the_lever_has_both_forms_tried_with_its_load(tmp_path):
    tyre = {'plant.tyre': 'magic-formula', 'plant.load': 'lever', 'plant.mu_peak': 0.42, 'plant.B': 24.0}
    start = tmp_path / 'start.toml'
    start.write_text('description = "start"\n[plant]\ntyre = "magic-formula"\nload = "lever"\nmu_peak = 0.36\n')
    found = abs_hil.identify([log_of(name, tyre, (0.3, 0.8)) for name in ('lifted', 'duty-ramp', 'locked-stop', 'pulses')], start)
    assert not found.misfit and found.form == 'magic-formula', found.misfit
    for name, truth in (('mu_peak', 0.42), ('B', 24.0), ('lever_Mg_Nm', abs_hil.keys()['plant.lever_Mg_Nm']['value'])):
        assert found.parameters[name].status == 'identified' and found.parameters[name].value == pytest.approx(truth, rel=1e-3)
    model = tmp_path / 'model.toml'
    model.write_text(as_toml(found))
    assert abs_hil.keys(plant=model)['plant.load']['value'] == 'lever'
    believed = abs_hil.keys(plant=model, model=model)
    for name, value in equivalent_tyre(found.fit.problem.base, found.values()).items():
        assert believed[f'model.{name}']['value'] == value


def test_acceleration_alone_promises_nothing_of_brake_and_tyre(logs, start):
    run_up = rows_of(logs[2], int(np.argmax(logs[2].brake_pwm > 0)) - 250)
    found = abs_hil.identify([run_up], start, form='magic-formula')
    for name in ('b1_Nm', 'b2_Nm', 'c31_per_s', 'u0', 'theta_N', 'B', 'C', 'M10_Nm'):
        estimate = found.parameters[name]
        assert estimate.status != 'identified', name
        assert estimate.low is None or estimate.low <= truth_of(name) <= estimate.high, name
    if found.residual_counts_rms > 1.0:  # it then ends far from the truth
        assert any('the model does not follow the logs' in note for note in found.notes)
        assert all(e.low is None for e in found.parameters.values() if e.status != 'fixed')


def test_a_brake_that_stays_in_its_dead_zone_promises_nothing_of_itself(logs, start):
    dead = rows_of(logs[1], int(np.argmax(logs[1].brake_pwm > 0.4)))
    found = abs_hil.identify([dead], start, form='magic-formula')
    for name in ('b1_Nm', 'b2_Nm', 'c31_per_s', 'u0'):
        assert found.parameters[name].status == 'not-identifiable', name
        assert found.parameters[name].low is None, name


def test_logs_of_two_rigs_are_named(logs, start):
    other = log_of('locked-stop', {**TRUTH, 'plant.theta_N': 32.0, 'plant.J1_kg_m2': 6.5e-3})
    mixed = abs_hil.identify([logs[0], logs[1], logs[2], other], start, form='magic-formula')
    assert any('the logs disagree' in note for note in mixed.notes)
    assert all(e.low is None for e in mixed.parameters.values() if e.status != 'fixed')


def test_a_faded_brake_is_a_drift(logs, start):
    faded = log_of('pulses', {**TRUTH, 'plant.b1_Nm': 0.9 * truth_of('b1_Nm'), 'plant.b2_Nm': 0.9 * truth_of('b2_Nm')})
    found = abs_hil.identify([*logs[:3], faded], start, form='magic-formula', drift=['brake_torque'])
    assert found.parameters['brake_factor_4'].value == pytest.approx(0.9, rel=1e-3)
    assert found.parameters['b1_Nm'].value == pytest.approx(truth_of('b1_Nm'), rel=1e-3)


def test_late_inputs_are_found(logs, start):
    late = []
    for name in ('lifted', 'duty-ramp', 'locked-stop', 'pulses'):
        log = log_of(name, TRUTH)
        base = _core.PlantOptions({'set': [f'{key}={value!r}' for key, value in TRUTH.items()]})
        states = _core.trajectory(base, [('delay_s', 4e-4)], log.inputs(), np.zeros(5))
        log.counts = np.floor(states[:, :2] / (2 * np.pi / 4096))
        late.append(log)
    found = abs_hil.identify(late, start, form='magic-formula')
    assert found.parameters['delay_s'].value == pytest.approx(4e-4, rel=0.02)


def small_problem(logs):
    """One short piece with a few windows, for comparisons with independent calculations."""
    problem = Problem.of(MAGIC, 'paper-table1', [logs[2]], {})
    problem.segments = [[(begin, begin + 300) for begin, _ in problem.segments[0][:1]]]
    values = {p.key: truth_of(p.key) for p in MAGIC.parameters} | {'delay_s': 0.0}
    pieces = pieces_of(problem, values, 0.05)
    scale = linearise(problem, values, pieces)
    return problem, values, pieces, scale


def test_sensitivities_are_those_of_the_simulated_log(logs):
    problem, values, pieces, scale = small_problem(logs)
    piece = pieces[0]
    rows = slice(int(piece.first[0]), int(piece.first[1]) + 1)
    inputs = {name: column[rows] for name, column in logs[2].inputs().items()}
    for i, p in enumerate(MAGIC.parameters):
        if p.key == 'u0':
            continue
        h = 1e-4 * scale[i]
        ends = [_core.trajectory(problem.base, problem.simulated(0, {**values, p.key: values[p.key] + sign * h})[0],
                                 inputs, piece.states[0])[:, :2] for sign in (1, -1)]
        expected = (ends[0] - ends[1]) / (2e-4)
        found = piece.linear['by_parameter'][:len(expected) - 1, :, i]
        np.testing.assert_allclose(found, expected[:-1], rtol=2e-3, atol=2e-6)


@pytest.mark.parametrize('form', FORMS.values(), ids=list(FORMS))
def test_lanes_and_single_simulations_give_the_same(logs, form, monkeypatch):
    """The logs contain wheels that stand, wheels apart and braking past the peak."""
    problem = Problem.of(form, 'paper-table1', [logs[0], logs[2]], {})
    values = {p.key: problem.base.values()[p.key] for p in form.parameters} | {'delay_s': 3e-4}
    pieces = pieces_of(problem, values, 0.05)
    found = []
    for lanes in ('none', 'portable', ''):  # '': the widest of this computer
        monkeypatch.setenv('ABS_HIL_LANES', lanes)
        linearise(problem, values, pieces)
        found.append([dict(piece.linear) for piece in pieces])
    for single, *others in zip(*found):
        turns = (single['stands'] == 0)[:, None]
        for other in others:
            np.testing.assert_array_equal(other['angles'], single['angles'])
            np.testing.assert_array_equal(other['end'], single['end'])
            np.testing.assert_allclose(other['by_parameter'], single['by_parameter'], rtol=1e-12, atol=1e-12)
            by_speed = [one['end_by_state'][:, :, :2] * turns for one in (other, single)]
            np.testing.assert_allclose(*by_speed, rtol=1e-12, atol=1e-12)
    assert any(piece.stands.any() for piece in pieces)


def test_the_filter_is_generalised_least_squares(logs):
    """Against dense algebra: all readings of a piece at once, their covariance from the states and the disturbances."""
    problem, values, pieces, scale = small_problem(logs)
    piece = pieces[0]
    disturbances = Disturbances.of(0.02, 0.01, 0.3)
    fit = Fit(problem, values, [piece], disturbances, 0.05, np.ones(len(scale), bool), scale=scale)
    way = _relative(problem, values, scale)
    variance = problem.variance_rad2
    linear = {**piece.linear, 'stands': np.zeros_like(piece.stands)}
    N, right, square, log_variance, _ = _core.filter_pieces([linear], way, disturbances.sd, disturbances.time_constant_s,
                                                            variance)[0]
    windows, n = len(piece.first) - 1, len(scale)
    # State of window w as a linear function of: first state (5), disturbances of all windows (5 each), parameters, 1.
    size = 5 + 5 * windows
    state, by_parameter, constant = np.zeros((5, size)), np.zeros((5, n)), np.zeros(5)
    state[:, :5] = np.eye(5)
    A, D, y, R = [], [], [], []
    for w in range(windows):
        chosen = slice(int(piece.first[w] - piece.first[0]), int(piece.first[w + 1] - piece.first[0]))
        unit = np.zeros((5, size))
        unit[:, 5 + 5 * w:10 + 5 * w] = np.eye(5)
        for row in range(chosen.start, chosen.stop):
            for wheel in range(2):
                H = np.concatenate([np.eye(2)[wheel], linear['by_state'][row, wheel]])
                own = linear['by_parameter'][row, wheel]
                A.append(H @ state + (way @ own) @ unit)
                D.append(own + H @ by_parameter)
                y.append(linear['residual'][row, wheel, 0] - H @ constant)
                R.append(variance / linear['weight'][row, wheel])
        F = np.hstack([np.eye(5, 2), linear['end_by_state'][w]])
        G = linear['end_by_parameter'][w]
        state = F @ state + (G @ way.T) @ unit
        by_parameter = F @ by_parameter + G
        constant = F @ constant + linear['gap'][w, :, 0]
    prior = np.zeros((size, size))
    prior[:5, :5] = np.diag(piece.prior_sd**2)
    time_s = problem.logs[0].time_s[piece.first]
    for i in range(windows):
        for j in range(windows):
            keeps = np.exp(-abs(time_s[i] - time_s[j]) / disturbances.time_constant_s)
            prior[5 + 5 * i:10 + 5 * i, 5 + 5 * j:10 + 5 * j] = np.diag(disturbances.sd**2 * keeps)
    A, D, y = np.array(A), np.array(D), np.array(y)
    S = A @ prior @ A.T + np.diag(R)
    solved = np.linalg.solve(S, np.column_stack([D, y]))
    np.testing.assert_allclose(N, D.T @ solved[:, :n], rtol=1e-5, atol=1e-6 * np.abs(N).max())
    np.testing.assert_allclose(right[:, 0], D.T @ solved[:, n], rtol=1e-4, atol=1e-6 * np.abs(right).max())
    assert square[0] == pytest.approx(y @ solved[:, n], rel=1e-5)
    assert log_variance == pytest.approx(np.linalg.slogdet(S)[1], rel=1e-7)
    assert len(fit.keys) == n


def test_slopes_by_the_disturbances_are_those_of_the_likelihood(logs):
    """The log contains a wheel that stands."""
    problem = Problem.of(MAGIC, 'paper-table1', [logs[2]], {})
    values = {p.key: truth_of(p.key) for p in MAGIC.parameters}
    fit = Fit(problem, values, pieces_of(problem, values, 0.05), QUIET, 0.05, np.ones(len(MAGIC.parameters), bool))
    fit.scale = linearise(problem, values, fit.pieces)
    assert any(piece.stands.any() for piece in fit.pieces)
    logarithms = np.log([[0.02, 0.01, 0.03, 0.05, 0.04], [0.3, 0.2, 0.5, 0.3, 0.1]])
    found = slopes(fit, disturbed := Disturbances(*np.exp(logarithms)), run_filter(fit, disturbed)[1])
    for place in np.ndindex(2, 5):
        costs = []
        for step_by in (1e-3, -1e-3):
            moved = logarithms.copy()
            moved[place] += step_by
            costs.append(run_filter(fit, Disturbances(*np.exp(moved)))[0])
        assert found[place] == pytest.approx((costs[0] - costs[1]) / 2e-3, rel=1e-3, abs=1e-3), place


def test_bootstrap_spread_is_that_of_the_information(found):
    """Steps of the counts are almost even noise where a wheel turns: both ways to an interval must agree within a factor."""
    boot, known = found.spread, intervals.information(found.fit)
    assert not np.array_equal(boot.covariance, known.covariance)
    free = found.fit.free
    ratio = np.sqrt(np.diag(boot.covariance)[free] / np.diag(known.covariance)[free])
    assert (ratio > 0.5).all() and (ratio < 2.0).all(), dict(zip(np.array(found.fit.keys)[free], ratio))


def test_advice_prefers_what_is_missing(logs, start):
    advice = advise(abs_hil.identify(gentle_logs(logs), start, form='magic-formula'))
    best = {one.experiment: one for one in advice}
    assert advice[0].experiment in ('slip-sweep', 'locked-stop', 'pulses')
    assert best['slip-sweep'].narrower['B'] < 0.1
    assert all(a.gain >= b.gain for a, b in zip(advice, advice[1:]))


def csv_of(log, counts=None):
    counts = log.counts if counts is None else counts
    rows = ['time_s,upper_counts,lower_counts,brake_pwm,motor_pwm,wheels_apart']
    rows += [f'{t!r},{int(u)},{int(lo)},{b!r},{m!r},{int(a)}' for t, (u, lo), b, m, a in
             zip(log.time_s.tolist(), counts, log.brake_pwm.tolist(), log.motor_pwm.tolist(), log.wheels_apart)]
    return '\n'.join(rows) + '\n'


def test_plain_csv_gzip_and_wrapped_counters(logs, tmp_path):
    log = logs[2]
    wrapped = (log.counts + 2**31 - 5000 + 2**31) % 2**32 - 2**31
    file = tmp_path / 'log.csv.gz'
    file.write_bytes(gzip.compress(csv_of(log, wrapped).encode()))
    again = load_log(file)
    np.testing.assert_array_equal(again.counts, log.counts - log.counts[0])
    np.testing.assert_array_equal(again.brake_pwm, log.brake_pwm)
    assert again.notes == []
    cut = tmp_path / 'cut.csv.gz'
    cut.write_bytes(file.read_bytes()[:-3000])
    shorter = load_log(cut)
    assert 200 < len(shorter) < len(log) and any('cut off' in note for note in shorter.notes)
    np.testing.assert_array_equal(shorter.counts, again.counts[:len(shorter)])


def test_pieces_leave_out_rest_and_changes_of_contact(logs):
    log = logs[0]
    motion = motion_of(log, 4096)
    for begin, end in segments_of(log, motion):
        assert len(set(log.wheels_apart[begin:end])) == 1
        assert motion.speed_rad_s[begin:end].max(axis=1).min() > 2


@pytest.mark.parametrize(('change', 'words'), [
    (lambda text: text.replace('upper_counts', 'count1'), 'lacks the columns upper_counts'),
    (lambda text: '\n'.join(text.split('\n')[:100]) + '\n', 'has 99 rows; give at least 200'),
    (lambda text: text.replace('\n0.5,', '\n0.1,', 1), 'time_s does not rise at row'),
    (lambda text: text.replace(',0.0,1.0,', ',0.0,1.5,'), 'motor_pwm is 1.5 in row 1; give a duty from 0 to 1'),
    (lambda text: text.replace(',0.0,1.0,', ',nan,1.0,', 1), 'brake_pwm is nan in row 1; give a duty from 0 to 1'),
    (lambda text: text.replace(',0.0,1.0,0\n', ',0.0,1.0,\n', 1), 'wheels_apart is nan in row 1; give 0, or 1'),
    (lambda text: text.replace(',0.0,1.0,0\n', ',0.0,1.0,2\n', 1), 'wheels_apart is 2 in row 1; give 0, or 1'),
    (lambda text: text.replace(',0.0,1.0,0\n', ',0.0,1.0\n', 1), 'log.csv:2: the row has 5 fields instead of 6'),
    (lambda text: text.replace('\n0.0,', '\ninf,'), 'time_s is inf in row 1; give a time in seconds'),
    (lambda text: text.replace('\n0.0,0,', '\n0.0,inf,'), 'upper_counts is inf in row 1; give whole counts of the encoder'),
    (lambda text: text.replace('\n0.0,0,', '\n0.0,1e30,'), 'upper_counts is 1e.30 in row 1; give whole counts'),
    (lambda text: text.replace('\n0.0,0,', '\n0.0,0.5,'), 'upper_counts is 0.5 in row 1; give whole counts'),
    (lambda text: re.sub(r'\n([^,]+)', lambda row: f'\n{1000 * float(row[1] or 0):.9g}', text[:-1]) + '\n',
     'time_s rises by 1 from row to row; give seconds'),
    (lambda text: 'nonsense\n1\n', 'lacks the columns time_s'),
    (lambda text: text.replace(',0.0,1.0,', ',0.0,one,'), 'log.csv:2: motor_pwm: "one" is not a number'),
])
def test_what_is_no_log_is_refused(logs, tmp_path, change, words):
    file = tmp_path / 'log.csv'
    file.write_text(change(csv_of(logs[2])))
    with pytest.raises(ValueError, match=words):
        load_log(file)


def test_wheels_apart_that_the_log_does_not_mark_are_refused(logs, start):
    unmarked = dataclasses.replace(logs[0], wheels_apart=np.zeros(len(logs[0])))
    with pytest.raises(ValueError, match='wheels seem to be apart.* column wheels_apart'):
        abs_hil.identify([unmarked, *logs[1:]], start)


def test_swapped_counters_are_refused(logs, start):
    swapped = [dataclasses.replace(log, counts=log.counts[:, ::-1]) for log in logs[:3]]
    with pytest.raises(ValueError, match='seem to be swapped'):
        abs_hil.identify(swapped, start)


@pytest.mark.parametrize(('change', 'words'), [
    (lambda log: {'counts': log.counts * [1, -1]}, 'lower_counts falls by .* give it the other sign'),
    (lambda log: {'counts': log.counts * [-1, 1]}, 'upper_counts falls by .* give it the other sign'),
    (lambda log: {'counts': log.counts + 5000 * (log.time_s > 4)[:, None] * [0, 1]}, 'lower_counts jumps by 50.. in row 4002'),
    (lambda log: {'counts': np.floor(log.counts * [0.25, 1])}, 'one encoder has another number of counts per revolution'),
    (lambda log: {'counts': np.floor(log.counts / 4096)}, 'with 4096 counts per revolution the upper wheel reaches .* unit'),
    (lambda log: {'brake_pwm': log.motor_pwm, 'motor_pwm': log.brake_pwm}, 'brake_pwm and motor_pwm seem to be swapped'),
])
def test_columns_that_hold_something_else_are_named(logs, start, change, words, monkeypatch):
    monkeypatch.setattr('abs_hil.identification.estimate.start_fit', lambda *_: pytest.fail('it fits'))
    with pytest.raises(ValueError, match=words):
        abs_hil.identify([dataclasses.replace(log, **change(log)) for log in logs[1:3]], start)


def test_readings_that_the_rig_marks_as_lost_are_left_out():
    run = abs_hil.simulate(experiment='pulses')
    valid = np.arange(len(run)) % 50 != 7
    run.columns['sample_valid'] = valid.astype(float)
    run.columns['upper_counts'] = np.where(valid, run['upper_counts'], np.nan)
    for marked in (True, False):
        if not marked:  # an empty cell says it as well
            del run.columns['sample_valid']
        log = load_log(run)
        assert len(log) == len(run) and (np.isnan(log.counts[:, 0]) == ~valid).all()


@pytest.mark.parametrize(('given', 'words'), [
    (['--seed', '-1'], 'whole number from 0'),
    (['--fix', 'J2_kg_m2=nan'], r'--fix J2_kg_m2 = nan is not valid; give a number in \[0.0001, 1000\] kg m\^2'),
    (['--fix', 'J2_kg_m2=-1'], r'--fix J2_kg_m2 = -1 is not valid; give a number in'),
    (['--fix', 'r2_m=inf'], r'--fix r2_m = inf is not valid; give a number in'),
    (['--validate', 'nosuch'], 'nosuch'),
    (['--out', '/proc/nosuch/out'], '--out "/proc/nosuch/out" cannot be made: .*; create'),
])
def test_the_program_refuses_what_it_is_told_before_it_works(logs, tmp_path, monkeypatch, capsys, given, words):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr('abs_hil.identification.estimate.start_fit', lambda *_: pytest.fail('it fits'))
    (tmp_path / 'log.csv').write_text(csv_of(logs[2]))
    assert programs.start('identify', ['log.csv', '--no-report', '--out', 'new/out', *given]) == 2
    said = capsys.readouterr().err
    assert re.search(words, said) and 'first values' not in said
    assert not (tmp_path / 'new').exists()
    with pytest.raises(ValueError, match='seed -1'):
        abs_hil.identify([logs[2]], seed=-1)


def test_unknown_keys_are_refused(logs, start):
    with pytest.raises(ValueError, match='--fix gamma: no such parameter; give one of B, C'):
        abs_hil.identify(logs, start, fix={'gamma': 1.0})
    with pytest.raises(ValueError, match='--drift motor: no such drift'):
        abs_hil.identify(logs, start, drift=['motor'])


@pytest.fixture(scope='module')
def written(found, tmp_path_factory, abs_hil_program):
    """What the program writes from a series that abs_hil ran, with a run that validates."""
    folder = tmp_path_factory.mktemp('written')
    for name in ('lifted', 'duty-ramp', 'locked-stop', 'paper'):
        abs_hil_program('--fast', '--no-lcm', '--experiment', name, '--out', folder / name,
                               *[word for key, value in TRUTH.items() for word in ('--set', f'{key}={value!r}')])
    # The launcher finds plotly.js, which the page needs.
    result = subprocess.run([ABS_HIL.parent / 'abs_identify', *(folder / name for name in ('lifted', 'duty-ramp', 'locked-stop')),
                             '--form', 'magic-formula', '--validate', folder / 'paper', '--out', folder / 'out'],
                            capture_output=True, text=True, timeout=300, check=False)
    assert result.returncode == 0, result.stderr
    return folder


def test_the_program_writes_its_files(written, capsys):
    content = json.loads((written / 'out' / 'identified.json').read_text())
    assert content['parameters']['theta_N']['value'] == pytest.approx(26.0, rel=5e-4)
    assert set(content['parameters']['theta_N']) == {'value', 'low', 'high', 'status'}
    assert abs(content['validation']['stop_distance_m_error']) < 1e-3
    assert len(content['logs'][0]['sha256']) == 64
    page = (written / 'out' / 'report.html').read_text()
    assert 'What to run next' in page and 'stop distance, m' in page
    assert main([str(written / 'lifted'), '--out', str(written / 'out')]) == 2
    assert 'exists; give another --out, or --force' in capsys.readouterr().err


def test_the_model_closes_the_loop(written):
    """Laws that believe the identified model stop as with the true one."""
    model = written / 'out' / 'model.toml'
    for controller in ('adaptive', 'adaptive-actuator'):
        true = abs_hil.simulate(controller=controller, set=TRUTH)
        with_model = abs_hil.simulate(controller=controller, set=TRUTH, model=model)
        assert with_model.summary['stop_distance_m'] == pytest.approx(true.summary['stop_distance_m'], rel=3e-3)
    as_plant = abs_hil.simulate(plant=model)
    assert as_plant.summary['stop_distance_m'] == pytest.approx(abs_hil.simulate(set=TRUTH).summary['stop_distance_m'],
                                                                rel=1e-3)


@pytest.mark.parametrize('controller', ['adaptive', 'adaptive-actuator', 'adaptive-optimal'])
def test_laws_stop_as_with_the_true_model(found, tmp_path, controller):
    """Identified from start values that are 10 % to 25 % off."""
    model = tmp_path / 'model.toml'
    model.write_text(as_toml(found))
    stops = [abs_hil.simulate(controller=controller, set=TRUTH, **given).summary['stop_distance_m']
             for given in ({}, {'model': model})]
    assert stops[1] == pytest.approx(stops[0], rel=3e-3)


def test_first_values_need_no_good_start(logs, start):
    problem = Problem.of(MAGIC, start, logs, {})
    fit = start_fit(problem, {key: value for key, value in problem.base.values().items() if isinstance(value, float)})
    for name in ('J1_kg_m2', 'theta_N', 'b1_Nm', 'c31_per_s', 'motor_stall_torque_Nm'):
        assert fit.values[name] == pytest.approx(truth_of(name), rel=0.05), name
    assert QUIET.sd.max() == 0.0


def test_a_step_that_makes_it_worse_is_halved(logs, start):
    problem = Problem.of(MAGIC, start, [logs[2]], {})
    fit = start_fit(problem, {key: value for key, value in problem.base.values().items() if isinstance(value, float)})
    step(fit, fit.disturbances)
    good, states = fit.values, [piece.states for piece in fit.pieces]
    linearise_where_better(fit)
    cost = float(fit.cost.sum())
    # Eight times the friction is a plant that no log here comes from: three halvings or more lead back.
    fit.values = {**good, 'theta_N': 8 * good['theta_N']}
    fit.moved = Move(good, states, cost)
    linearise_where_better(fit)
    assert good['theta_N'] < fit.values['theta_N'] <= 1.9 * good['theta_N']
