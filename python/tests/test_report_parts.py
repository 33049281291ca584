"""Parts of the report: thinning, texts, axes, changes of the rig, side files."""
import math

import numpy as np
import pytest

import abs_hil
from abs_hil.report import files, survey, text
from abs_hil.report.model import axis_around, thinned
from abs_hil.rows import read_rows
from abs_hil.run import COLUMNS

NAN = math.nan


def test_short_curves_keep_all_rows():
    x = np.arange(20.0)
    y = np.sin(x)
    for most in (10, 20, 1000):
        for kept, given in zip(thinned(x, y, most), (x, y)):
            np.testing.assert_array_equal(kept, given)


def test_thinned_curves_keep_every_stretchs_ends_and_extremes():
    """Against a plain loop over the stretches."""
    generator = np.random.default_rng(3)
    x, y = np.arange(10_007.0), generator.normal(size=10_007)
    kept_x, kept_y = thinned(x, y, 64)
    assert len(kept_x) <= 4 * 64
    wanted = set()
    for start in range(0, len(y), 256):
        part = y[start:start + 256]
        wanted |= {start, start + len(part) - 1, start + int(part.argmin()), start + int(part.argmax())}
    assert kept_x.astype(int).tolist() == sorted(wanted)
    np.testing.assert_array_equal(kept_y, y[kept_x.astype(int)])


def test_unknown_values_break_a_curve():
    x = np.arange(8.0)
    y = np.array([NAN, NAN, 1.0, 2.0, NAN, NAN, math.inf, 3.0])
    kept_x, kept_y = thinned(x, y, 100)
    assert kept_x.tolist() == [2.0, 3.0, 4.0, 7.0]
    assert np.isnan(kept_y).tolist() == [False, False, True, False]
    assert len(thinned(x, np.full(8, NAN), 2)[0]) == 0
    long = np.concatenate([np.full(1000, NAN), np.ones(1000), np.full(1000, NAN), np.ones(1000)])
    kept = thinned(np.arange(4000.0), long, 16)[1]
    assert not np.isnan(kept[0]) and np.isnan(kept).sum() == 1


def test_texts():
    assert text.clean('a\nb\x1b[31m') == 'a\uFFFDb\uFFFD[31m'
    assert text.clean('\udcff\ud800') and text.clean('α' * 5, 3) == 'ααα…'
    assert text.short_names(['paper', 'sliding-mode'], 8) == ['paper', 'sliding-…']
    assert text.short_names(['2026-05-04-paper', 'steep', '2026-05-07-paper'], 8) == ['…4-paper', 'steep', '…7-paper']
    assert text.short_names(['afternoon', 'afternoon (2)'], 8) == ['…on', '…on (2)']
    assert text.short_names(['', ''], 8) == ['…', '…']
    assert (text.shown(-1.25, 1), text.shown(-0.0001, 2), text.shown(NAN, 2)) == ('−1.2', '0.00', '–')
    assert text.number_text(23.0) == text.number_text(23) == '23'


def test_axes_end_at_whole_steps():
    assert axis_around(0.0, 0.93, 4) == (0.0, 1.0)
    assert axis_around(-0.3, 0.93, 4) == (-0.5, 1.0)
    assert axis_around(NAN, 1.0, 4) == (0.0, 1.0)
    low, high = axis_around(5.0, 5.0, 4)
    assert low < 5.0 < high


def changes_along(tmp_path, key, profile, truth=True):
    """Changes of a rig that rolls at 10 m/s and brakes from 1 s on with 2 m/s^2, with a row every 10 ms."""
    lines = [','.join(COLUMNS)]
    for i in range(301):
        time = i * 0.01
        speed = (10.0 - 2.0 * max(0.0, time - 1.0)) / 0.1 if truth else NAN
        lines.append(f'{time},{"coast" if i < 100 else "brake"},1,{speed},1,1,0,0,0.1,0,0,0,0,0,0,23,23,0,0,0,0,1,{time},0'
                     .replace('nan', 'NaN'))
    (tmp_path / 'run.csv').write_text('\n'.join(lines) + '\n')
    run = files.RunFiles(tmp_path / 'run.csv', 'run', config={'plant.r2_m': '0.1', key: profile})
    return survey.survey(run, run.rows()).changes


