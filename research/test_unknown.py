"""What not knowing tyre or road costs at least: identical tyres, the spread of counts on the plant, a jump."""
from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

pytest.importorskip('casadi')

import certificate  # noqa: E402
import unknown  # noqa: E402
from dense import Grid, certify  # noqa: E402

from abs_hil import Plant  # noqa: E402
from abs_hil.optimum import END_SPEED_M_S, Rig, drivers, optimum  # noqa: E402
from abs_hil.optimum.rig import Piece  # noqa: E402

SMALL = certificate.Grid(slips=40, torques=20, layer_s=4e-3)


def tyre(theta_N: float, B: float, C: float) -> Rig:
    return Rig.of(plant='paper-table1', set={'plant.theta_N': theta_N, 'plant.B': B, 'plant.C': C})


def rolling(rig: Rig, speed_rad_s: float) -> np.ndarray:
    return rig.state(speed_rad_s * rig['r2_m'] / rig['r1_m'], speed_rad_s)


def test_not_knowing_a_tyre_costs_nothing_if_there_is_no_other_and_never_less_where_it_lasts():
    weak, strong = tyre(10.0, 40.0, 1.9), tyre(58.5, 10.0, 1.3)
    start = rolling(weak, 60.0)
    assert unknown.ignorance(unknown.of_tyres([weak, weak], start, 20, END_SPEED_M_S)).loss == pytest.approx(0.0, abs=1e-6)
    found = [unknown.ignorance(unknown.of_tyres([weak, strong], start, periods, END_SPEED_M_S)) for periods in (0, 13, 15)]
    assert found[0].loss == pytest.approx(0.0, abs=1e-6)
    assert found[0].loss < 1e-4 < found[1].loss < found[2].loss
    for one in found:  # the dual meets the brakings found
        assert one.loss == pytest.approx(one.primal, abs=2e-6)
    assert found[0].known_m == pytest.approx([optimum(set={f'plant.{name}': rig[name] for name in ('theta_N', 'B', 'C')},
                                                      start_speed_rad_s=60.0, upper_speed_rad_s=float(rig.omega1_rad_s(start))
                                                      ).distance_m for rig in (weak, strong)], rel=1e-4)


def test_counts_of_two_tyres_part_no_later_than_the_bound_says():
    # Under full torque, and under torque that comes and goes, on the plant of the program.
    tyres = [{'plant.theta_N': 10.0, 'plant.B': 40.0, 'plant.C': 1.9}, {'plant.theta_N': 58.5, 'plant.B': 10.0, 'plant.C': 1.3}]
    rigs = [Rig.of(plant='paper-table1', set=values) for values in tyres]
    start, count = rolling(rigs[0], 100.0), 2.0 * math.pi / 4096
    most = unknown.spread_counts(rigs, start, 16)
    for duties in ([1.0] * 16, [1.0] * 8 + [0.0] * 8, [1.0, 0.0] * 8):
        plants = [Plant('paper-table1', values) for values in tyres]
        for plant in plants:
            plant.reset(omega1_rad_s=float(rigs[0].omega1_rad_s(start)), omega2_rad_s=100.0)
        for k, duty in enumerate(duties):
            one, other = (plant.state for plant in plants)
            apart = abs(one.angle1_rad - other.angle1_rad) + abs(one.angle2_rad - other.angle2_rad)
            assert apart / count <= most[k] + 1e-6
            for plant in plants:
                plant.advance(unknown.PERIOD_S, brake_duty=duty)


def test_a_jump_that_nobody_foresees_costs_less_than_the_causal_driver_loses():
    plant, roads = 'paper-timing', [[Piece(1.0, end=at), Piece(0.5, begin=at)] for at in (0.25, 0.4)]
    rig = Rig.of(plant=plant)
    start = rolling(rig, 170.0)
    found = unknown.ignorance(unknown.of_roads(rig, start, roads, END_SPEED_M_S))
    causal = [drivers.causal(rig, start, road, END_SPEED_M_S).distance_m for road in roads]
    assert 0.0 < found.loss <= found.primal + 1e-9
    assert found.loss < np.mean(np.array(causal) / np.array(found.known_m)) - 1.0


