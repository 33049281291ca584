// The theorems on random rigs: 3.1 with every physical parameter drawn, 3.2, and the one of docs/theory-beyond.md on
// the brake's lag. RapidCheck prints parameters and seed of a counterexample; RC_PARAMS="seed=..." repeats it.

#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "catch.hpp"
#include "control/braking_bench.hpp"
#include "control/continuous_loop.hpp"
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
      : p11{o.ks1 * o.q11 / o.ks0 + o.ks0 * (o.q22 + o.q11 / o.ks0) / o.ks1},
        p12{o.q11 / o.ks0},
        p22{(o.q22 + o.q11 / o.ks0) / o.ks1} {}
  /// Least eigenvalue of inverse(P) Q: the largest c with x'Qx >= c x'Px.
  [[nodiscard]] double slowest(const control::AdaptiveOptions& o) const {
    const double det_P = p11 * p22 - p12 * p12;
    const double trace = (p22 * o.q11 + p11 * o.q22) / det_P;
    const double det = (o.q11 * o.q22) / det_P;
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
constexpr double euler_error = 2 * sampling_error;
constexpr double force_observer_start_s = 0.003;  ///< it starts without a force

/// (17)-(18) as paper_laws.hpp has them, in explicit Euler steps, with any gains: what the theorems do not hold for is
/// refused by AdaptiveLaw, or cannot be told to it.
class EulerLaw final : public control::SlipController {
 public:
  EulerLaw(const bench::Setup& s, const control::paper::Gains<double>& gains)
      : laws_{control::paper::laws(s.rig.wheels)}, tyre_{s.rig.tyre}, gains_{gains}, zeta0_{s.options.adaptive.zeta0} {}

  void reset(const control::SlipInput& input) noexcept override {
    state_ = {.I = 0.0, .omega1_hat = input.speeds.omega1_rad_s, .zeta = zeta0_};
  }
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& input) noexcept override {
    if (input.dt_s > 0.0) {
      const auto dot = laws_.adaptive_dot(gains_, reading_, state_, torque_Nm_);
      state_.I += input.dt_s * dot.I;
      state_.omega1_hat += input.dt_s * dot.omega1_hat;
      state_.zeta += input.dt_s * dot.zeta;
    }
    reading_ = {.omega1 = input.speeds.omega1_rad_s,
                .omega2 = input.speeds.omega2_rad_s,
                .lambda_ref = input.slip_ref,
                .phi = rig::normalised_tyre_force(tyre_, input.slip)};
    torque_Nm_ = laws_.adaptive_T_b(gains_, reading_, state_);
    return {.brake_torque_Nm = torque_Nm_, .theta_est_N = laws_.theta_hat(gains_, state_, reading_.omega1)};
  }

 private:
  control::paper::Laws<double> laws_;
  rig::TyreParameters tyre_;
  control::paper::Gains<double> gains_;
  double zeta0_;
  control::paper::AdaptiveState<double> state_{};
  control::paper::Reading<double> reading_{};
  double torque_Nm_{0.0};
};

/// The laws that the theorems are held against: the controller, the printed law as it is, and with planted defects.
enum class Law { controller, right, printed_sign, tenth, frozen };

bench::Result brake(const bench::Setup& s, Law law) {
  if (law == Law::controller) return bench::brake(s, "adaptive");
  auto gains = bench::gains_of(s.options.adaptive);
  if (law == Law::printed_sign) gains.ka1 = -gains.ka1;
  if (law == Law::tenth) gains.ka1 /= 10.0;
  if (law == Law::frozen) gains.ka1 = gains.p12 = gains.p22 = 0.0;
  EulerLaw controller(s, gains);
  return bench::brake(s, controller);
}

/// Theorem 3.1, or with `lag` its third step (docs/theory-beyond.md), evaluated from the plant's true state.
Trace trace_of(const bench::Setup& s, const bench::Result& run, bool lag) {
  const auto& o = lag ? s.options.adaptive_actuator.law : s.options.adaptive;
  const auto& w = s.rig.wheels;
  const Quadratic quadratic{o};
  const double k = w.r1_m * w.r1_m / w.J1_kg_m2 + (1 - s.options.slip_ref) * w.r2_m * w.r2_m / w.J2_kg_m2;
  Trace trace;
  double I = 0.0, before = 0.0;
  for (const auto& tick : run.ticks) {
    trace.within_limits = trace.within_limits && tick.output.brake_torque_Nm >= 0.0;
    const double e = bench::e_v(w, tick.omega1, tick.omega2, s.options.slip_ref);
    if (tick.t > 0) I += (before + e) / 2 / s.options.rate_Hz;
    before = e;
    const double error = s.rig.tyre.theta_N - tick.output.theta_est_N, phi = phi_at(s, tick.slip);
    double V = quadratic(I, e) + error * error / o.gamma;
    double promised = -(o.q11 * I * I + o.q22 * e * e) - o.ka1 * phi * error * error;
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
    const Trace trace = trace_of(s, brake(s, Law::controller), false);
    RC_PRE(trace.V.size() > 1000 && trace.within_limits);
    RC_ASSERT(trace.never_grows(1e-6));
    RC_ASSERT(trace.worst_derivative_error(s.options.rate_Hz) < sampling_error);
  }));
}

