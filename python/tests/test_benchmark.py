"""The benchmark: its set never changes within a version, and every kind of controller enters the same way."""
from __future__ import annotations

import base64
import dataclasses
import gzip
import importlib.util
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys

import pytest

import abs_hil
from abs_hil import programs
from abs_hil.benchmark import Entry, bounds, cases, run
from abs_hil.benchmark.program import main
from abs_hil.interchange.host import made
from abs_hil.places import Unavailable
from abs_hil.report.page import plotly_js

#: of everything that version 2 consists of
SET_2 = '0a2c950cf849513e355fa199a7f981751edded326ce8d729ad3ec9eca15153ae'
BOUNDS_2 = '633a4551e0daf6ee008d47b7114f937698507912383c6e11fb2052c9f4538bf4'


LAWS = """
import math
import os
import abs_hil

class WrappedPi:
    def __init__(self):
        self.law = abs_hil.Controller('pi')

    def reset(self, given):
        self.law.reset(given)

    def step(self, given):
        return self.law.step(given)

class Broken(WrappedPi):
    def step(self, given):
        return math.nan

class Raising(WrappedPi):
    def step(self, given):
        raise ValueError("no bad input, but the law's own")

class Ending(WrappedPi):
    def step(self, given):
        os._exit(0)
"""


@pytest.fixture
def own_laws(tmp_path, monkeypatch):
    """Controllers in Python, in the present folder."""
    (tmp_path / 'own_laws.py').write_text(LAWS)
    monkeypatch.chdir(tmp_path)


def few():
    """Two cases whose model is paper-table1's."""
    return [case for case in cases.whole_set() if case.plant == 'paper-table1' and case.road == 'even'
            and (case.group, case.name) in (('nominal', 'as it is'), ('mismatch', 'lag 70 ms'))]


def test_the_set_of_a_version_never_changes():
    every = cases.whole_set()
    assert len(every) == len({case.key for case in every}) == 162
    assert cases.checksum() == SET_2, 'a change of the set is a new version'
    assert bounds.checksum(bounds.stored()) == BOUNDS_2, 'a change of a bound is a new version'


def test_every_case_has_a_bound_that_the_plant_confirms():
    known = bounds.stored()
    for case in cases.whole_set():
        bound = known[bounds.identity(case)]
        assert bound['distance_on_plant_m'] == pytest.approx(bound['distance_m'], rel=2e-3), case.key
        assert bound['least_distance_m'] <= bound['distance_m'], case.key
    assert known[bounds.identity(few()[0])]['distance_m'] == pytest.approx(15.589, rel=1e-3)


def test_bounds_that_somebody_changed_are_refused(tmp_path, monkeypatch):
    text = bounds.STORED.read_text(encoding='utf-8')
    changed = tmp_path / 'bounds.json'
    changed.write_text(text.replace('"distance_m": 15.', '"distance_m": 16.', 1), encoding='utf-8')
    monkeypatch.setattr(bounds, 'STORED', changed)
    with pytest.raises(ValueError, match='checksum'):
        bounds.stored()


#: what a distance may be below its bound: the solver's mesh, and a stop that is told by the tick
TOLERANCE = 5e-4


def beaten(law, chosen):
    """The cases in which a law stops shorter than one who knows tyre and road."""
    known = bounds.stored()
    least_m = {case.key: known[bounds.identity(case)]['least_distance_m'] for case in chosen}
    return [(law, row['case'], row['seed'], row['stop_distance_m'] / least_m[row['case']] - 1.0)
            for row in run(Entry(law, {}), chosen, known).rows
            if not row['fault'] and row['stop_distance_m'] < (1.0 - TOLERANCE) * least_m[row['case']]]


def test_nothing_beats_a_bound(monkeypatch):
    every = bool(os.environ.get('ABS_HIL_ALL_CASES'))
    laws = abs_hil.controllers() if every else ('locked', 'adaptive-optimal', 'adaptive-peak')
    chosen = [case for case in cases.whole_set() if every or case.group in ('nominal', 'capped')]
    assert [one for law in laws for one in beaten(law, chosen)] == []
    # With the bound of version 1, which was a local optimum, `locked` is seen.
    real = bounds.stored()
    even = [case for case in chosen if (case.plant, case.road, case.group) == ('inteco-manual', 'even', 'nominal')]
    monkeypatch.setattr(bounds, 'stored', lambda: {**real, bounds.identity(even[0]): {
        **real[bounds.identity(even[0])], 'least_distance_m': 10.829}})
    assert beaten('locked', even)


