// The theorems on random rigs: 3.1 with every physical parameter drawn, 3.2, and the one of docs/theory-beyond.md on
// the brake's lag. RapidCheck prints parameters and seed of a counterexample; RC_PARAMS="seed=..." repeats it.

#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "catch.hpp"
#include "control/braking_bench.hpp"
#include "control/drawn_gains.hpp"

using namespace abs_hil;

namespace {

double between(double least, double most) {
  constexpr int steps = 10'000;
  return least + (most - least) * *rc::gen::inRange(0, steps + 1) / steps;
}

/// Any rig of this kind, and any gains that suit it, with the wheel on the rising or falling side of the tyre curve.
bench::Setup any_rig() {
  bench::Setup s;
  auto& w = s.rig.wheels;
  w.r1_m = between(0.08, 0.12);
  w.r2_m = between(0.08, 0.12);
  w.J1_kg_m2 = between(5e-3, 12e-3);
  w.J2_kg_m2 = between(15e-3, 40e-3);
  w.d1_Nms_rad = between(0.0, 5e-4);
  w.d2_Nms_rad = between(0.0, 5e-4);
  w.M10_Nm = between(0.0, 0.05);
  w.M20_Nm = between(0.0, 0.2);
  s.rig.tyre = {.theta_N = between(10.0, 60.0), .B = between(10.0, 40.0), .C = between(1.2, 1.9)};
  s.options.slip_ref = between(0.03, 0.3);
  bench::draw_gains(s.options.adaptive, between);
  s.omega2_start = between(100.0, 180.0);
  s.omega1_start = s.omega2_start * w.r2_m / w.r1_m * (1.0 - s.options.slip_ref * between(0.7, 1.3));
  s.options.rate_Hz = 10'000.0;
  s.plant_step_s = 1e-4;
  s.max_time_s = 0.3;
  return s;
}

/// x'Px of [I; e_v] with P A + A'P = -2Q solved by hand.
struct Quadratic {
  double p11, p12, p22;
  explicit Quadratic(const control::AdaptiveOptions& o)
      : p11{o.ks1 * o.q11 / o.ks0 + o.ks0 * (o.q22 + o.q11 / o.ks0) / o.ks1 - 2 * o.q12},
        p12{o.q11 / o.ks0},
        p22{(o.q22 + o.q11 / o.ks0) / o.ks1} {}
  /// Least eigenvalue of inverse(P) Q: the largest c with x'Qx >= c x'Px.
  [[nodiscard]] double slowest(const control::AdaptiveOptions& o) const {
    const double det_P = p11 * p22 - p12 * p12;
    const double trace = (p22 * o.q11 - 2 * p12 * o.q12 + p11 * o.q22) / det_P;
    const double det = (o.q11 * o.q22 - o.q12 * o.q12) / det_P;
    return (trace - std::sqrt(trace * trace - 4 * det)) / 2;
  }
  [[nodiscard]] double operator()(double I, double e) const { return p11 * I * I + 2 * p12 * I * e + p22 * e * e; }
};

double phi_at(const bench::Setup& s, double slip) { return std::sin(s.rig.tyre.C * std::atan(s.rig.tyre.B * slip)); }

/// V and the derivative that a theorem promises, over a run.
struct Trace {
  std::vector<double> V, promised;
  bool within_limits{true};
  [[nodiscard]] double largest(const std::vector<double>& values) const {
    double most = 0.0;
    for (const double value : values) most = std::max(most, std::abs(value));
    return most;
  }
  [[nodiscard]] bool never_grows(double part) const {
    for (std::size_t n = 1; n < V.size(); ++n) {
      if (V[n] > V[n - 1] + part * V.front()) return false;
    }
    return true;
  }
  [[nodiscard]] double worst_derivative_error(double rate_Hz) const {
    double worst = 0.0;
    for (std::size_t n = 1; n + 1 < V.size(); ++n) {
      worst = std::max(worst, std::abs((V[n + 1] - V[n - 1]) / 2 * rate_Hz - promised[n]));
    }
    return worst / largest(promised);
  }
};

/// The torque is held for 100 us while what it should follow moves at up to some 100 1/s.
constexpr double sampling_error = 0.02;
constexpr double force_observer_start_s = 0.003;  ///< it starts without a force

/// Theorem 3.1, or with `lag` its third step (docs/theory-beyond.md), evaluated from the plant's true state.
Trace trace_of(const bench::Setup& s, bool lag) {
  const auto& o = lag ? s.options.adaptive_actuator.law : s.options.adaptive;
  const auto& w = s.rig.wheels;
  const Quadratic quadratic{o};
  const double k = w.r1_m * w.r1_m / w.J1_kg_m2 + (1 - s.options.slip_ref) * w.r2_m * w.r2_m / w.J2_kg_m2;
  Trace trace;
  double I = 0.0, before = 0.0;
  for (const auto& tick : bench::brake(s, lag ? "adaptive-actuator" : "adaptive").ticks) {
    trace.within_limits = trace.within_limits && tick.output.brake_torque_Nm >= 0.0;
    const double e = bench::e_v(w, tick.omega1, tick.omega2, s.options.slip_ref);
    if (tick.t > 0) I += (before + e) / 2 / s.options.rate_Hz;
    before = e;
    const double error = s.rig.tyre.theta_N - tick.output.theta_est_N, phi = phi_at(s, tick.slip);
    double V = quadratic(I, e) + error * error / o.gamma;
    double promised = -(o.q11 * I * I + 2 * o.q12 * I * e + o.q22 * e * e) - o.ka1 * phi * error * error;
    if (lag) {
      const double drift = -w.r1_m / w.J1_kg_m2 * (w.d1_Nms_rad * tick.omega1 + w.M10_Nm) +
                           (1 - s.options.slip_ref) * w.r2_m / w.J2_kg_m2 * (w.d2_Nms_rad * tick.omega2 + w.M20_Nm);
      const double wanted = -o.ks0 * I - o.ks1 * e + k * tick.output.theta_est_N * phi + drift;  // (17)
      const double eta = w.r1_m / w.J1_kg_m2 * tick.torque - wanted;
      const auto& a = s.options.adaptive_actuator;
      V += a.lag_weight_s2 * eta * eta;
      promised -= a.lag_weight_s2 * a.lag_gain_per_s * eta * eta;
    }
    if (lag && tick.t < force_observer_start_s) continue;
    trace.V.push_back(V / 2);
    trace.promised.push_back(promised);
  }
  return trace;
}

}  // namespace

