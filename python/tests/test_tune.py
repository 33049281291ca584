"""The search for gains: what it searches, its cost, its result."""
import math
import pathlib

import numpy as np
import pytest

import abs_hil
from abs_hil import programs, tune
from abs_hil.simulation import Study
from abs_hil.tune import FAULT_COST, Judge, Training, cost_of, gains_of, search, to_toml, tunable

TUNED = pathlib.Path(__file__).parents[2] / 'config' / 'tuned'
SMALL = Training(plants=['paper-table1'], cases=1)


def test_gains_are_those_whose_rows_give_a_range():
    assert tunable() == ['adaptive', 'sliding-mode', 'sliding-mode-smooth', 'sliding-mode-actuator', 'super-twisting', 'pi',
                         'relay', 'five-phase']
    assert [gain.name.rpartition('.')[2] for gain in gains_of('adaptive')] == ['gamma', 'ks0', 'ks1', 'ka1', 'zeta0']
    gamma, *_, zeta0 = gains_of('adaptive')
    assert (gamma.least, gamma.most, gamma.logarithmic, zeta0.logarithmic) == (1.0, 1000.0, True, False)
    assert [gamma.value_at(c) for c in (0.0, 0.5, 1.0)] == [1.0, 31.6, 1000.0]
    assert [zeta0.value_at(c) for c in (0.0, 0.5, 1.0)] == [0.0, 20.0, 40.0]
    assert gains_of('locked') == []


def run(**changed):
    figures = {'stop_distance_m': 15.0, 'slip_rms': 0.01, 'slip_overshoot': 0.05, 'time_locked_s': 0.1,
               'torque_total_variation_Nm': 900.0, 'fault': '', 'error': '', **changed}
    return Study({name: np.array([value], dtype=object if isinstance(value, str) else float)
                  for name, value in figures.items()})


def cost(study, follows_slip=True, obedient_m=14.0):
    return cost_of(study, follows_slip, np.array([20.0]), np.array([obedient_m]), np.array([9.0]))[0]


def test_cost_is_the_sum_stated_in_the_docs():
    assert cost(run()) == pytest.approx(0.75 + 0.02 + 0.01 + 0.05 + 0.01)
    assert cost(run(), follows_slip=False) == pytest.approx(0.75 + 0.05 + 0.01)
    for broken in ({'fault': 'overspeed'}, {'error': 'ks0'}, {'stop_distance_m': math.nan}, {'slip_rms': math.nan}):
        assert cost(run(**broken)) == FAULT_COST


def test_stopping_shorter_than_the_wanted_slip_allows_earns_nothing():
    assert cost(run(), obedient_m=16.0) == pytest.approx(cost(run(stop_distance_m=16.0), obedient_m=16.0))
    assert cost(run(stop_distance_m=17.0), obedient_m=16.0) > cost(run(), obedient_m=16.0)


def test_search_improves_and_threads_change_nothing():
    found = search(Judge('sliding-mode', SMALL), 2, 1)
    again = search(Judge('sliding-mode', Training(['paper-table1'], 1, threads=3)), 2, 1)
    other = search(Judge('sliding-mode', SMALL), 2, 9)
    assert found == again
    assert other.values != found.values
    judge = Judge('sliding-mode', SMALL)
    assert found.cost == judge.costs([found.values])[0], 'the cost of the rounded values'
    assert found.cost < judge.costs([judge.values(np.zeros(len(judge.gains)))])[0], 'better than bad gains'
    assert found.evaluations == 3 * 24


def test_gains_that_a_controller_refuses_cost_a_fault():
    judge = Judge('adaptive', SMALL)
    values = judge.values(np.full(len(judge.gains), 0.5))
    assert judge.costs([[-1.0, *values[1:]]])[0] == FAULT_COST


def test_file_is_a_configuration(tmp_path):
    judge = Judge('pi', SMALL)
    found = search(judge, 1, 1)
    (tmp_path / 'pi.toml').write_text(to_toml(judge, found, 'a comment'))
    run = abs_hil.simulate('pi', config=tmp_path / 'pi.toml', set={'experiment.start_speed_rad_s': 60})
    assert [run.config[gain.name] for gain in judge.gains] == found.values


def test_unusable_names():
    for controller, words in (('slidng-mode', 'sliding-mode'), ('locked', 'no gains')):
        with pytest.raises(ValueError, match=words):
            Judge(controller, SMALL)
    with pytest.raises(ValueError, match='paper-tabel1'):
        Judge('pi', Training(['paper-tabel1']))


@pytest.mark.parametrize(('given', 'words'), [
    (['--controllers', ''], '--controllers, --plants: give at least one name'),
    (['--controllers', 'pi', '--plants', ','], '--controllers, --plants: give at least one name'),
    (['--controllers', 'pi', '--folder', 'a-file'], '--out "a-file" cannot be made: File exists; give a folder'),
    (['--seed', '-1'], '"-1" is no whole number from 0 to'),
])
def test_the_program_refuses_before_it_searches(given, words, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tune, 'search', lambda *_: pytest.fail('it searches'))
    (tmp_path / 'a-file').write_text('')
    assert programs.start('tune', ['--folder', 'tu', '--cases', '1', *given]) == 2
    assert words in capfd.readouterr().err
    assert not (tmp_path / 'tu').exists()


@pytest.mark.parametrize('controller', ['pi', 'relay', 'five-phase'])
def test_shipped_gains_of_the_baselines_are_the_recorded_ones(controller):
    defaults, recorded = abs_hil.keys(), abs_hil.keys(config=TUNED / f'{controller}.toml')
    assert recorded == defaults
    for gain in gains_of(controller):
        assert gain.least <= recorded[gain.name]['value'] <= gain.most


def test_the_papers_controller_ships_with_table_1():
    shipped = abs_hil.keys()
    assert [shipped[f'control.adaptive.{name}']['value'] for name in ('gamma', 'ks0', 'ks1', 'zeta0')] == [21, 19, 32, 0]