def test_several_things_wrong_at_once():
    """Coarse encoders, a brake unlike the model's, ice: once the loop dared full torque in single cycles there, 2,800 N m."""
    combined = [case for case in cases.whole_set() if case.group == 'combined']
    score = run(Entry('adaptive-optimal', {}), combined, bounds.stored(), (1, 2, 3)).total
    assert score.failed == score.locked == 0
    assert score.variation_worst_Nm <= 400.0
    assert score.excess_worst <= 0.15 and score.excess_mean <= 0.03


def test_a_law_that_keeps_what_it_learnt_stops_shorter_the_next_time(tmp_path, capsys, monkeypatch):
    known = bounds.stored()
    chosen = [case for case in cases.whole_set() if case.group == 'combined'][:6]
    cold, warm = (run(Entry('adaptive-optimal', {}, first), chosen, known).total for first in (False, True))
    assert warm.failed == 0 and warm.excess_mean < 0.95 * cold.excess_mean
    target = tmp_path / 'score.json'
    monkeypatch.setattr(cases, 'quick_cases', lambda: chosen[:2])
    assert main(['--quick', '--warm', '--controller', 'adaptive-optimal,pi', '--json', str(target)]) == 0
    assert '`adaptive-optimal, warm`' in capsys.readouterr().out
    found = json.loads(target.read_text(encoding='utf-8'))['controllers']
    assert [(one['name'], one['warm']) for one in found] == [('adaptive-optimal', False), ('adaptive-optimal', True),
                                                             ('pi', False)]
    assert found[0]['scores'] != found[1]['scores']
    assert main(['--verify', str(target)]) == 0
    assert main(['--quick', '--warm', '--controller', 'pi']) == 2
    assert 'keeps anything of the last braking' in capsys.readouterr().err


def test_the_shipped_gains_are_those_of_the_search():
    """research/search_braking_gains.py --check also computes their scores again."""
    stored = json.loads((pathlib.Path(__file__).parents[2] / 'config/training/gains.json').read_text(encoding='utf-8'))
    defaults = abs_hil.keys()
    for law, found in stored.items():
        prefix = f'control.{law.replace("-", "_")}.'
        assert found['gains'] == {key: defaults[prefix + key]['value'] for key in found['gains']}, law


def test_a_first_misreading_of_the_slip_does_not_fix_a_wrong_peak():
    """Few counts and a brake faster than the model's: while the torque rises the slip reads wrong. From that the law once took a
    flat tyre for a steep one and braked twice as long, in one position of the wheels of six."""
    case = cases.combined(777001, 53)[52]
    known = bounds.found([case], pathlib.Path(__file__).parents[2] / 'config/training/combined-bounds.json')
    found = run(Entry('adaptive-optimal', {}), [case], known, seeds=tuple(range(1, 13)))
    assert found.total.failed == 0
    assert found.total.excess_worst < 0.25
    # Once this peak was taken for one at half its slip: the reference rested there, and the braking got 19 % longer.
    coarse = cases.combined(20261129, 26)[25]
    fine = dataclasses.replace(coarse, changes={**coarse.changes, 'encoder_counts_per_rev': 4096})
    distances = [[row['stop_distance_m'] for row in run(Entry('adaptive-optimal', {}), [case], {bounds.identity(case): {
        'distance_m': 1.0}}, seeds=tuple(range(1, 7))).rows] for case in (coarse, fine)]
    assert max(distances[0]) < 1.12 * min(distances[1])


def test_a_longer_draw_begins_with_the_same_cases():
    assert cases.drawn(7, 5) == cases.drawn(7, 20)[:5]
    assert cases.drawn(7, 5) != cases.drawn(8, 5)
    for case in cases.drawn(7, 200):
        assert 10.0 <= case.changes['theta_N'] <= 60.0 and 60.0 <= case.start_speed_rad_s <= 180.0
        assert 0.9 <= case.changes['J1_kg_m2'] / 7.54e-3 <= 1.1