def test_changes_over_time_stand_at_their_instants(tmp_path):
    found = changes_along(tmp_path, 'plant.brake_torque_profile', 'time: 1; 0.5 at 0.255; 1 from 1.5 to 2; 0.7 at 9')
    assert [(change.time_s, change.label) for change in found] == [
        (0.255, 'brake torque × 0.5'), (1.5, 'brake torque drifts'), (2.0, 'brake torque × 1')]
    braking = changes_along(tmp_path, 'plant.friction_profile', 'braking time: 1; 0.5 at 0.25')
    assert [change.time_s for change in braking] == [1.25]


def test_changes_over_distance_stand_at_the_first_row_that_reached_it(tmp_path):
    # 10 m/s: 4.995 m after 0.4995 s. From 1 s on s = 10 m + 10 t - t^2: 14 m at t = 5 - sqrt(21) = 0.41742 s.
    found = changes_along(tmp_path, 'plant.friction_profile', 'distance: 1; 0.5 at 4.995; 1 at 14; 0.7 at 100')
    assert [change.time_s for change in found] == pytest.approx([0.50, 1.42], abs=1e-9)
    braking = changes_along(tmp_path, 'plant.friction_profile', 'braking distance: 1; 0.5 at 4')
    assert [change.time_s for change in braking] == pytest.approx([1.42], abs=1e-9)


def test_unknown_changes_are_left_out(tmp_path):
    assert changes_along(tmp_path, 'plant.friction_profile', 'distance: 1; 0.5 at 4', truth=False) == []
    assert changes_along(tmp_path, 'plant.friction_profile', 'no profile at all') == []
    assert changes_along(tmp_path, 'plant.friction_profile', '') == []


def test_survey_of_rows_gives_the_summarys_figures(tmp_path):
    run = abs_hil.simulate()
    run.to_csv(tmp_path / 'run.csv')
    found = survey.survey(files.RunFiles(tmp_path / 'run.csv', 'run'), read_rows(tmp_path / 'run.csv'))
    for metric in survey.merits_shown():
        said = run.summary[metric.name]
        assert found.metrics[metric.name] == pytest.approx(said, abs=1e-9) if said is not None else True
    assert found.brake_from_s == pytest.approx(run.summary['brake_start_s'])
    assert [phase.phase for phase in found.phases] == list(dict.fromkeys(run['phase'].tolist()))


def pulses_of(tmp_path, torque_Nm, slip_ref):
    """Names and starts of the parts of a braking, a row every 10 ms; torque and wanted slip are functions of the row."""
    lines = [','.join(COLUMNS)]
    for i in range(200):
        row = {**dict.fromkeys(COLUMNS, '1'), 'time_s': f'{0.01 * i:.2f}', 'phase': 'coast' if i < 10 else 'brake',
               'brake_torque_ref_Nm': torque_Nm(i), 'slip_ref': slip_ref(i)}
        lines.append(','.join(map(str, row.values())))
    (tmp_path / 'run.csv').write_text('\n'.join(lines) + '\n')
    run = files.RunFiles(tmp_path / 'run.csv', 'run')
    return [(name, values['brake_start_s']) for name, values in survey.survey(run, run.rows()).brakings]


def test_a_brake_that_acts_again_after_a_release_begins_a_pulse(tmp_path):
    def twice(released):
        return lambda i: 0 if i < 20 or 50 <= i < 50 + released else 2
    assert pulses_of(tmp_path, twice(40), lambda i: 0.15) == [('1: brake', 0.1), ('2: brake, pulse 2', 0.9)]
    assert pulses_of(tmp_path, twice(15), lambda i: 0.15) == []  # as laws that switch do


def test_a_step_of_the_wanted_slip_begins_a_pulse_and_a_ramp_or_a_search_does_not(tmp_path):
    assert pulses_of(tmp_path, lambda i: 2, lambda i: 0.05 if i < 60 else 0.15 if i < 120 else 0.1) == [
        ('1: brake', 0.1), ('2: brake, pulse 2', 0.6), ('3: brake, pulse 3', 1.2)]
    for ramp in (lambda i: 0.1 + 0.02 * i, lambda i: 0.15 + 0.0001 * i, lambda i: 0.1 + 0.05 * (i % 2), lambda i: 'NaN'):
        assert pulses_of(tmp_path, lambda i: 2, ramp) == []
