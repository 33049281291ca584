#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "abs_hil/control/paper_laws.hpp"
#include "control/braking_bench.hpp"

/// The paper's laws in continuous time: the lines of paper_laws.hpp and the plant (11), integrated together by RK4.
namespace bench {

namespace paper = control::paper;

struct ContinuousTick {
  double t{}, omega1{}, omega2{}, slip{}, torque{}, e_v{}, theta_est{};
  paper::AdaptiveState<double> x{};
};

enum class Law { nominal, adaptive };

/// Gains of (16)-(18) from the options, with PA + A'P = -2Q solved by hand.
inline paper::Gains<double> gains_of(const control::AdaptiveOptions& o) {
  const double p12 = o.q11 / o.ks0;
  return {.ks0 = o.ks0, .ks1 = o.ks1, .gamma = o.gamma, .ka1 = o.ka1, .p12 = p12, .p22 = (o.q22 + p12) / o.ks1};
}

/// Brakes from the start speeds of `s`, with an ideal actuator and true speeds, until `end_s`. The nominal law knows
/// theta. The adaptive one starts from zeta(0) and omega1_hat(0) = omega1(0), without freezing and projection.
inline std::vector<ContinuousTick> continuous(const Setup& s, Law law, double step_s, double end_s) {
  const paper::Gains<double> g = gains_of(s.options.adaptive);
  const auto& w = s.rig.wheels;
  const double theta = s.rig.tyre.theta_N;
  const paper::Laws<double> laws = paper::laws(w);

  using State = std::array<double, 5>;  // omega1, omega2, I, omega1_hat, zeta
  const auto tick_at = [&](double t, const State& y) {
    const double v_x = w.r2_m * y[1], slip = (v_x - w.r1_m * y[0]) / v_x;
    const paper::Reading<double> reading{.omega1 = y[0],
                                         .omega2 = y[1],
                                         .lambda_ref = s.options.slip_ref,
                                         .phi = std::sin(s.rig.tyre.C * std::atan(s.rig.tyre.B * slip))};
    const paper::AdaptiveState<double> x{.I = y[2], .omega1_hat = y[3], .zeta = y[4]};
    const bool adapts = law == Law::adaptive;
    const double torque =
        adapts ? laws.adaptive_T_b(g, reading, x) : laws.nominal_T_b(g, reading, x.I, s.rig.tyre.theta_N);
    const double theta_est = adapts ? laws.theta_hat(g, x, y[0]) : theta;
    const paper::AdaptiveState<double> dot = laws.adaptive_dot(g, reading, x, torque);
    const double force = theta * reading.phi;
    const State rate{(w.r1_m * force - (w.d1_Nms_rad * y[0] + w.M10_Nm + torque)) / w.J1_kg_m2,
                     (-w.r2_m * force - (w.d2_Nms_rad * y[1] + w.M20_Nm)) / w.J2_kg_m2, dot.I, dot.omega1_hat,
                     dot.zeta};
    const double error = e_v(w, y[0], y[1], s.options.slip_ref);
    return std::pair{ContinuousTick{t, y[0], y[1], slip, torque, error, theta_est, x}, rate};
  };
  const auto plus = [](const State& a, const State& b, double f) {
    State c{};
    for (std::size_t i = 0; i < c.size(); ++i) c[i] = a[i] + f * b[i];
    return c;
  };

  std::vector<ContinuousTick> ticks;
  State y{s.omega1_start, s.omega2_start, 0.0, s.omega1_start, s.options.adaptive.zeta0};
  const double h = step_s;
  for (int n = 0; n * h <= end_s + h / 2; ++n) {
    const auto [tick, k1] = tick_at(n * h, y);
    ticks.push_back(tick);
    const State k2 = tick_at(0, plus(y, k1, h / 2)).second, k3 = tick_at(0, plus(y, k2, h / 2)).second,
                k4 = tick_at(0, plus(y, k3, h)).second;
    for (std::size_t j = 0; j < y.size(); ++j) y[j] += h / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j]);
  }
  return ticks;
}

}  // namespace bench
