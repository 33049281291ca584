"""simulate and simulate_many give what the program gives, bit for bit."""
import csv
import json
import math
import signal
import struct
import time

import numpy as np
import pytest
from conftest import QUICK

import abs_hil

RUNS = [{}, {'controller': 'pi', 'plant': 'paper-timing', 'seed': 7},
        {'controller': 'sliding-mode', 'experiment': 'friction-jump', 'set': {'plant.theta_N': 30.5}},
        {'experiment': 'brake-step', 'set': {'plant.ideal_sensors': True}}]


def arguments_of(run):
    words = []
    for name, value in run.items():
        if name == 'set':
            words += [word for key, v in value.items() for word in ('--set', f'{key}={str(v).lower()}')]
        else:
            words += [f'--{name}', value]
    return words


def bits(value):
    return 'NaN' if math.isnan(value) else struct.pack('>d', value)


@pytest.mark.parametrize('run', RUNS)
def test_rows_and_summary_are_the_programs(run, tmp_path, abs_hil_program):
    abs_hil_program('--fast', '--no-lcm', '--csv', tmp_path / 'a.csv', '--summary', tmp_path / 's.json',
                    *arguments_of(run))
    ours = abs_hil.simulate(**run)
    with open(tmp_path / 'a.csv', newline='') as file:
        rows = list(csv.DictReader(file))
    assert list(ours.columns) == list(rows[0])
    assert len(ours) == len(rows)
    for name, values in ours.columns.items():
        if name in ('phase', 'phase_name'):
            assert values.tolist() == [row[name] for row in rows]
        else:
            assert [bits(value) for value in values.tolist()] == [bits(float(row[name])) for row in rows], name
    assert ours.summary == json.loads((tmp_path / 's.json').read_text())
    ours.to_csv(tmp_path / 'b.csv')
    assert (tmp_path / 'b.csv').read_bytes() == (tmp_path / 'a.csv').read_bytes()


def test_data_frame_has_the_columns():
    run = abs_hil.simulate(set=QUICK)
    assert list(run.data.columns) == list(run.columns)
    assert run.signals == ('I_m', 'omega1_hat_rad_s', 'zeta_N', 'V', 'V_dot')
    assert (run.during('brake')['phase'] == 'brake').all()
    assert run.config['control.controller'] == 'adaptive'


@pytest.mark.parametrize('options, words', [
    ({'plant': 'paper-tabel1'}, 'the nearest is paper-table1'), ({'controller': 'slidng-mode'}, 'sliding-mode'),
    ({'experiment': 'papr'}, 'the nearest is paper'), ({'set': {'control.slip_ref': 2}}, 'control.slip_ref = 2'),
    ({'set': {'control.slipref': 0.1}}, 'control.slip_ref'), ({'seed': -1}, 'run.seed'),
    ({'inject': ['nonsense']}, 'nonsense'), ({'controller': 'python'}, 'reset and step'),
    ({'controller': object()}, 'reset and step'), ({'experiment': 'series-of-ten'}, 'a series of runs')])
def test_bad_options_are_value_errors_with_the_programs_text(options, words):
    with pytest.raises(ValueError, match=words):
        abs_hil.simulate(**options)


def test_a_fault_is_a_result():
    run = abs_hil.simulate(set=QUICK, inject=['brake@encoder_lower:stuck+0.2s'])
    assert run.summary['result'] == 'fault'
    assert run['phase'][-1] == 'fault'


def test_many_runs_are_those_of_compare(tmp_path, abs_hil_program):
    abs_hil_program('compare', '--controllers', 'adaptive,pi', '--repeat', 4, '--seed', 3, '--runs', tmp_path / 'r.csv')
    study = abs_hil.simulate_many({'controller': ['adaptive', 'pi'], 'experiment.start_speed_rad_s': [170.0]},
                                  vary='parameters=0.1,theta=0.1,phase', repeat=4, vary_seed=3)
    with open(tmp_path / 'r.csv', newline='') as file:
        rows = sorted(csv.DictReader(file), key=lambda row: (row['controller'], int(row['run'])))
    assert study['controller'].tolist() == [row['controller'] for row in rows]
    compared = [name for name in rows[0] if name in study.columns and name not in ('controller', 'fault')]
    assert len(compared) >= 9
    for name in compared:
        assert [bits(v) for v in study[name].tolist()] == [bits(float(row[name] or 'nan')) for row in rows], name