TEST_CASE("Theorem 3.1 holds on any rig: V never grows, V' = -x'Qx - ka1 phi theta~^2") {
  CHECK(rc::check([] {
    auto s = any_rig();
    s.options.adaptive.zeta0 = s.rig.tyre.theta_N * between(0.5, 1.3);
    const Trace trace = trace_of(s, false);
    RC_PRE(trace.V.size() > 1000 && trace.within_limits);
    RC_ASSERT(trace.never_grows(1e-6));
    RC_ASSERT(trace.worst_derivative_error(s.options.rate_Hz) < sampling_error);
  }));
}

TEST_CASE(
    "Theorem 3.2 holds on any rig: from outside the errors enter the ball of the proof, a frozen estimate does not") {
  CHECK(rc::check([] {
    auto s = any_rig();
    s.max_time_s = 0.5;
    s.omega2_start = between(150.0, 180.0);
    s.omega1_start = s.omega2_start * s.rig.wheels.r2_m / s.rig.wheels.r1_m * (1.0 - s.options.slip_ref);
    auto& o = s.options.adaptive;
    o.gamma = between(20.0, 50.0);  // fast enough to enter the ball before the run ends
    o.ka1 = between(1.0, 3.0);
    const double theta0_N = s.rig.tyre.theta_N, period_s = between(0.05, 0.2);
    const double phi_min = 0.5 * phi_at(s, s.options.slip_ref);
    const double a = std::min(Quadratic{o}.slowest(o), o.gamma * o.ka1 * phi_min);
    const double drift_N_s = 0.05 * theta0_N * a;  // a ball of 5 % of theta, and a start 1.5 times as far out
    const double amplitude_N = drift_N_s * period_s / (2 * std::numbers::pi);
    s.theta_at = [=](double t) { return theta0_N + amplitude_N * std::sin(2 * std::numbers::pi * t / period_s); };
    o.zeta0 = theta0_N - 1.5 * drift_N_s / a;
    s.options.nominal.theta0_N = o.zeta0;                          // (16) is (17) with theta_hat frozen at its start
    const double ball = drift_N_s / (a * std::sqrt(2 * o.gamma));  // of W = sqrt(V)

    struct Run {
      bool above_phi_min{true}, within_bound{true}, enters{false};
    };
    const auto run = [&](const char* controller) {
      Run result;
      double I = 0.0, before = 0.0, start = 0.0;
      for (const auto& tick : bench::brake(s, controller).ticks) {
        const double e = bench::e_v(s.rig.wheels, tick.omega1, tick.omega2, s.options.slip_ref);
        if (tick.t > 0) I += (before + e) / 2 / s.options.rate_Hz;
        before = e;
        const double error = s.theta_at(tick.t) - tick.output.theta_est_N;
        const double W = std::sqrt((Quadratic{o}(I, e) + error * error / o.gamma) / 2);
        if (tick.t == 0.0) start = W;
        const double kept = std::exp(-a * tick.t);
        result.above_phi_min = result.above_phi_min && phi_at(s, tick.slip) >= phi_min;
        result.within_bound = result.within_bound && W <= 1.001 * (kept * start + (1 - kept) * ball);
        result.enters = result.enters || W < ball;
      }
      return result;
    };
    const Run adaptive = run("adaptive"), frozen = run("nominal");
    RC_PRE(adaptive.above_phi_min);
    RC_ASSERT(adaptive.within_bound && adaptive.enters);
    RC_ASSERT(!frozen.within_bound && !frozen.enters);
  }));
}

