"""Studies from Python: the program's bytes, single runs of them, quantiles, maps, Sobol indices, the page, Parquet."""
import base64
import csv
import gzip
import json
import struct
import zlib

import numpy as np
import pandas
import pytest

import abs_hil
from abs_hil.report import program as report
from abs_hil.report.text import rounded
from abs_hil.studies.running import toml_of

#: short runs: braking ends at 5 m/s
SMALL = {'controllers': ['adaptive', 'pi'], 'chunk': 16,
         'settings': {'experiment.end_speed_m_s': 5.0},
         'design': {'kind': 'saltelli', 'points': 8, 'seed': 0},
         'factors': {'plant.theta_N': {'from': 15, 'to': 30}, 'plant.B': {'from': 20, 'to': 30},
                     'plant.C': {'mean': 1.6, 'sd': 0.05, 'most': 2.0}}}


@pytest.fixture(scope='module')
def small():
    return abs_hil.study(SMALL)


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp('study') / 'out'
    abs_hil.study(SMALL, out=path)
    return path


def test_the_results_are_the_programs(abs_hil_program, tmp_path, folder, small):
    file = tmp_path / 'study.toml'
    file.write_text(toml_of(SMALL))
    abs_hil_program('study', file, '--out', tmp_path / 'out')
    theirs = (tmp_path / 'out' / 'results.csv.gz').read_bytes()
    assert theirs == (folder / 'results.csv.gz').read_bytes()
    with gzip.open(tmp_path / 'out' / 'results.csv.gz', 'rt', newline='') as text:
        rows = list(csv.DictReader(text))
    assert len(small) == len(rows) == len(small.data) == 8 * 5 * 2
    for name in [*small.factors, *small.metrics]:
        np.testing.assert_array_equal(small.data[name], [float(row[name]) for row in rows])


def test_rows_are_named(small):
    assert small.factors == ['plant.theta_N', 'plant.B', 'plant.C']
    assert small.metrics[:3] == ['brake_start_s', 'stop_time_s', 'stop_distance_m']
    assert list(small.data['controller'][:3]) == ['adaptive', 'pi', 'adaptive']
    assert (small.data['result'] == 'completed').all()
    assert 'StudyResults study: 80 runs' in repr(small)
    assert sum(len(part) for part in small.chunks(rows=7)) == 80


def test_columns_are_those_of_all_rows(folder):
    results = abs_hil.load_study(folder)
    some = results.columns(['plant.theta_N', 'controller', 'stop_distance_m'])
    assert list(some) == ['plant.theta_N', 'controller', 'stop_distance_m']
    table, map_ = results.quantiles(), results.map('plant.theta_N', 'plant.B', 'stop_distance_m', bins=2)
    pandas.testing.assert_frame_equal(some, results.data[list(some)])
    assert list(results.columns(['run', 'controller', 'run'])) == ['run', 'controller']
    # The same from all rows as from the columns alone.
    pandas.testing.assert_frame_equal(table, results.quantiles())
    pandas.testing.assert_frame_equal(map_, results.map('plant.theta_N', 'plant.B', 'stop_distance_m', bins=2))


def test_rows_that_are_lost_or_doubled_are_refused(folder, tmp_path):
    whole = (folder / 'results.csv.gz').read_bytes()
    lines = gzip.decompress(whole).splitlines(keepends=True)
    header = whole[:whole.index(b'\0', 10) + 1]  # with the study in its comment
    for rows, words in ((lines[:-1], '79 rows instead of the 80'), ([*lines, lines[-1]], 'more than the 80 rows')):
        file = tmp_path / 'results.csv.gz'
        packed = zlib.compressobj(9, zlib.DEFLATED, -15)
        text = b''.join(rows)
        file.write_bytes(header + packed.compress(text) + packed.flush()
                         + struct.pack('<II', zlib.crc32(text), len(text)))
        with pytest.raises(ValueError, match=words):
            abs_hil.load_study(tmp_path).quantiles()


def test_results_without_a_folder_go_with_their_object():
    results = abs_hil.study({'settings': SMALL['settings']})
    place = results.path
    assert place.exists() and len(results.data) == 1
    del results
    assert not place.exists()


def test_saltellis_rows_are_salibs(small):
    sobol = pytest.importorskip('SALib.sample.sobol')
    problem = {'num_vars': 2, 'names': ['a', 'b'], 'bounds': [[15, 30], [20, 30]]}
    both = {**SMALL, 'controllers': ['adaptive'],
            'factors': {name: SMALL['factors'][name] for name in ('plant.theta_N', 'plant.B')}}
    data = abs_hil.study(both).data
    expected = sobol.sample(problem, 8, calc_second_order=False, scramble=False)
    np.testing.assert_allclose(data[['plant.theta_N', 'plant.B']], expected, atol=1e-12)


