"""abs_hil.identification of coarse traces: it finds the rig that a screen or a figure showed, and says how badly it knows it."""
import json
import re

import numpy as np
import pytest

import abs_hil
from abs_hil import parsers, programs
from abs_hil.identification import program
from abs_hil.identification.speeds import identify_speeds
from abs_hil.identification.traces import load_trace

START = 'inteco-manual'
MU = {w: abs_hil.keys(plant=START)[f'plant.mu_{w}']['value'] for w in ('w1', 'w3', 'w4')}
R1, R2 = (abs_hil.keys(plant=START)[f'plant.{key}']['value'] for key in ('r1_m', 'r2_m'))
#: of a rig unlike the start: twice the torque, a dead time, hardly a lag, six tenths of the friction
TRUTH = {'plant.b1_Nm': 34.5, 'plant.b2_Nm': -16.3, 'plant.u0': 0.473, 'plant.c31_per_s': 300.0, 'plant.brake_dead_time_s': 0.0125,
         'plant.J1_kg_m2': 6.5e-3, **{f'plant.mu_{w}': 0.6 * value for w, value in MU.items()}}
AGE_S, WINDOW_S, BRAKES_S, RPM = 0.0076, 0.01, 0.2, 60 / (2 * np.pi)


def driven(duty_of, seconds):
    """Time and angles each 0.1 ms, and (time, slip as read) each 10 ms, of the rig as it rolls from 180 rad/s and brakes with
    duty_of(slip as read) from BRAKES_S on."""
    plant = abs_hil.Plant(START, TRUTH)
    plant.reset(omega1_rad_s=180.0 * R2 / R1, omega2_rad_s=180.0)
    step = 1e-4
    angles, slips, duty = [], [], 0.0
    for i in range(round(seconds / step)):
        state = plant.state
        angles.append((state.angle1_rad, state.angle2_rad))
        if i % 100 == 0:
            turned = np.subtract(angles[-1], angles[max(i - 100, 0)]) if i else np.array([R2, R1])
            slips.append((i * step, 1.0 - R1 * turned[0] / (R2 * turned[1])))
            duty = duty_of(round(slips[-1][1] / 0.004) * 0.004) if i * step >= BRAKES_S - 1e-9 else 0.0
        plant.advance(step, brake_duty=duty)
    return step * np.arange(len(angles)), np.array(angles), np.array(slips)


def figure(folder, duty_of, name='trace.csv', seconds=1.6):
    """A file as somebody reads it off a figure: the upper wheel's speed, AGE_S older than the slip, both as means over 10 ms, in
    steps of 5 rpm and 0.004, and the rolling wheels' slip of 0.014, which is none."""
    time_s, angles, slips = driven(duty_of, seconds)
    at = slips[slips[:, 0] >= 0.03, 0]
    upper = [np.interp(at - AGE_S - back, time_s, angles[:, 0]) for back in (0.0, WINDOW_S)]
    rpm = 5.0 * np.round((upper[0] - upper[1]) / WINDOW_S * RPM / 5.0)
    slip = 0.004 * np.round((1.0 - 0.986 * (1.0 - slips[slips[:, 0] >= 0.03, 1])) / 0.004)
    lines = [f'{t:.2f},{speed:.1f},{value:.4f}' for t, speed, value in zip(at, rpm, slip)]
    file = folder / name
    file.write_text('# read off a figure\ntime_s,upper_rpm,slip\n' + '\n'.join(lines) + '\n')
    return file


READ = {'window_s': WINDOW_S, 'speed_age_s': AGE_S, 'from_s': BRAKES_S, 'brake_from_s': BRAKES_S}


def relay(slip):
    return float(1.0 - 0.986 * (1.0 - slip) < 0.1)


@pytest.fixture(scope='module')
def found(tmp_path_factory):
    return identify_speeds([load_trace(figure(tmp_path_factory.mktemp('relay'), relay), READ | {'relay_below': 0.1})], START)


def test_a_relay_run_tells_brake_and_friction(found):
    assert not found.misfit
    truth = {'brake_dead_time_s': 0.0125, 'brake_torque_at_1_Nm': 18.2, 'friction_over_start': 0.6, 'J1_kg_m2': 6.5e-3}
    for name, value in truth.items():
        e = found.parameters[name]
        assert e.status == 'identified', (name, e)
        assert e.value == pytest.approx(value, rel=0.1), (name, e)
        assert abs(e.value - value) < 1.5 * (e.high - e.low), (name, e)
    # One duty tells no slope of the brake's line.
    assert found.parameters['u0'].status == 'fixed' and found.parameters['b1_Nm'].low is None


def test_an_age_that_is_not_told_becomes_a_dead_time(found, tmp_path):
    keys = {**READ, 'relay_below': 0.1, 'slip_age_s': 0.004, 'speed_age_s': AGE_S + 0.004}
    older = identify_speeds([load_trace(figure(tmp_path, relay), keys)], START)
    less = found.parameters['brake_dead_time_s'].value - older.parameters['brake_dead_time_s'].value
    assert less == pytest.approx(0.004, abs=0.0015)