def test_braking_begins_at_the_speed_of_the_case():
    case = few()[0]
    values = {'experiment.start_speed_rad_s': bounds.coasted(case)[0], 'experiment.coast_s': cases.COAST_S}
    found = abs_hil.simulate('pi', case.plant, 'coast-and-brake', set=values)
    first = found.columns['phase'].tolist().index('brake')
    assert found.columns['omega2_rad_s'][first] == pytest.approx(170.0, abs=1e-3)


def test_a_controller_in_python_scores_as_the_same_law_in_the_program(own_laws):
    known, chosen = bounds.stored(), few()
    law, wrapped = (run(Entry(name, {}), chosen, known, seeds=(1,)) for name in ('pi', 'own_laws:WrappedPi'))
    for of_law, of_wrapped in zip(law.rows, wrapped.rows):
        assert of_wrapped['stop_distance_m'] == of_law['stop_distance_m']
        assert of_wrapped['torque_total_variation_Nm'] == of_law['torque_total_variation_Nm']
    assert law.total.failed == 0 and law.total.runs == 2
    # By hand: the distance of the run over the bound.
    row = law.rows[0]
    assert row['excess'] == pytest.approx(row['stop_distance_m'] / 15.589 - 1.0, abs=1e-4)
    assert law.total.excess_worst == max(row['excess'] for row in law.rows)


def test_a_run_that_fails_has_no_distance(own_laws):
    broken = run(Entry('own_laws:Broken', {}), few(), bounds.stored(), seeds=(1,))
    assert broken.total.failed == 2
    assert math.isnan(broken.total.excess_mean)


#: what Raising raises
WORDS = "ValueError: no bad input, but the law's own\n"


