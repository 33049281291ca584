"""The test of research/nmpc.py: what it reads of the posterior, its prediction against the plant, its solver against IPOPT."""
from __future__ import annotations

import numpy as np
import pytest

ca = pytest.importorskip('casadi')

import nmpc  # noqa: E402
import nmpc_table  # noqa: E402

import abs_hil  # noqa: E402
from abs_hil.benchmark import bounds, cases  # noqa: E402

START = {'experiment.start_speed_rad_s': 170.0, 'experiment.coast_s': 0.5, 'experiment.end_speed_m_s': 0.3}


@pytest.fixture(scope='module')
def functions():
    return nmpc.compiled()


class Kept:
    """Brakes with the law, and keeps it and its output as they are after some cycles."""

    def __init__(self, cycles):
        self.law, self.cycles, self.seen = abs_hil.Controller('adaptive-optimal'), cycles, []

    def reset(self, input):
        self.law.reset(input)

    def step(self, input):
        output = self.law.step(input)
        self.cycles -= 1
        if self.cycles == 0:
            self.seen = [self.law.copy(), output]
        return output


def brake(controller):
    return abs_hil.simulate(controller, experiment='coast-and-brake', set=START)


def test_the_posterior_is_that_of_the_law():
    kept = Kept(300)
    brake(kept)
    law, output = kept.seen
    known = nmpc.Posterior(law, output)
    assert known.weight.sum() == pytest.approx(1.0)
    assert known.weight @ known.theta == pytest.approx(output.theta_est_N)
    scenarios = known.scenarios()
    assert scenarios.shape[1] in nmpc.SIZES and scenarios[0].sum() == pytest.approx(1.0)
    assert scenarios[0] @ scenarios[1] == pytest.approx(output.theta_est_N, rel=0.01)
    assert 0.5 < (known.weight @ nmpc.PEAKS) / output.signals[0] < 2.0

    class Longer:
        def state_bytes(self):
            return law.state_bytes() + bytes(8)
    with pytest.raises(ValueError, match='laid out'):
        nmpc.Posterior(Longer(), output)


def common(**values):
    """A car at 10 m/s on `paper-table1` without friction of its own."""
    usual = dict(T=0.0, s=0.0, v=10.0, a=0.0, drift=0.0, k=0.0995 ** 2 / 7.54e-3 + 0.099 ** 2 / 25.6e-3,
                 c=0.0995 / 7.54e-3, c31=20.37, swing=1e6, h=0.005, recourse=0.0, rest=0.0, caution=0.0, force=23.0, movement=0.0,
                 sent=0.0)
    return np.array([{**usual, **values}[name] for name in nmpc.COMMON])


def own(theta_N=23.0, peak=0.04848, shape=1.68, zero=0.0):
    return np.tile([[1.0 / 16], [theta_N], [peak], [shape], [zero]], 16)


@pytest.mark.parametrize('v_m_s', [12.0, 5.0])
@pytest.mark.parametrize('torque_Nm', [1.5, 3.0, 6.0])
def test_the_prediction_is_that_of_the_plant(functions, torque_Nm, v_m_s):
    peak = np.tan(np.pi / (2.0 * 1.68)) / 28.0
    plant = abs_hil.Plant('paper-table1')
    plant.reset(omega1_rad_s=v_m_s / 0.0995, omega2_rad_s=v_m_s / 0.099)
    drift = (0.0995 / 7.54e-3 * (118.74e-6 * v_m_s / 0.0995 + 0.0032) - 0.099 / 25.6e-3 * (214.68e-6 * v_m_s / 0.099 + 0.0925))
    expected, duty = 0.0, plant.brake_duty_for(torque_Nm)
    for _ in range(200):
        plant.advance(0.0005, brake_duty=duty)
        v = max(0.099 * plant.state.omega2_rad_s, 0.3)
        expected += 0.0005 * v * (1.0 - plant.tyre_force_N / 23.0)
    expected -= 0.0025 * v_m_s  # the first end of the trapezoids
    a = (v_m_s - v) / 0.1
    cost = float(functions[16][0](np.full(10, torque_Nm), common(v=v_m_s, a=a, drift=drift), own(peak=peak)))
    assert cost == pytest.approx(expected, rel=0.03, abs=0.003)


def test_the_derivatives_are_those_of_the_cost(functions):
    value, newton = functions[16]
    q, tyres = common(s=0.3, T=3.0, recourse=2.0, rest=0.05, caution=1.0, movement=1e-3, sent=2.0), own()
    u = np.linspace(1.0, 6.0, 10)
    _, gradient, hessian = (np.asarray(part).squeeze() for part in newton(u, q, tyres))
    for k, step in enumerate(1e-5 * np.eye(10)):
        either = [float(value(u + side * step, q, tyres)) for side in (1, -1)]
        assert gradient[k] == pytest.approx((either[0] - either[1]) / 2e-5, rel=1e-4, abs=1e-8)
        slopes = [np.asarray(newton(u + side * step, q, tyres)[1]).squeeze() for side in (1, -1)]
        assert hessian[k] == pytest.approx((slopes[0] - slopes[1]) / 2e-5, rel=1e-3, abs=1e-6)


@pytest.mark.parametrize('s_m_s, torque_Nm', [(0.0, 0.0), (0.4, 3.0), (2.0, 5.0)])
def test_the_solver_finds_what_ipopt_finds(functions, s_m_s, torque_Nm):
    q = common(s=s_m_s, T=torque_Nm, recourse=2.0, rest=0.05, caution=1.0, movement=1e-3, sent=torque_Nm)
    starts = [np.full(10, level) for level in (0.0, 9.03, 2.0)]
    found, cost, converged = nmpc.Solver(functions).solve(starts, q, own(), 9.03)
    assert converged and found.min() >= 0.0 and found.max() <= 9.03
    value, _ = nmpc.problem(16)
    u = ca.MX.sym('u', 10)
    other = ca.nlpsol('other', 'ipopt', {'x': u, 'f': value(u, q, own())},
                      {'print_time': False, 'ipopt': {'print_level': 0, 'sb': 'yes'}})
    assert cost <= min(float(other(x0=start, lbx=0.0, ubx=9.03)['f']) for start in starts) + 1e-4


def test_it_brakes_and_where_no_solve_converges_it_is_the_shadow(functions):
    controller = nmpc.Nmpc('paper-table1', START, functions=functions)
    stopped = brake(controller).summary
    assert stopped['result'] == 'completed' and stopped['stop_distance_m'] < 1.05 * 15.589
    assert controller.failures < 0.1 * controller.solves
    controller = nmpc.Nmpc('paper-table1', START, functions=functions, period_s=0.001)
    controller.solver.solve = lambda starts, *_: (starts[0], 0.0, False)
    shadow = brake('adaptive-optimal').summary
    assert brake(controller).summary['stop_distance_m'] == shadow['stop_distance_m']
    assert controller.failures == controller.solves > 1000


def test_the_benchmark_scores_its_objects():
    # The table's way: each case has an object of its own, in this process, that is asked for its counts afterwards.
    chosen = min(cases.whole_set(), key=lambda case: case.start_speed_rad_s)
    rows, made = nmpc_table.braked([chosen], bounds.stored(), nmpc.Tuning())
    assert [row['fault'] for row in rows] == [''] and -1e-3 < rows[0]['excess'] < 0.2
    assert len(made) == 1 and made[0].solves > 10
