"""The calibration of the intervals: it finds those that are too narrow, too wide or beside the truth."""
from __future__ import annotations

import types

import numpy as np
import pytest
import scipy.stats
from identification_study import calibration, page_rows, rank, within
from late_rigs import tried

RIGS = 300


def rows_of(error, half_width=1.96):
    """Rigs with the standard deviation 1, whose fit gave intervals of this half width; `error`: of each estimate."""
    estimates = [types.SimpleNamespace(low=e - half_width, high=e + half_width) for e in error]
    return [{'B rank': rank(estimate, 0.0), 'distance_error': 0.0, 'force apart': 0.0, 'rms_counts': 0.29}
            for estimate in estimates]


@pytest.fixture
def errors():
    return scipy.stats.norm.ppf((np.arange(RIGS) + 0.5) / RIGS)


def test_right_intervals_pass(errors):
    rows = rows_of(errors)
    assert calibration(rows) == []
    assert within(np.array([row['B rank'] for row in rows])) == pytest.approx([50.0, 80.0, 95.0], abs=0.5)


@pytest.mark.parametrize('shift, half_width', [(0.0, 1.2), (0.0, 3.2), (0.4, 1.96)])
def test_wrong_intervals_are_named(errors, shift, half_width):
    assert calibration(rows_of(errors + shift, half_width)) == ['B']


def test_an_estimate_without_interval_has_no_rank():
    assert np.isnan(rank(None, 1.0))
    assert np.isnan(rank(types.SimpleNamespace(low=None, high=None), 1.0))
    assert rank(types.SimpleNamespace(low=0.0, high=2.0), 1.0) == pytest.approx(0.5)
    assert rank(types.SimpleNamespace(low=0.0, high=2.0), 2.0) == pytest.approx(0.975, abs=1e-4)


def test_the_page_has_the_shares(errors):
    rows = rows_of(errors)
    lines = list(page_rows({'a': rows[:100], 'b': rows[100:200], 'c': rows[200:]}, False))
    shares = ', '.join(f'{share:.1f}' for share in within(np.array([row['B rank'] for row in rows])))
    assert lines[0].endswith(f'| {shares} |')
    assert lines[1].endswith('| of 300, |')


def test_duties_that_a_board_rounded_move_no_parameter():
    """The logs hold duties as somebody asked for them, and a board of 8 bits gave others. The residual does not tell."""
    held = tried('paper-timing', 1066, clean=True)['given']['held']
    assert sum(held.values()) >= len(held) - 1 >= 10


def test_a_radius_that_no_wheel_rolled_on_leads_nowhere_else():
    """The wheels never roll freely: a radius that is off by 1.5 % shifts every slip, and the first values with it."""
    found = tried('paper-table1', 1011, clean=True)['given']
    assert not found['misfit'] and sum(found['held'].values()) >= len(found['held']) - 1 >= 10
