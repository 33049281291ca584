"""load reads what the program writes, whole, cut off or broken."""
import json
import os
import pathlib

import numpy as np
import pytest

import abs_hil


@pytest.fixture
def folder(tmp_path, abs_hil_program):
    abs_hil_program('--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=120', '--out', tmp_path / 'run')
    return tmp_path / 'run'


def same(a, b):
    assert a.columns.keys() == b.columns.keys()
    for name, values in a.columns.items():
        if name in ('phase', 'phase_name'):
            assert values.tolist() == b[name].tolist()
        else:
            np.testing.assert_array_equal(values, b[name], err_msg=name)


def test_folder_csv_and_log_are_the_simulated_run(folder):
    simulated = abs_hil.simulate(set={'experiment.start_speed_rad_s': 120})
    for path in (folder, folder / 'run.csv', folder / 'run.lcmlog', str(folder)):
        same(abs_hil.load(path), simulated)
    run = abs_hil.load(folder)
    assert run.summary == simulated.summary and run.signals == simulated.signals and not run.notes
    assert abs_hil.load(folder / 'run.lcmlog').config == simulated.config


@pytest.mark.parametrize('arguments', [(), ('--controller', 'locked'), ('--set', 'telemetry.decimation=5')])
def test_a_log_alone_gives_the_summary(tmp_path, abs_hil_program, arguments):
    abs_hil_program('--fast', '--no-lcm', '--log', tmp_path / 'run.lcmlog', '--summary', tmp_path / 'summary.json', *arguments)
    told, found = json.loads((tmp_path / 'summary.json').read_text()), abs_hil.load(tmp_path / 'run.lcmlog').summary
    assert found['config'] == told['config']
    assert {*found} - {*told} == {'version'}
    figures = [name for name, figure in abs_hil.figures().items() if figure.in_summary]
    assert len(figures) > 8
    for name in figures if 'telemetry.decimation=5' not in arguments else ():  # that log has a fifth of the rows
        assert found[name] == told[name], name
    for name in ('result', 'reason', 'experiment', 'controller', 'plant', 'backend', 'cycles', 'overruns', 'telemetry_drops'):
        assert found[name] == told[name], name


@pytest.mark.parametrize('fault', ['accelerate@motor_pwm:off+0.5s', 'brake@encoder_upper:stuck+0.2s'])
def test_a_log_says_how_its_run_ended_early(tmp_path, abs_hil_program, fault):
    abs_hil_program('--fast', '--no-lcm', '--log', tmp_path / 'run.lcmlog', '--summary', tmp_path / 'summary.json',
                    '--inject', fault, '--recorder', tmp_path, status=1)
    told, run = json.loads((tmp_path / 'summary.json').read_text()), abs_hil.load(tmp_path / 'run.lcmlog')
    assert (run.summary['result'], run.summary['reason']) == ('fault', told['reason']) and told['result'] == 'fault'
    assert run.events[-1].event == 'fault' and told['reason'].startswith(run.events[-1].reason)


def test_cut_off_files_say_so(folder):
    whole = abs_hil.load(folder)
    for name, words in (('run.csv', 'incomplete'), ('run.lcmlog', 'not used')):
        data = (folder / name).read_bytes()
        (folder / name).write_bytes(data[:len(data) * 2 // 3])
        run = abs_hil.load(folder / name)
        assert any(words in note for note in run.notes), run.notes
        assert 100 < len(run) < len(whole)
        np.testing.assert_array_equal(run['slip'], whole['slip'][:len(run)])


def test_side_files_may_be_missing_or_broken(folder):
    os.remove(folder / 'SHA256SUMS')  # otherwise they are refused
    (folder / 'summary.json').write_text('{"result": ')
    assert any('summary.json is not used' in note for note in abs_hil.load(folder).notes)
    os.remove(folder / 'summary.json')
    assert any('no summary.json' in note for note in abs_hil.load(folder).notes)
    os.remove(folder / 'run.csv')
    assert any('no run.csv' in note for note in abs_hil.load(folder).notes)


@pytest.mark.parametrize('content, words', [
    (b'', 'the file is empty'), (b'time_s,phase\n0,idle\n', 'the header lacks omega1_rad_s'),
    (b'\x7fELF\x01\xff' * 30_000, ':1: ')])
def test_other_files_are_refused_with_their_place(tmp_path, content, words):
    (tmp_path / 'x.csv').write_bytes(content)
    with pytest.raises(ValueError, match='x.csv.*' + words):
        abs_hil.load(tmp_path / 'x.csv')
    (tmp_path / 'x.lcmlog').write_bytes(content)
    with pytest.raises(ValueError, match='x.lcmlog'):
        abs_hil.load(tmp_path / 'x.lcmlog')


def test_mutated_files_give_a_run_or_a_value_error(folder, tmp_path):
    """Any byte may be wrong: the result is a run or a ValueError."""
    generator = np.random.default_rng(1)
    for name in ('run.csv', 'run.lcmlog'):
        data = bytearray((folder / name).read_bytes()[:60_000])
        for trial in range(150):
            copy = bytearray(data)
            for place in generator.integers(0, len(copy), 3):
                copy[place] = generator.integers(0, 256)
            path = tmp_path / f'{trial}{pathlib.Path(name).suffix}'
            path.write_bytes(copy)
            try:
                assert len(abs_hil.load(path)) > 0
            except ValueError as error:
                assert str(path) in str(error)


def test_nowhere():
    with pytest.raises(ValueError, match='nowhere'):
        abs_hil.load('nowhere.csv')
    with pytest.raises(ValueError, match='no run folder'):
        abs_hil.load(pathlib.Path(__file__).parent)
    with pytest.raises(ValueError, match='no series folder'):
        abs_hil.load_series('nowhere')


def test_series(tmp_path, abs_hil_program):
    for number, theta in enumerate((20, 26), 1):
        abs_hil_program('--fast', '--no-lcm', '--set', 'experiment.start_speed_rad_s=100', '--set',
                        f'plant.theta_N={theta}', '--out', tmp_path / f'run-{number:04}')
    (tmp_path / 'series.json').write_text('{"runs": 2}')
    (tmp_path / 'run-0003').mkdir()
    series = abs_hil.load_series(tmp_path)
    assert len(series) == 2 and 'run-0003' in series.notes[0] and series.index == {'runs': 2}
    assert series.data['plant.theta_N'].tolist() == [20, 26]
    assert series.data['stop_time_s'].tolist() == [run.summary['stop_time_s'] for run in series]
    with pytest.raises(ValueError, match='load_series'):
        abs_hil.load(tmp_path)
    assert json.dumps(series[0].config)
