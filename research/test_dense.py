"""The dense programme of even roads, against the collocation of the package."""
from __future__ import annotations

import pytest

pytest.importorskip('casadi')

from dense import Grid, certify  # noqa: E402

from abs_hil.optimum import END_SPEED_M_S, Rig, optimum, trajectory  # noqa: E402
from abs_hil.optimum.guess import Guesser, Policy  # noqa: E402
from abs_hil.optimum.rig import Piece  # noqa: E402

#: coarse: on a steep curve it would need more slips
SMALL = Grid(slips=30, torques=12, layer_rad_s=2.0, layer_share=0.1)
MILD = {'plant.B': 10.0, 'plant.C': 1.4}


@pytest.mark.parametrize('plant, values', [('inteco-manual', {}), ('paper-timing', MILD)])
def test_the_dense_programme_finds_the_same(plant, values):
    rig, speed = Rig.of(plant=plant, set=values), 40.0
    dense = certify(plant, values, start_speed_rad_s=speed, grid=SMALL)
    found = optimum(plant, values, start_speed_rad_s=speed, upper_speed_rad_s=speed * rig['r2_m'] / rig['r1_m']).distance_m
    assert dense.value_m == pytest.approx(found, rel=1e-3)
    assert dense.driven_m == pytest.approx(found, rel=1e-3)


def test_the_dense_programme_tells_a_local_optimum():
    # The bound of version 1 of the benchmark: from a guess that holds the slip near the peak the solver stays there.
    rig = Rig.of(plant='inteco-manual')
    start = rig.state(60.0 * rig['r2_m'] / rig['r1_m'], 60.0)
    phases = Guesser(rig).phases(Policy(0.8), start, 0.0, [Piece(1.0)], END_SPEED_M_S)
    local = trajectory._solve(rig, start, 0.0, phases, END_SPEED_M_S)
    assert local.distance_m > 1.01 * certify('inteco-manual', start_speed_rad_s=60.0, grid=SMALL).value_m
