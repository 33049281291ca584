#pragma once

#include <cstddef>

#include "abs_hil/rig/scalar.hpp"

/// The bare plant by hand, as the limit of what lanes can reach: (1)-(7) with both wheels turning forwards and a
/// constant duty, without a road, standstill, encoders or a controller. RK4 with a fixed step. A source defines the
/// vectors and compiles this for one instruction set, with fused multiply-add. Only the polynomials' coefficients are
/// abs_hil's.
namespace bare_plant {

/// The numbers in which the plants differ.
struct Tyre {
  double theta_N;
  double B;
  double C;
};

/// Brakes `lanes` plants from `start_rad_s` for `steps` steps of `step_s`; writes the upper wheels' speeds.
using Brake = void (*)(const Tyre* tyres, double start_rad_s, double duty, int steps, double step_s, double* omega1);

struct Kernel {
  std::size_t lanes;
  Brake brake;  ///< null: this computer lacks the instructions
};
[[nodiscard]] Kernel avx2();
[[nodiscard]] Kernel avx512();

#ifdef BARE_PLANT_LANES
namespace {

constexpr int lanes = BARE_PLANT_LANES;  ///< of a vector
constexpr int vectors = 4;               ///< in flight: the operations of one wait for each other
using Vector [[gnu::vector_size(8 * lanes)]] = double;
using Mask [[gnu::vector_size(8 * lanes)]] = long;

template <std::size_t N>
[[gnu::always_inline]] inline Vector horner(const std::array<double, N>& c, Vector x) {
  Vector sum = Vector{} + c[N - 1];
  for (std::size_t i = N - 1; i-- > 0;) sum = sum * x + c[i];
  return sum;
}
[[gnu::always_inline]] inline Vector choose(Mask where, Vector a, Vector b) { return where ? a : b; }

/// sin(C atan(p/q)) for p, q > 0.
[[gnu::always_inline]] inline Vector shape(Vector C, Vector p, Vector q) {
  const Mask middle = p > q * 0.41421356237309503;
  const Mask steep = p > q * 2.414213562373095;
  const Vector t = choose(steep, -q, choose(middle, p - q, p)) / choose(steep, p, choose(middle, p + q, q));
  const Vector zero{};
  const Vector turned = choose(steep, zero + 0x1.921fb54442d18p+0, choose(middle, zero + 0x1.921fb54442d18p-1, zero));
  const Vector square = t * t;
  const Vector angle = C * (turned + (t + t * square * horner(abs_hil::rig::detail::arctangent, square)));
  const Vector x = choose(angle > 0x1.921fb54442d18p+0, 0x1.921fb54442d18p+1 - angle, angle);
  const Vector y = x * x;
  return x + x * y * horner(abs_hil::rig::detail::sine, y);
}

struct State {
  Vector omega1, omega2, brake;
};

void brake(const Tyre* tyres, double start_rad_s, double duty, int steps, double step_s, double* omega1) {
  constexpr double r1 = 0.0995, r2 = 0.0990, per_J1 = 1 / 7.54e-3, per_J2 = 1 / 25.60e-3, d1 = 118.74e-6;
  constexpr double d2 = 214.68e-6, M10 = 0.0032, M20 = 0.0925, b1 = 15.24, b2 = -6.21, c31 = 20.37;
  const double target = b1 * duty + b2;
  Vector theta[vectors], B[vectors], C[vectors];
  State x[vectors];
  for (int v = 0; v < vectors; ++v) {
    for (int i = 0; i < lanes; ++i) {
      theta[v][i] = tyres[v * lanes + i].theta_N;
      B[v][i] = tyres[v * lanes + i].B;
      C[v][i] = tyres[v * lanes + i].C;
    }
    x[v] = {Vector{} + start_rad_s, Vector{} + start_rad_s, Vector{}};
  }
  const auto rates = [&](int v, const State& s) __attribute__((always_inline)) {
    const Vector v_x = r2 * s.omega2;
    const Vector force = theta[v] * shape(C[v], B[v] * (v_x - r1 * s.omega1), v_x);
    return State{(r1 * force - d1 * s.omega1 - M10 - s.brake) * per_J1, (-r2 * force - d2 * s.omega2 - M20) * per_J2,
                 c31 * (target - s.brake)};
  };
  const auto moved = [](const State& s, double h, const State& k) __attribute__((always_inline)) {
    return State{s.omega1 + h * k.omega1, s.omega2 + h * k.omega2, s.brake + h * k.brake};
  };
  for (int step = 0; step < steps; ++step) {
    // Stage by stage, so that the vectors' operations stand beside each other.
    State k1[vectors], k2[vectors], k3[vectors];
    for (int v = 0; v < vectors; ++v) k1[v] = rates(v, x[v]);
    for (int v = 0; v < vectors; ++v) k2[v] = rates(v, moved(x[v], 0.5 * step_s, k1[v]));
    for (int v = 0; v < vectors; ++v) k3[v] = rates(v, moved(x[v], 0.5 * step_s, k2[v]));
    for (int v = 0; v < vectors; ++v) {
      const State k4 = rates(v, moved(x[v], step_s, k3[v]));
      const State sum{k1[v].omega1 + k4.omega1 + 2.0 * (k2[v].omega1 + k3[v].omega1),
                      k1[v].omega2 + k4.omega2 + 2.0 * (k2[v].omega2 + k3[v].omega2),
                      k1[v].brake + k4.brake + 2.0 * (k2[v].brake + k3[v].brake)};
      x[v] = moved(x[v], step_s / 6.0, sum);
    }
  }
  for (int i = 0; i < vectors * lanes; ++i) omega1[i] = x[i / lanes].omega1[i % lanes];
}

}  // namespace
#endif

}  // namespace bare_plant