@pytest.mark.parametrize(('law', 'words', 'wheel'), [('Raising', WORDS, False), ('Raising', WORDS, True), ('Ending', '', False)])
def test_a_law_that_ends_fails_and_the_others_have_their_scores(law, words, wheel, own_laws, tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(cases, 'quick_cases', few)
    if wheel:
        monkeypatch.setattr(importlib.util, 'find_spec', lambda name: None)
    target = tmp_path / 'score.json'
    names = ['--controller', f'pi,own_laws:{law}']
    assert main(['--quick', *names, '--json', str(target)]) == 0
    said = capfd.readouterr()
    assert words in said.err and f'own_laws:{law}: 2 of 2 runs failed: controller_not_finite' in said.err
    assert f'`own_laws:{law}`' in said.out
    found = json.loads(target.read_text(encoding='utf-8'))['controllers']
    assert [one['scores'][-1]['failed'] for one in found] == [0, 2]
    assert found[1]['runs'][0]['fault'] == 'controller_not_finite'
    assert main(['--verify', str(target)]) == 0
    assert main(['--quick', *names, '--set', 'control.no_such_key=1']) == 2


def test_utilisation_of_adhesion_nears_one_without_a_lag():
    # adaptive-peak from 170 rad/s: its distance is about 1 % above the causal optimum, which needs 1.809 s against 1.76 s
    # of a tyre at its peak throughout.
    score = run(Entry('adaptive-peak', {}), few()[:1], bounds.stored(), seeds=(1,)).total
    assert 0.93 < score.adhesion < 1.0


def test_drawn_cases_keep_their_bounds(tmp_path, capsys, monkeypatch):
    computed = []

    def compute(case):
        computed.append(case.key)
        return {'distance_m': 10.0, 'time_s': 1.0, 'torque_variation_Nm': 20.0, 'distance_on_plant_m': 10.0,
                'least_distance_m': 10.0}
    pytest.importorskip('casadi')
    monkeypatch.setattr(bounds, 'compute', compute)
    kept = tmp_path / 'bounds.json'
    words = ['--draw', '7', '--controller', 'pi', '--bounds', str(kept)]
    assert main([*words, '--count', '2']) == 0 and len(computed) == 2
    assert main([*words, '--count', '3']) == 0 and len(computed) == 3
    first = bounds.identity(cases.drawn(7, 1)[0])
    assert json.loads(kept.read_text(encoding='utf-8'))['bounds'][first]['distance_m'] == 10.0
    kept.write_text('[]', encoding='utf-8')
    capsys.readouterr()
    assert main([*words, '--count', '1']) == 2
    assert 'no file of bounds' in capsys.readouterr().err


def test_the_page_as_html(tmp_path):
    pytest.importorskip('jinja2')
    try:
        plotly_js()
    except Unavailable as error:
        pytest.skip(str(error))
    target = tmp_path / 'page.html'
    assert main(['--quick', '--set', 'control.pi.kp_per_s=30', '--page', str(target)]) == 0
    page = target.read_text(encoding='utf-8')
    assert page.startswith('<!DOCTYPE html>') and 'id="group-mismatch"' in page and 'control.pi.kp_per_s = 30' in page
    packed = gzip.decompress(base64.b64decode(page.partition('id="plots">')[2].partition('</script>')[0]))
    plots = json.loads(packed[4:4 + int.from_bytes(packed[:4], 'little')])['plots']
    assert [plot['id'] for plot in plots] == ['standing', 'shares']
    for plot in plots:
        assert {trace.get('name') for trace in plot['data']} == set(abs_hil.controllers())


def test_program(tmp_path, capsys):
    target = tmp_path / 'score.json'
    assert main(['--quick', '--controller', 'adaptive-peak', '--json', str(target), '--page', str(tmp_path / 'page.md')]) == 0
    shown = capsys.readouterr().out
    assert '`adaptive-peak`' in shown
    found = json.loads(target.read_text(encoding='utf-8'))
    assert found['version'] == cases.VERSION and not found['whole']
    assert len(found['controllers'][0]['runs']) == len(cases.quick_cases()) == 12
    assert 'no score' in (tmp_path / 'page.md').read_text(encoding='utf-8')
    for wrong in (['--controller', 'no-such-law'], ['--controller', 'no_module:Law'], ['--set', 'plant.theta_N=3'],
                  ['--json', str(tmp_path / 'none' / 'x.json')]):
        assert main(['--quick', *wrong]) == 2
        assert capsys.readouterr().err.startswith('abs_hil benchmark: ')


@pytest.mark.parametrize(('given', 'words'), [
    (['--count', '5', '--quick'], '--count has no effect without --draw; leave it out'),
    (['--bounds', 'nosuch'], '--bounds has no effect without --draw; leave it out'),
    (['--verify', 'nosuch', '--json', 'new.json'], '--json has no effect with --verify; leave it out'),
    (['--verify', 'nosuch'], '--verify "nosuch": no result of the benchmark; give a file'),
    (['--verify', '.'], '--verify ".": no result of the benchmark; give a file'),
    (['--draw', '-1'], '"-1" is no whole number from 0 to'),
    (['--draw', '1', '--count', '0'], '"0" is no whole number from 1 to 10000'),
    (['--quick', '--threads', '-1'], '"-1" is no whole number from 0 to 1024'),
])
def test_options_without_effect_are_refused(given, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr('abs_hil.benchmark.program.run', lambda *_: pytest.fail('it runs'))
    assert programs.start('benchmark', given) == 2
    assert words in capsys.readouterr().err


def test_anybody_can_check_a_result(tmp_path, capsys):
    target = tmp_path / 'score.json'
    assert main(['--quick', '--controller', 'pi', '--set', 'control.pi.kp_per_s=30', '--json', str(target)]) == 0
    assert main(['--verify', str(target)]) == 0
    assert 'fresh runs give the same' in capsys.readouterr().out
    honest = json.loads(target.read_text(encoding='utf-8'))
    assert honest['set'] == cases.checksum()

    def verdict(change):
        document = json.loads(json.dumps(honest))
        change(document)
        target.write_text(json.dumps(document), encoding='utf-8')
        status = main(['--verify', str(target)])
        return status, ''.join(capsys.readouterr())
    for change, words in ((lambda d: d['controllers'][0]['runs'][3].update(stop_distance_m=9.0), 'stop_distance_m is 9.0'),
                          (lambda d: d['controllers'][0]['scores'][-1].update(excess_mean=0.001), 'all: excess_mean is 0.001'),
                          (lambda d: d['controllers'][0]['scores'].append(d['controllers'][0]['scores'][-1]), 'one score each'),
                          (lambda d: d['controllers'][0]['settings'].clear(), 'differences from fresh runs'),
                          (lambda d: d.update(bounds='0'), 'checksum of the bounds'),
                          (lambda d: d.update(whole=True), 'has not all runs')):
        status, text = verdict(change)
        assert status == 1 and words in text, words
    for change, words in ((lambda d: d.update(version=1), 'version 1'), (lambda d: d.pop('controllers'), 'no result'),
                          (lambda d: d['controllers'][0]['scores'].append(1), 'no result'),
                          (lambda d: d['controllers'][0]['runs'].clear(), 'has no runs'),
                          (lambda d: d['controllers'].clear(), 'no result'),
                          (lambda d: d['controllers'][0]['settings'].update({'plant.theta_N': 60}),
                           'pi: setting "plant.theta_N": give keys under control. alone'),
                          (lambda d: d['controllers'][0].update(name='nobody'), 'nobody'),
                          (lambda d: d['controllers'][0]['runs'][0].update(seed=float('inf')), 'no result'),
                          (lambda d: d['controllers'][0]['runs'][0].update(case='mine'), 'not of the set')):
        status, text = verdict(change)
        assert status == 2 and words in text, words


@pytest.mark.skipif(shutil.which('cc') is None, reason='needs a C compiler')
def test_a_controller_from_a_shared_library(tmp_path):
    root = pathlib.Path(__file__).parents[2]
    library = tmp_path / 'pi_in_c.so'
    subprocess.run(['cc', '-shared', '-fPIC', '-O2', f'-I{root}/include', f'{root}/examples/c_controller/pi_controller.c',
                    '-o', str(library)], check=True)
    of_library, of_program = (run(Entry(name, {}), few(), bounds.stored(), seeds=(1,)) for name in (str(library), 'pi'))
    for from_file, built_in in zip(of_library.rows, of_program.rows):
        assert from_file['stop_distance_m'] == pytest.approx(built_in['stop_distance_m'], rel=1e-2)
    for row in of_library.rows:
        assert row['slip_largest'] == pytest.approx(row['slip_overshoot'] + 0.15, abs=0.02)
    with pytest.raises(ValueError, match='none.so'):
        run(Entry(str(tmp_path / 'none.so'), {}), few(), bounds.stored(), seeds=(1,))


def test_a_controller_from_an_fmu(tmp_path):
    from abs_hil.options import program
    law, names = tmp_path / 'pi.fmu', tmp_path / 'map.toml'
    subprocess.run([program(), 'export-fmu', '--controller', 'pi', '--set', 'plant.ideal_sensors=true', '--out', str(law)],
                   check=True, capture_output=True)
    names.write_text('[outputs]\nbrake_torque_ref_Nm = "brake_torque_Nm"\n[inputs]\nupper_counts = "start"\n'
                     'lower_counts = "start"\n', encoding='utf-8')
    entry = Entry(str(law), {'control.foreign.mapping': str(names)})
    of_fmu, of_program = (run(one, few(), bounds.stored(), seeds=(1,)) for one in (entry, Entry('pi', {})))
    for from_file, built_in in zip(of_fmu.rows, of_program.rows):
        assert from_file['fault'] == ''
        assert from_file['stop_distance_m'] == pytest.approx(built_in['stop_distance_m'], rel=2e-2)


def test_a_class_is_found_in_the_present_folder(tmp_path, monkeypatch):
    (tmp_path / 'law_of_this_folder.py').write_text('class Law:\n    reset = step = print\n')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, 'path', [folder for folder in sys.path if folder != ''])
    assert type(made('law_of_this_folder:Law')).__name__ == 'Law'
    with pytest.raises(ValueError, match='in this folder or on PYTHONPATH'):
        made('law_of_no_folder:Law')