TEST_CASE("Theorem 3.2 on any rig: the ball that the errors stay in scales with the drift of theta") {
  CHECK(rc::check([] {
    auto s = any_rig();
    s.options.adaptive.zeta0 = s.rig.tyre.theta_N;
    s.omega1_start = s.omega2_start * s.rig.wheels.r2_m / s.rig.wheels.r1_m * (1.0 - s.options.slip_ref);
    const double period_s = between(0.05, 0.2), theta0_N = s.rig.tyre.theta_N;
    const auto ball = [&](double drift_N_s) {
      const double amplitude_N = drift_N_s * period_s / (2 * std::numbers::pi);  // |theta'| <= drift_N_s
      s.theta_at = [=](double t) { return theta0_N + amplitude_N * std::sin(2 * std::numbers::pi * t / period_s); };
      struct {
        double error_m_s{0.0}, theta_N{0.0};
      } radius;
      for (const auto& tick : bench::brake(s, "adaptive").ticks) {
        if (tick.t < 0.15) continue;
        radius.error_m_s = std::max(radius.error_m_s,
                                    std::abs(bench::e_v(s.rig.wheels, tick.omega1, tick.omega2, s.options.slip_ref)));
        radius.theta_N = std::max(radius.theta_N, std::abs(s.theta_at(tick.t) - tick.output.theta_est_N));
      }
      return radius;
    };
    const auto slow = ball(10.0), fast = ball(40.0), still = ball(0.0);
    RC_ASSERT(still.error_m_s < 0.05 * slow.error_m_s);
    RC_ASSERT(std::abs(fast.error_m_s / slow.error_m_s / 4.0 - 1.0) < 0.15);
    RC_ASSERT(std::abs(fast.theta_N / slow.theta_N / 4.0 - 1.0) < 0.15);
  }));
}

TEST_CASE("Three steps, any rig: V with the lag's error never grows, and V' is what the proof says") {
  CHECK(rc::check([] {
    auto s = any_rig();
    s.ideal_actuator = false;
    // A brake without limits, so strong that 9 N m are a small part of its range, and any lag.
    s.rig.brake = {.b1_Nm = 2000.0, .b2_Nm = 0.0, .u0 = 0.0, .c31_per_s = between(10.0, 60.0)};
    s.options.adaptive_actuator.law = s.options.adaptive;
    auto& a = s.options.adaptive_actuator;
    a.law.zeta0 = s.rig.tyre.theta_N * between(0.8, 1.2);
    a.lag_gain_per_s = between(50.0, 200.0);
    a.lag_weight_s2 = between(5e-5, 5e-4);
    a.observer = {.force_rate_N2_s = 1e12, .brake_rate_Nm2_s = 1e-9};  // sensors are exact here
    const Trace trace = trace_of(s, true);
    RC_PRE(trace.V.size() > 1000 && trace.within_limits);
    RC_ASSERT(trace.never_grows(1e-6));
    RC_ASSERT(trace.worst_derivative_error(s.options.rate_Hz) <
              5 * sampling_error);  // the lag's gain is five times ks1
  }));
}