def test_a_run_of_compare_again(tmp_path, abs_hil_program):
    """One varied plant: the rows that `compare --run` records, and the figures that simulate_many has for it."""
    abs_hil_program('compare', '--plant', 'paper-timing', '--controllers', 'adaptive', '--run', 22, '--out', tmp_path / 'r')
    start = {'experiment.start_speed_rad_s': 170.0}
    ours = abs_hil.simulate(plant='paper-timing', set=start, repetition=22)
    ours.to_csv(tmp_path / 'ours.csv')
    assert (tmp_path / 'ours.csv').read_bytes() == (tmp_path / 'r' / 'run.csv').read_bytes()
    study = abs_hil.simulate_many([{'plant': 'paper-timing', 'set': start}], repeat=23)
    assert study['stop_distance_m'][22] == ours.summary['stop_distance_m']
    other = abs_hil.simulate(plant='paper-timing', set=start, repetition=21)
    assert other.summary['stop_distance_m'] != ours.summary['stop_distance_m']
    with pytest.raises(ValueError, match='repetition -1: give'):
        abs_hil.simulate(repetition=-1)
    with pytest.raises(ValueError, match='nothing'):
        abs_hil.simulate(repetition=1, vary='nothing')


def test_threads_change_nothing_and_progress_ends_with_all():
    grid = {'control.slip_ref': [0.1, 0.15, 0.2], 'experiment.start_speed_rad_s': [100.0]}
    told = []
    one = abs_hil.simulate_many(grid, threads=1)
    many = abs_hil.simulate_many(grid, threads=3, progress=lambda done, total: told.append((done, total)))
    assert sorted(told)[-1] == (3, 3)
    assert one['control.slip_ref'].tolist() == [0.1, 0.15, 0.2]
    for name, values in one.columns.items():
        np.testing.assert_array_equal(values, many[name])
    single = abs_hil.simulate(set={'control.slip_ref': 0.2, 'experiment.start_speed_rad_s': 100.0})
    assert one['stop_time_s'][2] == single.summary['stop_time_s']
    assert len(one.data) == len(one) == 3


def test_bad_runs_of_a_study():
    runs = [{'set': {**QUICK, 'control.adaptive.gamma': gamma}} for gamma in (21.0, -1.0)]
    with pytest.raises(ValueError, match='run 1: .*control.adaptive.gamma'):
        abs_hil.simulate_many(runs)
    study = abs_hil.simulate_many(runs, keep_going=True)
    assert study['error'][0] == '' and 'control.adaptive.gamma' in study['error'][1]
    assert np.isnan(study['stop_time_s'][1]) and study['stop_time_s'][0] > 0
    with pytest.raises(ValueError, match='object has no methods reset and step'):
        abs_hil.simulate_many([{'controller': object()}])
    with pytest.raises(ValueError, match=r'controller: Constant is a class; give an object of it, Constant\(\)'):
        abs_hil.simulate(Constant)
    with pytest.raises(ValueError, match='without faults'):
        abs_hil.simulate_many([{'inject': ['brake@encoder_upper:stuck']}])
    with pytest.raises(ValueError, match='list of values'):
        abs_hil.simulate_many({'controller': 'pi'})


class Constant:
    """A controller in Python."""

    def __init__(self, torque_Nm=4.0, fails=False):
        self.torque_Nm, self.fails = torque_Nm, fails

    def reset(self, input):
        pass

    def step(self, input):
        if self.fails:
            raise KeyError('my law')
        return self.torque_Nm


