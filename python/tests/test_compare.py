"""The tables of `abs_hil compare` from made-up runs, and its estimates against SciPy and figures worked by hand."""
import csv
import io
import json
import math

import numpy as np
import pytest
from scipy import stats

from abs_hil import compare, merits
from abs_hil.merits import figures

NAN = math.nan


def half_width(values):
    """Of the 95 % interval, by SciPy's own distribution."""
    return stats.sem(values) * stats.t.ppf(0.975, len(values) - 1)


# ---- estimates

def test_the_mean_of_a_sample_worked_by_hand():
    # 2, 4, 4, 4, 10: mean 4.8, squares 7.84 + 3 * 0.64 + 27.04 = 36.8, s^2 = 9.2, t(4) = 2.776445.
    found = merits.of_mean([2.0, 4.0, 4.0, 4.0, 10.0])
    assert found.n == 5 and found.mean == pytest.approx(4.8, abs=1e-12)
    assert found.deviation == pytest.approx(math.sqrt(9.2), abs=1e-12)
    assert found.half_width == pytest.approx(2.776445 * math.sqrt(9.2 / 5.0), abs=1e-5)
    assert 0.5 * (found.low + found.high) == pytest.approx(4.8, abs=1e-12)


@pytest.mark.parametrize('n', [2, 3, 10, 100, 5000])
def test_intervals_are_those_of_scipy(n):
    values = np.random.default_rng(n).normal(3.0, 2.0, n)
    found = merits.of_mean(values)
    low, high = stats.t.interval(0.95, n - 1, loc=np.mean(values), scale=stats.sem(values))
    assert found[1:] == pytest.approx((np.mean(values), np.std(values, ddof=1), low, high), rel=1e-10)


def test_missing_values_are_left_out_and_small_samples_have_no_interval():
    found = merits.of_mean([1.0, NAN, 3.0])
    assert found[:2] == (2, 2.0) and found.half_width == pytest.approx(12.7062, abs=1e-3)  # t(1) s / sqrt(2), s = sqrt(2)
    one, none = merits.of_mean([7.0]), merits.of_mean([NAN, NAN])
    assert one[:2] == (1, 7.0) and np.isnan(one[2:]).all()
    assert none.n == 0 and np.isnan(none[1:]).all()


def test_a_paired_difference_cancels_what_both_share():
    base, values = np.array([1.0, 5.0, 9.0, 13.0, NAN, 1.0]), np.array([1.1, 5.2, 9.1, 13.2, 1.0, NAN])
    found = merits.of_difference(values, base)
    # s of {.1, .2, .1, .2} is 0.057735; t(3) = 3.182446.
    assert found.n == 4 and found.mean == pytest.approx(0.15)
    assert found.half_width == pytest.approx(3.182446 * 0.057735 / 2, abs=1e-6)
    assert merits.of_mean(values[:4]).half_width > 50.0 * found.half_width
    test = stats.ttest_rel(values[:4], base[:4]).confidence_interval(0.95)
    assert (found.low, found.high) == pytest.approx((test.low, test.high))


def test_an_inverse_ratio_has_the_inverse_interval():
    base, values = np.array([1.0, 2.0, 4.0, 1.0, -1.0, NAN]), np.array([0.5, 1.1, 1.8, 0.0, 1.0, 1.0])
    ratio, inverse = merits.of_ratio(values, base), merits.of_ratio(base, values)
    assert ratio.n == 3 and ratio.mean == pytest.approx(stats.gmean([0.5, 0.55, 0.45]))
    assert ratio.low * inverse.high == pytest.approx(1.0) and ratio.high * inverse.low == pytest.approx(1.0)
    assert math.log(ratio.high / ratio.mean) == pytest.approx(half_width(np.log([0.5, 0.55, 0.45])))
    assert merits.of_ratio(values[3:], base[3:]).n == 0


def test_about_95_of_100_intervals_hold_the_true_mean():
    found = [merits.of_mean(sample) for sample in np.random.default_rng(12345).random((400, 12))]
    # Binomial(400, 0.95): 380 -+ 4.4, four standard deviations either way.
    assert 362 <= sum(one.low <= 0.5 <= one.high for one in found) <= 398


# ---- tables

