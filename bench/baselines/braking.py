"""The braking of integration_bench.cpp with SciPy's solve_ivp. Prints "name ms error_rad_s" lines."""
import math
import time

import numpy
from scipy.integrate import solve_ivp


def f(_, x):
    r1, r2, J1, J2, d1, d2, M10, M20 = 0.0995, 0.0990, 7.54e-3, 25.60e-3, 118.74e-6, 214.68e-6, 0.0032, 0.0925
    slip = (r2 * x[1] - r1 * x[0]) / (r2 * x[1])
    force = 23.0 * math.sin(1.68 * math.atan(28.0 * slip))
    return [(r1 * force - d1 * x[0] - M10 - x[2]) / J1, (-r2 * force - d2 * x[1] - M20) / J2,
            20.37 * (15.24 * 0.55 - 6.21 - x[2])]


def solve(rtol, atol):
    start = time.perf_counter()
    ticks = numpy.arange(1, 2001) * 1e-3
    solution = solve_ivp(f, (0.0, 2.0), [170.0, 170.0, 0.0], t_eval=ticks, rtol=rtol, atol=atol, max_step=1e-3)
    return 1e3 * (time.perf_counter() - start), solution.y[0]


_, exact = solve(1e-12, 1e-12)
ms, omega1 = solve(1e-6, 1e-8)
print(f'scipy_rk45 {ms:.6g} {abs(omega1 - exact).max():.3g}')