TEST_CASE("The test of Theorem 3.1 finds the printed sign of (18), a tenth of gamma ka1, and a frozen estimate") {
  int rigs = 0, printed_sign = 0, tenth = 0, frozen = 0;
  CHECK(rc::check([&] {
    auto s = any_rig();
    s.options.adaptive.zeta0 = s.rig.tyre.theta_N * between(0.5, 1.3);
    const auto trace = [&s](Law law) { return trace_of(s, brake(s, law), false); };
    const auto found = [&](Law law) {
      const Trace defect = trace(law);
      return !defect.never_grows(1e-6) || defect.worst_derivative_error(s.options.rate_Hz) > euler_error;
    };
    const Trace right = trace(Law::right);
    RC_PRE(right.V.size() > 1000 && right.within_limits);
    RC_ASSERT(right.worst_derivative_error(s.options.rate_Hz) < euler_error);
    ++rigs;
    printed_sign += found(Law::printed_sign);
    tenth += found(Law::tenth);
    frozen += found(Law::frozen);
  }));
  CAPTURE(rigs, printed_sign, tenth, frozen);
  CHECK(std::min({printed_sign, tenth, frozen}) >= 0.9 * rigs);  // on the others the estimate starts right
}

TEST_CASE(
    "Theorem 3.2 holds on any rig: from outside the errors enter the ball of the proof, with planted defects not") {
  CHECK(rc::check([] {
    auto s = any_rig();
    s.max_time_s = 0.5;
    s.omega2_start = between(150.0, 180.0);
    s.omega1_start = s.omega2_start * s.rig.wheels.r2_m / s.rig.wheels.r1_m * (1.0 - s.options.slip_ref);
    auto& o = s.options.adaptive;
    o.gamma = between(20.0, 50.0);
    o.ka1 = between(20.0, 48.0) / o.gamma;  // fast enough to enter the ball before the run ends
    // The speeds' errors decay faster than the estimate's, so that gamma ka1 phi decides on the theorem's bound.
    o.ks1 = between(200.0, 300.0);
    o.ks0 = 0.2 * o.ks1 * o.ks1;
    o.q11 = o.ks0;
    o.q22 = 1.0;
    const double theta0_N = s.rig.tyre.theta_N, period_s = between(0.05, 0.2);
    const double phi_min = 0.5 * phi_at(s, s.options.slip_ref);
    const double a = std::min(Quadratic{o}.slowest(o), o.gamma * o.ka1 * phi_min);
    const double drift_N_s = 0.05 * theta0_N * a;  // a ball of 5 % of theta, and a start 1.5 times as far out
    const double amplitude_N = drift_N_s * period_s / (2 * std::numbers::pi);
    s.theta_at = [=](double t) { return theta0_N + amplitude_N * std::sin(2 * std::numbers::pi * t / period_s); };
    o.zeta0 = theta0_N - 1.5 * drift_N_s / a;
    const double ball = drift_N_s / (a * std::sqrt(2 * o.gamma));  // of W = sqrt(V)

    struct Run {
      bool above_phi_min{true}, within_bound{true}, enters{false};
    };
    const auto judged = [&](const bench::Result& braking) {
      Run result;
      double I = 0.0, before = 0.0, start = 0.0;
      for (const auto& tick : braking.ticks) {
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
    const Run adaptive = judged(brake(s, Law::controller)), right = judged(brake(s, Law::right));
    RC_PRE(adaptive.above_phi_min && right.above_phi_min);
    RC_ASSERT(a < Quadratic{o}.slowest(o));
    RC_ASSERT(adaptive.within_bound && adaptive.enters && right.within_bound && right.enters);
    for (const Law defect : {Law::frozen, Law::printed_sign, Law::tenth}) {
      RC_ASSERT(!judged(brake(s, defect)).within_bound);
    }
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
    const Trace trace = trace_of(s, bench::brake(s, "adaptive-actuator"), true);
    RC_PRE(trace.V.size() > 1000 && trace.within_limits);
    RC_ASSERT(trace.never_grows(1e-6));
    RC_ASSERT(trace.worst_derivative_error(s.options.rate_Hz) <
              5 * sampling_error);  // the lag's gain is five times ks1
  }));
}