def test_sobol_indices_of_a_sum_are_the_shares_of_its_variance():
    pytest.importorskip('SALib')
    study = abs_hil.study({**SMALL, 'controllers': ['locked'], 'design': {'kind': 'saltelli', 'points': 128},
                           'settings': {'experiment.end_speed_m_s': 15.0, 'experiment.start_speed_rad_s': 155}})
    data = study.data
    unit = [(data['plant.theta_N'] - 15) / 15, (data['plant.B'] - 20) / 10]
    data['slip_rms'] = 3 * unit[0] + 2 * unit[1]
    found = study.sobol_indices('slip_rms')
    np.testing.assert_allclose(found['S1'], [9 / 13, 4 / 13, 0], atol=0.05)
    np.testing.assert_allclose(found['ST'], [9 / 13, 4 / 13, 0], atol=0.05)
    data.loc[5, 'slip_rms'] = np.nan
    with pytest.raises(ValueError, match='1 of 640 points have none'):
        study.sobol_indices('slip_rms')


def test_sobol_indices_need_their_design_and_one_group(small):
    pytest.importorskip('SALib')
    with pytest.raises(ValueError, match='give values of controller'):
        small.sobol_indices('stop_distance_m')
    assert small.sobol_indices('stop_distance_m', {'controller': 'pi'}).loc['plant.theta_N', 'ST'] > 0.5
    with pytest.raises(ValueError, match='need the design saltelli'):
        abs_hil.study({}).sobol_indices('slip_rms')


def test_quantiles_are_those_of_numpy(small):
    table = small.quantiles(metrics=['stop_distance_m'])
    pi = small.data[small.data['controller'] == 'pi']['stop_distance_m']
    assert table.loc[('pi', 'stop_distance_m'), 'runs'] == 40
    np.testing.assert_allclose(table.loc[('pi', 'stop_distance_m'), [0.1, 0.5, 0.9]].astype(float),
                               np.quantile(pi, [0.1, 0.5, 0.9]))


def test_a_map_has_the_median_of_each_cell(small):
    table = small.map('plant.theta_N', 'plant.B', 'stop_distance_m', bins=2, where={'controller': 'adaptive'})
    rows = small.data[small.data['controller'] == 'adaptive']
    theta, stiffness = rows['plant.theta_N'], rows['plant.B']
    cell = rows[(theta < (theta.min() + theta.max()) / 2) & (stiffness >= (stiffness.min() + stiffness.max()) / 2)]
    assert table.iloc[1, 0] == cell['stop_distance_m'].median()


def test_a_run_of_a_study_with_all_its_rows(small):
    varied = {**SMALL, 'repeat': {'runs': 3}, 'settings': {}, 'chunk': 200}
    results = abs_hil.study(varied)
    for number in (0, 101):
        run, row = abs_hil.simulate_run(varied, number), results.data.loc[number]
        assert run.summary['stop_distance_m'] == row['stop_distance_m']
        assert run.config['plant.theta_N'] != run.config['model.theta_N']
        assert run.summary['controller'] == row['controller']
    for bad in (-1, 240):
        with pytest.raises(ValueError, match=f'run {bad}'):
            abs_hil.simulate_run(varied, bad)


def test_any_text_may_describe_a_study():
    assert len(abs_hil.study({**SMALL, 'description': 'glatt \u2744 \U0001f600 "quoted"'}).data) > 0


def test_an_interrupted_study_goes_on(tmp_path):
    def stop(done, total):
        if done > total * 0.8:
            raise KeyboardInterrupt
    many = {**SMALL, 'chunk': 4, 'repeat': {'runs': 20}}
    with pytest.raises(KeyboardInterrupt):
        abs_hil.study(many, out=tmp_path / 'a', threads=1, progress=stop)
    done = len(list((tmp_path / 'a' / 'parts').glob('0*.csv.gz')))
    assert 0 < done < 400
    with pytest.raises(ValueError, match='not complete'):
        abs_hil.load_study(tmp_path / 'a')
    seen = []
    abs_hil.study(many, out=tmp_path / 'a', progress=lambda *counts: seen.append(counts))
    assert {total for _, total in seen} == {1600} and seen[0][0] >= 4 * done  # what is there counts
    abs_hil.study(many, out=tmp_path / 'b')
    assert (tmp_path / 'a' / 'results.csv.gz').read_bytes() == (tmp_path / 'b' / 'results.csv.gz').read_bytes()


@pytest.mark.parametrize('study, words', [
    ({'plant': 'x'}, 'unknown key "plant"'), ({'factors': {'plant.theta': [1]}}, r'plant.theta_N'),
    ({'factors': {'plant.theta_N': {'from': 1}}}, 'has no to'), ({'chunk': object()}, 'a study takes numbers'),
    ({3: 1}, 'texts as keys'), ('none.toml', 'no such file')])
def test_bad_studies_are_value_errors(study, words):
    with pytest.raises(ValueError, match=words):
        abs_hil.study(study)


def test_toml_of_every_kind_of_value():
    tomllib = pytest.importorskip('tomllib')
    values = {'a': [1, 2.5, True, 'x "y"'], 'b': {'c.d': np.float64(0.1), 'e f': np.arange(2)}}
    assert tomllib.loads(toml_of(values)) == {'a': [1, 2.5, True, 'x "y"'], 'b': {'c': {'d': 0.1}, 'e f': [0, 1]}}