def row(controller, repetition, stop_time_s, variation_Nm, locked_s=0.0, result='completed'):
    """A row of a study's results, in the order of its columns, with a plant that was drawn."""
    values = dict.fromkeys(figures(), 'nan')
    values.update(stop_time_s=str(stop_time_s), stop_distance_m=str(10.0 * stop_time_s), time_locked_s=str(locked_s),
                  torque_total_variation_Nm=str(variation_Nm), theta_error_final='-0.02')
    return {'run': '0', 'plant': 'paper-table1', 'experiment': 'paper', 'controller': controller, 'point': '0',
            'repetition': str(repetition), 'result': result, 'reason': '', **values, 'plant.theta_N': '23.5',
            'sensor_seed': '18446744073709551615'}


def facts_of(*controllers, repeat=4, **others):
    return {'repeat': repeat, 'seed': 3, 'vary': 'parameters=0.1,theta=0.1,phase', 'model_differs': '',
            'controllers': [{'name': name, 'controller': name, 'settings': []} for name in controllers],
            'config': {'experiment': {'start_speed_rad_s': 170.0, 'end_speed_m_s': 0.3}, 'control': {'slip_ref': 0.15},
                       'run': {'seed': 1}}, **others}


OURS = [(2.0, 30), (2.2, 40), (2.4, 50), (99.0, 99, 0.0, 'fault')]
THEIRS = [(2.5, 600), (2.7, 800, 0.2), (3.2, 1000), (2.6, 700)]


def sample(ours='adaptive', theirs='sliding-mode', **others):
    """Made-up runs: 2.0, 2.2, 2.4 s and 2.5, 2.7, 3.2 s; one more of ours is a fault. The controller changes fastest."""
    rows = [row(name, k, *runs[k]) for k in range(4) for name, runs in ((ours, OURS), (theirs, THEIRS))]
    return facts_of(ours, theirs, **others), list(rows[0]), [list(one.values()) for one in rows]


def texts(*arguments):
    return compare.texts_of(*arguments)


