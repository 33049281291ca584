"""The braking of bare_plant.hpp for many tyres, one core: 2 s from 170 rad/s in RK4 steps of 500 µs, in NumPy over all
runs at once and, if it is installed, in a loop that numba compiles; and SciPy's solve_ivp run by run. Prints
"name runs_per_s omega1" lines: runs a second of CPU time, and the upper wheel's last speed with the first tyre.
"""
import math
import time

import numpy
from scipy.integrate import solve_ivp

R1, R2, J1, J2, D1, D2 = 0.0995, 0.0990, 7.54e-3, 25.60e-3, 118.74e-6, 214.68e-6
M10, M20, C31, TARGET_NM, START_RAD_S = 0.0032, 0.0925, 20.37, 15.24 * 0.55 - 6.21, 170.0
STEP_S, STEPS = 5e-4, 4000


def tyres(count):
    """theta, B, C of the runs, each from 0.9 to 1.1 of the paper's; the first has the paper's."""
    spread = numpy.linspace(0.9, 1.1, count)
    spread[0] = 1.0
    return 23.0 * spread, 28.0 * spread, numpy.full(count, 1.68)


def rates(w1, w2, brake, theta, B, C, sin, atan):
    force = theta * sin(C * atan(B * (R2 * w2 - R1 * w1) / (R2 * w2)))
    return (R1 * force - D1 * w1 - M10 - brake) / J1, (-R2 * force - D2 * w2 - M20) / J2, C31 * (TARGET_NM - brake)


def stepped(state, h, k):
    return tuple(x + h * rate for x, rate in zip(state, k))


def numpy_rk4(theta, B, C):
    def f(state):
        return rates(*state, theta, B, C, numpy.sin, numpy.arctan)

    x = (numpy.full(theta.size, START_RAD_S), numpy.full(theta.size, START_RAD_S), numpy.zeros(theta.size))
    for _ in range(STEPS):
        k1 = f(x)
        k2 = f(stepped(x, 0.5 * STEP_S, k1))
        k3 = f(stepped(x, 0.5 * STEP_S, k2))
        k4 = f(stepped(x, STEP_S, k3))
        x = tuple(a + STEP_S / 6 * (r1 + 2 * r2 + 2 * r3 + r4) for a, r1, r2, r3, r4 in zip(x, k1, k2, k3, k4))
    return x[0]


def scipy_rk45(theta, B, C):
    def f(_, x, *tyre):
        return rates(*x, *tyre, math.sin, math.atan)

    return numpy.array([solve_ivp(f, (0.0, STEP_S * STEPS), [START_RAD_S, START_RAD_S, 0.0], args=tyre, rtol=1e-6,
                                  atol=1e-8, max_step=1e-3).y[0, -1] for tyre in zip(theta, B, C)])


def numba_rk4():
    import numba

    @numba.njit
    def rates_of(w1, w2, brake, theta, B, C):
        force = theta * math.sin(C * math.atan(B * (R2 * w2 - R1 * w1) / (R2 * w2)))
        return (R1 * force - D1 * w1 - M10 - brake) / J1, (-R2 * force - D2 * w2 - M20) / J2, C31 * (TARGET_NM - brake)

    @numba.njit
    def all_runs(theta, B, C):
        ends = numpy.empty(theta.size)
        h = STEP_S
        for i in range(theta.size):
            t, stiff, c = theta[i], B[i], C[i]
            w1, w2, b = START_RAD_S, START_RAD_S, 0.0
            for _ in range(STEPS):
                a1, a2, a3 = rates_of(w1, w2, b, t, stiff, c)
                b1, b2, b3 = rates_of(w1 + 0.5 * h * a1, w2 + 0.5 * h * a2, b + 0.5 * h * a3, t, stiff, c)
                c1, c2, c3 = rates_of(w1 + 0.5 * h * b1, w2 + 0.5 * h * b2, b + 0.5 * h * b3, t, stiff, c)
                d1, d2, d3 = rates_of(w1 + h * c1, w2 + h * c2, b + h * c3, t, stiff, c)
                w1 += h / 6 * (a1 + 2 * b1 + 2 * c1 + d1)
                w2 += h / 6 * (a2 + 2 * b2 + 2 * c2 + d2)
                b += h / 6 * (a3 + 2 * b3 + 2 * c3 + d3)
            ends[i] = w1
        return ends

    return all_runs


def measure(name, runs, count):
    given = tyres(count)
    start = time.process_time()
    ends = runs(*given)
    print(f'{name} {count / (time.process_time() - start):.6g} {ends[0]:.9g}', flush=True)


def main():
    measure('scipy', scipy_rk45, 5)
    measure('numpy', numpy_rk4, 2000)
    try:
        compiled = numba_rk4()
        compiled(*tyres(2))
    except ImportError:
        return
    measure('numba', compiled, 500)


if __name__ == '__main__':
    main()