def test_steps_of_several_duties_tell_the_brakes_line(tmp_path):
    traces = [load_trace(figure(tmp_path, lambda _, duty=duty: duty, f'step-{duty}.csv', 0.8), READ | {'brake_duty': duty})
              for duty in (0.65, 0.7, 0.75)]
    found = identify_speeds(traces, START)
    assert not found.misfit
    for name, value in (('brake_torque_at_0.65_Nm', 6.125), ('brake_torque_at_0.75_Nm', 9.575), ('friction_over_start', 0.6)):
        e = found.parameters[name]
        assert e.value == pytest.approx(value, rel=0.1), (name, e)
    assert found.parameters['b1_Nm'].value == pytest.approx(34.5, rel=0.3)


def test_the_program_writes_a_plant_that_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    figure(tmp_path, relay)
    told = [f'--reading={key}={value}' for key, value in (READ | {'relay_below': 0.1}).items()]
    assert programs.start('identify', ['--speeds', 'trace.csv', *told, '--start', START, '--no-report', '--out', 'out']) == 0
    content = json.loads((tmp_path / 'out' / 'identified.json').read_text())
    assert content['parameters']['friction_over_start']['value'] == pytest.approx(0.6, rel=0.1)
    assert content['traces'][0]['readings']['relay_below'] == 0.1
    model = tmp_path / 'out' / 'model.toml'
    stop = abs_hil.simulate(plant=model, model=model).summary['stop_distance_m']
    assert stop == pytest.approx(abs_hil.simulate(plant=START, set=TRUTH).summary['stop_distance_m'], rel=0.15)


def test_readings_of_something_else_are_no_rig(tmp_path):
    file = figure(tmp_path, relay)
    lines = file.read_text().splitlines()
    random = np.random.default_rng(1)
    mixed = [*lines[:2], *(f'{line.split(",")[0]},{random.uniform(200, 1700):.0f},{random.uniform(0, 1):.3f}'
                           for line in lines[2:])]
    file.write_text('\n'.join(mixed) + '\n')
    found = identify_speeds([load_trace(file, READ | {'brake_duty': 0.7})], START)
    assert 'did not get there' in found.misfit
    assert all(e.low is None for e in found.parameters.values() if e.status != 'fixed')


def falling(more='', value=lambda i: 900 - i):
    return f'time_s,upper_rpm{more and ",brake_pwm"}\n' + '\n'.join(f'{i / 100},{value(i)}{more}' for i in range(60))


@pytest.mark.parametrize(('text', 'keys', 'words'), [
    ('a,b\n1,2\n', {}, 'lacks the column time_s; it has a, b'),
    ('time_s,upper_rpm\n' + '0,1\n' * 5, {'brake_duty': 0.5, 'brake_from_s': 0.0}, 'has 5 readings .* give at least 30'),
    ('time_s,slip\n' + '\n'.join(f'{i / 100},0.1' for i in range(60)), {'relay_below': 0.1}, "one wheel's speed"),
    (falling(), {}, "brake's duty is told by nothing; give one of"),
    (falling(), {'relay_below': 0.1}, 'give a column slip'),
    (falling(), {'brake_duty': 0.5}, 'give --reading brake_from_s'),
    (falling(value=lambda _: 'x'), {'brake_duty': 0.5}, 'has 0 readings'),
    (falling(',2'), {}, 'brake_pwm is 2 in row 1'),
    ('time_s,upper_rpm\n' + 'nan,1\n' * 50, {'brake_duty': 0.5}, 'time_s is nan in row 1; give seconds'),
])
def test_files_that_cannot_serve_are_refused(tmp_path, text, keys, words):
    file = tmp_path / 'trace.csv'
    file.write_text(text)
    with pytest.raises(ValueError, match=words):
        load_trace(file, keys)


@pytest.mark.parametrize(('arguments', 'words'), [
    (['--speeds', 'nosuch.csv'], 'cannot read "nosuch.csv"'),
    ([], 'give logs, or coarse traces with --speeds FILE'),
    (['log', '--speeds', 'nosuch.csv'], 'not both'),
    (['--speeds', 'nosuch.csv', '--form', 'inteco-mu'], '--form go with logs of counts'),
    (['log', '--reading', 'window_s=0.01'], '--reading goes with --speeds'),
    (['--speeds', 'nosuch.csv', '--reading', 'window=0.01'], 'no such key; give one of from_s'),
    (['--speeds', 'nosuch.csv', '--reading', 'window_s=x'], '"x" is no number'),
    (['--speeds', 'nosuch.csv', '--reading', 'window_s=3'], 'give a number from 0 to 0.2'),
])
def test_the_program_refuses_what_does_not_go_together(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    try:
        status = programs.start('identify', [*arguments, '--no-report'])
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert re.search(words, capsys.readouterr().err)
    assert not any(tmp_path.iterdir())


def test_a_key_belongs_to_the_file_before_it(monkeypatch):
    given = []
    monkeypatch.setattr(program, 'load_trace', lambda file, keys: given.append((file, dict(keys))))
    monkeypatch.setattr(program, 'identify_speeds', lambda *_, **__: pytest.fail())
    o = parsers.identify().parse_args(['--reading=window_s=0.01', '--speeds', 'a', '--reading=brake_duty=0.65', '--speeds', 'b',
                                       '--reading=brake_duty=0.7', '--reading=window_s=0.02'])
    with pytest.raises(pytest.fail.Exception):
        program._speeds(o, {}, program.Progress())
    assert given == [('a', {'window_s': 0.01, 'brake_duty': 0.65}), ('b', {'window_s': 0.02, 'brake_duty': 0.7})]