def rows_of(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_the_columns_hold_the_statistics_of_the_runs():
    ours, theirs = compare.columns_of(*sample())
    assert (ours.faults, ours.count, ours.differences) == (1, 4, {})
    assert ours.means['stop_time_s'].n == 3  # runs with a fault are left out
    assert ours.means['stop_time_s'].mean == pytest.approx(2.2)
    assert theirs.locked == 1
    difference = theirs.differences['stop_time_s']
    assert difference.n == 3 and difference.mean == pytest.approx((0.5 + 0.5 + 0.8) / 3)  # incomplete pairs are left out
    assert difference.half_width == pytest.approx(half_width([0.5, 0.5, 0.8]))
    assert ours.quantiles['stop_time_s'] == pytest.approx({'p10': 2.04, 'median': 2.2, 'p90': 2.36})  # linear between the three
    assert ours.means['theta_error_final'].mean == pytest.approx(0.02)  # errors of either sign count alike
    ratio = compare.paper_ratios([ours, theirs])['stop_time']
    assert ratio.mean == pytest.approx((2.0 / 2.5 * 2.2 / 2.7 * 2.4 / 3.2) ** (1 / 3))


def test_the_ratio_is_there_only_with_both_controllers_of_the_paper():
    assert 'the paper' not in texts(*sample(theirs='nominal'))['text']
    assert 'adaptive_over_sliding_mode' not in json.loads(texts(*sample(theirs='nominal'))['json'])


def test_csv_and_json_have_the_numbers_in_full():
    arguments = sample()
    made, columns = texts(*arguments), compare.columns_of(*arguments)
    told = json.loads(made['json'])
    assert (told['repeat'], told['seed'], told['config']['run']['seed'], told['slip_ref']) == (4, 3, 1, 0.15)
    assert told['vary'] == 'parameters=0.1,theta=0.1,phase' and 'NaN' not in made['json']
    assert told['adaptive_over_sliding_mode']['stop_time']['mean'] == compare.paper_ratios(columns)['stop_time'].mean
    assert told['adaptive_over_sliding_mode']['paper'] == pytest.approx(0.933)
    assert told['controllers'][0]['metrics']['slip_rms']['mean'] is None
    assert told['controllers'][0]['difference_from_first'] is None
    rows = rows_of(made['csv'])
    assert len(rows) == 2 * len(compare.compared())
    for one, (column, figure) in zip(rows, ((column, figure) for column in columns for figure in compare.compared())):
        assert (one['controller'], one['metric']) == (column.facts['name'], figure.name)
        mean, shown = column.means[figure.name], told['controllers'][columns.index(column)]['metrics'][figure.name]
        assert int(one['n']) == mean.n == shown['n']
        for name, value in (('mean', mean.mean), ('ci95_low', mean.low), ('p10', column.quantiles[figure.name]['p10'])):
            assert np.array_equal(float(one[name]), value, equal_nan=True)
            assert shown[name] == (None if math.isnan(value) else value)
        difference = column.differences.get(figure.name)
        assert np.array_equal(float(one['difference']), difference.mean if difference else NAN, equal_nan=True)


def test_text_and_markdown_show_the_same_figures_to_their_decimals():
    made = texts(*sample())
    # s of 2.0, 2.2, 2.4 is 0.2; t(2) = 4.30265; half width 0.4968.
    for text in made['text'], made['markdown']:
        for words in ('2.200 ± 0.497 (3 runs)', '40.0 ± 24.8 (3 runs)', '+0.600 ± 0.430 (3 runs)', '2.200 [2.040, 2.360]',
                      'the paper: 0.933 for time and distance (6.7 % less)', '4 runs of each controller, seed 3, plants varied by '
                      'parameters=0.1,theta=0.1,phase', 'braking from 170 rad/s to 0.3 m/s, slip reference 0.15.\n'):
            assert words in text, text


def test_columns_are_aligned_by_characters_and_rows_have_their_header_s_cells():
    made = texts(*sample(ours='Übergang é', theirs='制'))
    ends = {len(line) for line in made['text'].split('\n\n')[1].splitlines()}
    assert len(ends) == 1, made['text']
    for table in made['markdown'].split('\n\n')[1:]:
        assert len({line.count('|') for line in table.splitlines()}) == 1, table


def test_a_single_run_has_no_interval_and_one_controller_no_difference():
    one = row('adaptive', 0, 2.0, 30)
    text = texts(facts_of('adaptive', repeat=1), list(one), [list(one.values())])['text']
    assert '1 run of each' in text and '  2.000\n' in text
    assert not any(words in text for words in ('±', 'ifference', 'median', 'sliding'))


def test_the_heading_says_what_labels_stand_for_and_where_the_model_differs():
    facts, names, rows = sample(model_differs='theta_N 23 (plant 40)')
    facts['controllers'][0]['settings'] = [['control.adaptive.gamma', '60'], ['control.slip_ref', '0.1']]
    facts['config']['experiment']['start_speed_rad_s'] = 0.0
    text = texts(facts, names, rows)['text']
    assert 'The model differs from the plant: theta_N 23 (plant 40).\n' in text and 'from standstill to 0.3 m/s' in text
    assert 'adaptive is adaptive with control.adaptive.gamma = 60, control.slip_ref = 0.1.\n' in text


def test_the_runs_are_listed_with_what_was_drawn():
    name = 'adaptive{slip_ref=0.1,gamma=60}'
    text = texts(*sample(ours=name))['runs']
    names = ','.join(figure.name for figure in compare.compared())
    assert text.startswith(f'controller,run,result,{names},plant.theta_N,sensor_seed\n"{name}",0,completed,2.0,20.0,')
    rows = rows_of(text)
    assert [(one['controller'], one['run'], one['result']) for one in rows] == [
        *((name, str(k), 'fault' if k == 3 else 'completed') for k in range(4)),
        *(('sliding-mode', str(k), 'completed') for k in range(4))]
    assert {(one['plant.theta_N'], one['sensor_seed']) for one in rows} == {('23.5', '18446744073709551615')}


@pytest.mark.parametrize('whole', [True, False])
def test_of_a_part_it_makes_nothing(whole, monkeypatch, capsys):
    facts, names, rows = sample()
    told = io.StringIO()
    csv.writer(told).writerows([names, *(rows if whole else rows[:-1])])
    stdin = io.TextIOWrapper(io.BytesIO(f'{json.dumps(facts)}\n{told.getvalue()}'.encode()))
    monkeypatch.setattr('sys.stdin', stdin)
    assert compare.main([]) == (0 if whole else 1)
    said = capsys.readouterr().out
    assert (json.loads(said) == texts(facts, names, rows)) if whole else said == ''


@pytest.mark.parametrize('told', [b'', b'{"repeat": 4, "contr'])
def test_of_nothing_it_makes_nothing(told, monkeypatch, capsys):
    monkeypatch.setattr('sys.stdin', io.TextIOWrapper(io.BytesIO(told)))
    assert compare.main([]) == 1 and capsys.readouterr() == ('', '')
