% The braking of integration_bench.cpp in Octave: a plain RK4 loop, and ode45. Prints "name ms error_rad_s" lines.
1;
function dx = f(~, x)
  r1 = 0.0995; r2 = 0.0990; J1 = 7.54e-3; J2 = 25.60e-3; d1 = 118.74e-6; d2 = 214.68e-6; M10 = 0.0032; M20 = 0.0925;
  slip = (r2 * x(2) - r1 * x(1)) / (r2 * x(2));
  force = 23 * sin(1.68 * atan(28 * slip));
  dx = [(r1 * force - d1 * x(1) - M10 - x(3)) / J1
        (-r2 * force - d2 * x(2) - M20) / J2
        20.37 * (15.24 * 0.55 - 6.21 - x(3))];
end
function omega1 = rk4(steps)
  x = [170; 170; 0]; h = 1e-3 / steps; omega1 = zeros(2000, 1);
  for tick = 1:2000
    for i = 1:steps
      k1 = f(0, x); k2 = f(0, x + h / 2 * k1); k3 = f(0, x + h / 2 * k2); k4 = f(0, x + h * k3);
      x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    end
    omega1(tick) = x(1);
  end
end
exact = rk4(10);
tic; omega1 = rk4(2); ms = 1e3 * toc;
printf("octave_rk4/2 %.6g %.3g\n", ms, max(abs(omega1 - exact)));
tic; [~, x] = ode45(@f, (0:2000) * 1e-3, [170; 170; 0], odeset("RelTol", 1e-6, "AbsTol", 1e-8)); ms = 1e3 * toc;
printf("octave_ode45 %.6g %.3g\n", ms, max(abs(x(2:end, 1) - exact)));