def tyres() -> list[unknown.Member]:
    """Two with rather flat curves, from 40 rad/s, whose commands agree for 60 ms."""
    rigs = [tyre(30.0, 14.0, 1.3), tyre(42.0, 10.0, 1.3)]
    return unknown.of_tyres(rigs, rolling(rigs[0], 40.0), 60, END_SPEED_M_S)


def test_the_programme_meets_that_of_even_roads_and_the_collocation_of_priced_brakings():
    members = tyres()
    found = unknown.ignorance(members)
    made, = certificate.certify([(members, found)], SMALL)
    even = certify('paper-table1', {f'plant.{name}': members[1].rig[name] for name in ('theta_N', 'B', 'C')},
                   start_speed_rad_s=40.0, grid=Grid(slips=30, torques=12, layer_share=0.1))
    assert made.known_m[1] == pytest.approx(even.value_m, rel=1e-3)
    assert made.known_m == pytest.approx(found.known_m, rel=1e-3)
    assert made.priced_m == pytest.approx(found.priced_m, rel=1e-3)
    assert np.abs(np.array(found.priced_m) / found.known_m - 1.0).min() > 0.01  # so the prices count
    assert found.loss > 1e-3 and made.loss == pytest.approx(found.loss, abs=1e-4)


def test_the_programme_tells_a_priced_braking_that_is_not_the_shortest(monkeypatch):
    members, least = tyres(), unknown._Problem.least

    def longer(self, first, known_m, prices=None):  # a local optimum, 1 % longer
        value, *rest = least(self, first, known_m, prices)
        return (value if prices is None else value + 0.01 * unknown.COST / len(members)), *rest
    monkeypatch.setattr(unknown._Problem, 'least', longer)
    monkeypatch.setattr(unknown, 'min', max, raising=False)  # the sum that the brakings found do not bound
    found = unknown.ignorance(members)
    made, = certificate.certify([(members, found)], SMALL)
    assert made.loss < found.loss - 0.008


def test_any_prices_that_cancel_give_a_bound_and_others_are_refused():
    members = tyres()
    found = unknown.ignorance(members)
    twice = dataclasses.replace(found, prices=[2.0 * one for one in found.prices])
    made, = certificate.certify([(members, twice)], SMALL)
    assert made.loss < 0.5 * found.loss
    with pytest.raises(ValueError, match='do not cancel'):
        certificate.certify([(members, dataclasses.replace(found, prices=[found.prices[0], 1.1 * found.prices[1]]))], SMALL)
    tracks = [certificate.Track.of(member, prices) for member, prices in zip(members, found.prices)]
    sums = sum(track.costs / known_m for track, known_m in zip(tracks, found.known_m))
    assert np.abs(sums).max() < 1e-6 * np.abs(tracks[0].costs).max()


def test_patches_that_nobody_foresees_agree_in_distance():
    rig = Rig.of(plant='paper-timing', set={'plant.B': 10.0, 'plant.C': 1.4})
    roads = [[Piece(1.0, end=at, along='distance'), Piece(0.5, begin=at, end=at + 0.3, along='distance'),
              Piece(1.0, begin=at + 0.3, along='distance')] for at in (0.2, 0.4)]
    members = unknown.of_roads(rig, rolling(rig, 60.0), roads, END_SPEED_M_S)
    assert [sum(part.lengths.sum() for part in member.parts if part.key) for member in members] == pytest.approx([0.2, 0.4])
    found = unknown.ignorance(members)
    made, = certificate.certify([(members, found)], dataclasses.replace(SMALL, layer_m=0.02, speed_share=0.05))
    assert found.loss > 0.0 and made.loss == pytest.approx(found.loss, abs=1e-4)
    assert made.known_m == pytest.approx(found.known_m, rel=1e-3)


def test_a_change_in_time_is_known_from_the_next_period_on():
    rig = Rig.of(plant='paper-timing')
    for at, until in ((0.1, 0.101), (0.1004, 0.101)):
        road = [Piece(1.0, end=at), Piece(0.5, begin=at)]
        member, = unknown.of_roads(rig, rolling(rig, 170.0), [road], END_SPEED_M_S)
        assert sum(part.lengths.sum() for part in member.parts if part.key) == pytest.approx(until)