@pytest.mark.parametrize('repeat', [1, 3])
def test_controllers_in_python_beside_those_of_the_program(repeat):
    told = []
    runs = [{'controller': law, 'set': QUICK} for law in (Constant(), 'pi', Constant(5.0))]
    many = abs_hil.simulate_many(runs, repeat=repeat, threads=2, progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (3 * repeat, 3 * repeat)
    assert many['controller'].tolist() == [name for name in ('Constant', 'pi', 'Constant') for _ in range(repeat)]
    for n, run in enumerate(runs):
        for k in range(repeat):
            one = abs_hil.simulate(**run, repetition=k if repeat > 1 else None).summary
            assert many['stop_distance_m'][n * repeat + k] == one['stop_distance_m']
    with pytest.raises(KeyError, match='my law'):
        abs_hil.simulate_many([{'controller': 'pi', 'set': QUICK}, {'controller': Constant(fails=True), 'set': QUICK}])
    assert len(abs_hil.simulate_many(runs)) == 3, 'nothing of it is left'


def test_values_of_numpy_and_values_that_are_none():
    run = abs_hil.simulate(set={**QUICK, 'plant.ideal_sensors': np.bool_(True), 'plant.theta_N': np.float32(20)},
                           seed=np.int64(3))
    assert run.config['plant.ideal_sensors'] is True and run.config['plant.theta_N'] == 20.0
    bad = [({'seed': 1.5}, 'seed 1.5: give an integer'), ({'seed': 'x'}, "seed 'x'"), ({'set': 5}, 'set 5: give'),
           ({'set': {'plant.theta_N': None}}, 'set: plant.theta_N: None is no')]
    for arguments, words in bad:
        with pytest.raises(ValueError, match=words):
            abs_hil.simulate(**arguments)


def test_a_phase_that_is_none_and_units():
    run = abs_hil.simulate(set=QUICK)
    assert len(run.during('accelerate')['time_s']) == 0  # it began at speed
    with pytest.raises(ValueError, match='"typo" is no phase; give one of idle, '):
        run.during('typo')
    assert run.data.attrs['units']['omega1_rad_s'] == 'rad/s' and 'slip' not in run.data.attrs['units']


def test_an_exception_in_the_progress_ends_the_study():
    def progress(done, total):
        raise KeyError('stop')
    with pytest.raises(KeyError):
        abs_hil.simulate_many({'seed': [1, 2, 3], 'experiment.start_speed_rad_s': [50.0]}, progress=progress)


OWN_PHASE = '[[phase]]\nname = "stop"\nbrake = "controller"\nuntil = { standstill = true }\nat_most_s = 60\n'


@pytest.mark.parametrize('head, phases', [('experiments = ["paper", "brake-step"]\n', ''), ('', OWN_PHASE)],
                         ids=['of others', 'of itself'])
def test_a_series_is_that_of_the_program(tmp_path, abs_hil_program, head, phases):
    file = tmp_path / 'two.toml'
    file.write_text(f'description = "two slips, two seeds"\n[series]\n{head}repeat = 2\n'
                    f'[factors]\n"control.slip_ref" = [0.1, 0.2]\n{phases}')
    series = abs_hil.simulate_series(file, set=QUICK)
    abs_hil_program('--fast', '--no-lcm', '--experiment', file, '--set', 'experiment.start_speed_rad_s=170', '--out',
                    tmp_path / 'out')
    of_program = abs_hil.load_series(tmp_path / 'out')
    assert len(series) == len(of_program) == (4 if phases else 8)
    assert series.index['runs'] == of_program.index['runs']
    for ours, theirs in zip(series, of_program):
        for name, values in theirs.columns.items():
            np.testing.assert_array_equal(ours[name], values)
    with pytest.raises(ValueError, match='no-such'):
        abs_hil.simulate_series('no-such')


def test_numbers_out_of_range_are_refused():
    for name, number, most in (('repeat', 10**12, 10**6), ('vary_seed', 10**30, 2**64 - 1), ('threads', 1025, 1024)):
        with pytest.raises(ValueError, match=rf'{name} {number}: give a whole number in \[[01], {most}\]'):
            abs_hil.simulate_many([{}], **{name: number})
    for name, number in (('repetition', 10**30), ('repetition', -1), ('vary_seed', 10**30)):
        with pytest.raises(ValueError, match=f'{name} {number}: give a whole number'):
            abs_hil.simulate(**{'repetition': 0, name: number})


def test_an_argument_that_no_run_has_is_refused_by_name():
    for runs in ([{'thresold': 1}], {'thresold': [1, 2]}):
        with pytest.raises(ValueError, match="'thresold' is no argument of a run; give some of config, controller, .*"):
            abs_hil.simulate_many(runs)


@pytest.mark.skipif(not hasattr(signal, 'SIGALRM'), reason='Windows has no alarm')
@pytest.mark.parametrize('threads', [1, 2])
def test_a_signal_ends_many_slow_runs_at_once(threads):
    """Minutes of work; parts of the batch have hundreds of runs each, and none of them is finished first."""
    def interrupt(*_):
        raise KeyboardInterrupt
    seen = []
    before = signal.signal(signal.SIGALRM, interrupt)
    due_s = time.monotonic() + 0.3
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            abs_hil.simulate_many([{'controller': 'adaptive-optimal'}], repeat=20000, threads=threads,
                                  progress=lambda done, total: seen.append(done))
        late_s = time.monotonic() - due_s
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert all(done < 20000 for done in seen)
    assert late_s < 2.0  # 0.06 s on an idle computer; a part of the batch takes ten


@pytest.mark.skipif(not hasattr(signal, 'SIGALRM'), reason='Windows has no alarm')
def test_a_signal_ends_the_reading_of_many_options_at_once(monkeypatch):
    """Before the first run each of them is checked, which takes seconds."""
    due_s = 0.0

    def armed(*arguments):
        nonlocal due_s
        due_s = time.monotonic() + 0.2
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        return simulate_many(*arguments)

    def interrupt(*_):
        raise KeyboardInterrupt
    simulate_many = abs_hil.core._core.simulate_many
    monkeypatch.setattr(abs_hil.core._core, 'simulate_many', armed)
    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        with pytest.raises(KeyboardInterrupt):
            abs_hil.simulate_many({'plant.theta_N': np.linspace(15.0, 30.0, 30000)}, threads=1)
        late_s = time.monotonic() - due_s
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert late_s < 2.0  # as above; all of them take ten


def test_lists():
    assert 'adaptive' in abs_hil.controllers() and 'python' not in abs_hil.controllers()
    assert set(abs_hil.plants()) >= {'paper-table1', 'paper-timing', 'inteco-manual'}
    assert set(abs_hil.experiments()) >= {'paper', 'coast-down', 'brake-step', 'friction-jump'}
    key = abs_hil.keys(set={'plant.theta_N': 31})['plant.theta_N']
    assert key['value'] == 31 and key['unit'] == 'N'


def test_a_drawn_rig_is_the_same_for_a_seed_and_the_program_runs_on_it(tmp_path, abs_hil_program):
    files = {kind: tmp_path / f'{kind}.toml' for kind in ('steady', 'wandering')}
    for kind, file in files.items():
        assert f'--plant {file}' in abs_hil_program('rig', kind, '7', '--out', file).stdout
    from abs_hil.rig import unknown_rig
    assert [file.read_text() for file in files.values()] == [unknown_rig(7, False), unknown_rig(7, True)]
    assert unknown_rig(8, False) != unknown_rig(7, False)
    known = abs_hil.keys()
    for kind, file in files.items():
        drawn = abs_hil.keys(plant=file)
        assert all(drawn[f'plant.{key}']['value'] == known[f'plant.{key}']['value'] for key in ('J2_kg_m2', 'r2_m'))
        assert 0.6 * 23.0 <= drawn['plant.theta_N']['value'] <= 1.4 * 23.0
        assert ('from' in drawn['plant.friction_profile']['value']) == (kind == 'wandering')
        assert (drawn['plant.upper_encoder_eccentricity_rad']['value'] > 0.0) == (kind == 'wandering')
        assert abs_hil.simulate(plant=file, model='paper-table1').summary['stop_distance_m'] > 1.0
    assert 'no whole number from 0' in abs_hil_program('rig', 'steady', '-1', '--out', tmp_path / 'n.toml', status=2).stderr
    refused = abs_hil_program('rig', 'steady', '7', '--out', files['steady'], status=2).stderr
    assert 'exists; give another --out, or --force' in refused