def test_parquet_has_the_rows_and_the_study(tmp_path, folder):
    parquet = pytest.importorskip('pyarrow.parquet')
    assert report.main([str(folder), '--parquet', '--output', str(tmp_path / 's.parquet')]) == 0
    table = parquet.read_table(tmp_path / 's.parquet')
    facts = json.loads(table.schema.metadata[b'abs_hil.study'])
    assert facts == json.loads((folder / 'study.json').read_text())
    frame = table.to_pandas()
    np.testing.assert_array_equal(frame['slip_rms'], abs_hil.load_study(folder).data['slip_rms'])


def test_the_page_and_the_table_of_a_study(tmp_path, folder, capsys):
    pytest.importorskip('plotly')
    page = tmp_path / 'report.html'
    assert report.main([str(folder), '--output', str(page)]) == 0
    html, plots = page.read_text(), plots_of(page)
    for words in ('Study study', 'figure-maps-slip_rms', 'figure-curves-stop_distance_m', 'median [10 %, 90 %]', 'Sobol indices',
                  'Worst runs', 'peak tyre force / N'):
        assert words in html
    assert len(plots) == 6
    for title in (axis['title']['text'] for plot in plots for name, axis in plot['layout'].items() if 'axis' in name[:5]):
        assert 'plant.' not in title and '_' not in title
    assert report.main([str(folder), '--metric', 'stop_time_s', '--output', str(page)]) == 0
    assert [plot['id'] for plot in plots_of(page)] == ['curves-stop_time_s', 'maps-stop_time_s']
    capsys.readouterr()
    assert report.main([str(folder), '--table']) == 0
    printed = capsys.readouterr().out
    assert 'adaptive' in printed and 'runs ended by a fault' in printed


def plots_of(page):
    data = gzip.decompress(base64.b64decode(page.read_text().partition('id="plots">')[2].partition('</script>')[0]))
    return json.loads(data[4:4 + int.from_bytes(data[:4], 'little')])['plots']


def page_of(study, tmp_path):
    pytest.importorskip('plotly')
    abs_hil.study(study, out=tmp_path / 'out')
    assert report.main([str(tmp_path / 'out'), '--output', str(tmp_path / 'page.html')]) == 0
    return plots_of(tmp_path / 'page.html'), (tmp_path / 'page.html').read_text()


def test_a_map_is_as_fine_as_its_grid_and_shows_the_border_of_success(tmp_path):
    """Faster than the gate allows is a fault: the border is the diagonal of the two speeds."""
    plots, _ = page_of({'controllers': ['locked'], 'factors': {
        'experiment.start_speed_rad_s': {'from': 100, 'to': 290, 'steps': 20},
        'gate.overspeed_rad_s': {'from': 105, 'to': 285, 'steps': 19}}}, tmp_path)
    heat, border = next(plot for plot in plots if plot['id'] == 'maps-stop_distance_m')['data']
    assert (heat['type'], *(heat[name]['size'] for name in 'xyz'), heat['z']['columns']) == ('heatmap', 20, 19, 380, 20)
    assert (border['type'], border['contours']['start'], border['contours']['end']) == ('contour', 0.5, 0.5)


def test_a_study_without_factors_shows_distributions_and_the_worst_runs(tmp_path):
    plots, html = page_of({'controllers': ['adaptive'], 'repeat': {'runs': 30, 'vary': 'theta=0.2'},
                           'settings': SMALL['settings']}, tmp_path)
    assert [plot['id'] for plot in plots] == ['distributions']
    assert len(plots[0]['data']) > 5
    data = abs_hil.load_study(tmp_path / 'out').data
    worst = data.loc[data['stop_distance_m'].idxmax()]
    assert f'<th scope="row">stop distance / m</th><td>{worst["stop_distance_m"]:.4g}</td><td>{worst["run"]}</td>' in html


def test_rows_that_are_cut_are_called_so(folder, tmp_path):
    whole = (folder / 'results.csv.gz').read_bytes()
    (tmp_path / 'results.csv.gz').write_bytes(whole[:len(whole) - 500])
    with pytest.raises(ValueError, match='the rows are cut or damaged'):
        abs_hil.load_study(tmp_path).quantiles()


def test_numbers_have_the_decimals_that_their_spread_tells():
    assert rounded([19.91104, 18.3, 21.5], 3.2) == ['19.9', '18.3', '21.5']
    assert rounded([0.0075230], 0.00012) == ['0.00752']
    assert rounded([2.5], 0.0) == ['2.5']


@pytest.mark.parametrize('arguments, words', [
    (['--metric', 'nope'], '--metric nope'), (['--paper'], '--paper'), (['--csv'], 'give FILE.csv'),
    (['--label', 'x'], '--label')])
def test_options_that_are_not_for_studies(folder, tmp_path, capsys, arguments, words):
    assert report.main([str(folder), '--output', str(tmp_path / 'r.html'), *arguments]) == 2
    assert words in capsys.readouterr().err
