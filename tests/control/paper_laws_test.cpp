// The laws as the paper prints them, in continuous time: their closed forms, the corrected sign of (18), and the limit
// of the sampled-data controllers.

#include "abs_hil/control/paper_laws.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "catch.hpp"
#include "control/continuous_loop.hpp"
#include "control/drawn_gains.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
namespace paper = control::paper;

namespace {

bench::Setup setup_at_slip(double slip) {
  bench::Setup s;
  s.omega1_start = s.omega2_start * s.rig.wheels.r2_m / s.rig.wheels.r1_m * (1.0 - slip);
  s.options.adaptive.theta_min_N = -1e6;
  s.options.adaptive.theta_max_N = 1e6;
  s.plant_step_s = 1e-5;
  return s;
}

/// Largest distances of the sampled-data controller from the continuous law over the first second.
struct Gap {
  double error_m_s{0.0}, theta_N{0.0};
};

Gap gap(bench::Law law, double rate_Hz) {
  constexpr double step_s = 2e-5, end_s = 1.0;
  auto s = setup_at_slip(0.05);
  s.options.adaptive.zeta0 = 18.0;
  s.options.rate_Hz = rate_Hz;
  s.max_time_s = end_s;
  const auto exact = bench::continuous(s, law, step_s, end_s);
  Gap worst;
  for (const auto& tick : bench::brake(s, law == bench::Law::nominal ? "nominal" : "adaptive").ticks) {
    const auto n = static_cast<std::size_t>(std::lround(tick.t / step_s));
    if (n >= exact.size()) break;
    worst.error_m_s = std::max(worst.error_m_s, std::abs(tick.output.slip_velocity_error_m_s - exact[n].e_v));
    worst.theta_N = std::max(worst.theta_N, std::abs(tick.output.theta_est_N - exact[n].theta_est));
  }
  return worst;
}

/// A scalar type of two rigs, with no more than the operators that the laws ask for.
struct Pair {
  std::array<double, 2> lanes;
  explicit(false) Pair(double both) : lanes{both, both} {}
  Pair(double first, double second) : lanes{first, second} {}
  friend Pair operator+(Pair a, Pair b) { return {a.lanes[0] + b.lanes[0], a.lanes[1] + b.lanes[1]}; }
  friend Pair operator-(Pair a, Pair b) { return {a.lanes[0] - b.lanes[0], a.lanes[1] - b.lanes[1]}; }
  friend Pair operator*(Pair a, Pair b) { return {a.lanes[0] * b.lanes[0], a.lanes[1] * b.lanes[1]}; }
  friend Pair operator/(Pair a, Pair b) { return {a.lanes[0] / b.lanes[0], a.lanes[1] / b.lanes[1]}; }
  friend Pair operator-(Pair a) { return {-a.lanes[0], -a.lanes[1]}; }
};

}  // namespace

TEST_CASE("The nominal law leaves e_v'' + ks1 e_v' + ks0 e_v = 0") {
  const auto s = setup_at_slip(0.0);
  const auto run = bench::continuous(s, bench::Law::nominal, 2e-5, 1.0);
  for (const auto& tick : run) {
    const auto wanted = bench::closed_form(0.0, run.front().e_v, 19.0, 32.0, tick.t);
    REQUIRE_THAT(tick.x.I, WithinAbs(wanted[0], 1e-7));
    REQUIRE_THAT(tick.e_v, WithinAbs(wanted[1], 1e-6));
  }
}

TEST_CASE("e_v' of (14) equals that of the wheels of (11), with any torque") {
  std::mt19937 random{7};
  std::uniform_real_distribution<double> unit{0.0, 1.0};
  for (int i = 0; i < 100; ++i) {
    const rig::WheelParameters w{.d1_Nms_rad = 0.01 * unit(random), .M10_Nm = unit(random), .M20_Nm = unit(random)};
    const paper::Reading<double> y{
        .omega1 = 200 * unit(random), .omega2 = 200 * unit(random), .lambda_ref = unit(random), .phi = unit(random)};
    const double theta = 60 * unit(random), torque = 9 * unit(random);
    const double omega1_dot = (w.r1_m * theta * y.phi - (w.d1_Nms_rad * y.omega1 + w.M10_Nm + torque)) / w.J1_kg_m2;
    const double omega2_dot = (-w.r2_m * theta * y.phi - (w.d2_Nms_rad * y.omega2 + w.M20_Nm)) / w.J2_kg_m2;
    const auto laws = paper::laws(w);
    const double first_line = laws.e_v_dot(y.lambda_ref, w.r2_m * omega2_dot, w.r1_m * omega1_dot);
    CHECK_THAT(laws.e_v_dot(y, theta, torque), WithinAbs(first_line, 1e-9));
    CHECK_THAT(first_line, WithinAbs(bench::e_v(w, omega1_dot, omega2_dot, y.lambda_ref), 1e-9));
    // xi_1 is made so that e_v' becomes nu.
    CHECK_THAT(laws.e_v_dot(y, theta, laws.T_b(laws.xi_1(y, -3.0, theta))), WithinAbs(-3.0, 1e-9));
  }
}

TEST_CASE("The adaptive law: V never grows and its derivative is -x'Qx - ka1 phi theta~^2") {
  std::mt19937 random{99};
  const auto between = [&random](double low, double high) {
    return std::uniform_real_distribution<double>{low, high}(random);
  };
  for (int i = 0; i < 10; ++i) {
    CAPTURE(i);
    auto s = setup_at_slip(between(0.02, 0.2));
    s.rig.tyre.theta_N = between(15.0, 50.0);
    bench::draw_gains(s.options.adaptive, between);
    s.options.adaptive.zeta0 = between(0.5, 1.4) * s.rig.tyre.theta_N;
    const auto& o = s.options.adaptive;
    const auto g = bench::gains_of(o);
    const double p11 = o.ks1 * g.p12 + o.ks0 * g.p22, step_s = 2e-5;
    const auto run = bench::continuous(s, bench::Law::adaptive, step_s, 0.3);
    const auto V = [&](const bench::ContinuousTick& t) {
      const double I = t.x.I, e = t.e_v, error = s.rig.tyre.theta_N - t.theta_est;
      return (p11 * I * I + 2 * g.p12 * I * e + g.p22 * e * e + error * error / o.gamma) / 2;
    };
    for (std::size_t n = 1; n + 1 < run.size(); ++n) {
      const double I = run[n].x.I, e = run[n].e_v, error = s.rig.tyre.theta_N - run[n].theta_est;
      const double phi = std::sin(s.rig.tyre.C * std::atan(s.rig.tyre.B * run[n].slip));
      const double promised = -(o.q11 * I * I + o.q22 * e * e) - o.ka1 * phi * error * error;
      REQUIRE(V(run[n + 1]) <= V(run[n]));
      REQUIRE_THAT((V(run[n + 1]) - V(run[n - 1])) / (2 * step_s), WithinAbs(promised, 1e-3 * V(run[0])));
    }
  }
}

TEST_CASE("In closed loop the plus sign of (18) converges and the printed minus diverges") {
  // The printed minus before gamma ka1 is the same line with ka1 negative.
  const auto theta_error_N = [](double ka1, double at_s) {
    auto s = setup_at_slip(0.0);
    s.options.adaptive.ka1 = ka1;
    s.options.adaptive.zeta0 = 0.98 * s.rig.tyre.theta_N;
    return std::abs(s.rig.tyre.theta_N - bench::continuous(s, bench::Law::adaptive, 2e-5, at_s).back().theta_est);
  };
  const double at_start = 0.02 * 23.0;
  CHECK(theta_error_N(1.0, 0.4) < 0.1 * at_start);
  CHECK(theta_error_N(-1.0, 0.2) > 3.0 * theta_error_N(-1.0, 0.1));
  CHECK(theta_error_N(-1.0, 0.4) > 20.0 * at_start);
}

TEST_CASE("The sampled-data controllers tend to the continuous laws: nominal with h^2, adaptive with h") {
  // phi and delta are taken at the middle of the period, which leaves h^2. The adaptive law holds theta_hat of the
  // period's start: on average it is h/2 late, which leaves h.
  struct Case {
    bench::Law law;
    double order, largest_m_s, largest_N;
  };
  for (const auto& c : {Case{bench::Law::nominal, 2.0, 3e-4, 0.0}, Case{bench::Law::adaptive, 1.0, 0.02, 6e-3}}) {
    CAPTURE(c.order);
    Gap before = gap(c.law, 250.0);
    CHECK(before.error_m_s < c.largest_m_s);
    CHECK(before.theta_N <= c.largest_N);
    for (const double rate_Hz : {500.0, 1000.0, 2000.0}) {
      CAPTURE(rate_Hz);
      const Gap now = gap(c.law, rate_Hz);
      CHECK_THAT(std::log2(before.error_m_s / now.error_m_s), WithinAbs(c.order, 0.1));
      if (c.law == bench::Law::adaptive) CHECK_THAT(std::log2(before.theta_N / now.theta_N), WithinAbs(c.order, 0.15));
      before = now;
    }
  }
}

TEST_CASE("A pack of rigs computes what each rig computes by itself") {
  const paper::Laws<double> first = paper::laws({}), second = paper::laws({.r1_m = 0.11, .J2_kg_m2 = 0.03});
  const auto both = [](double a, double b) { return Pair{a, b}; };
  const paper::Laws<Pair> pack{.r1 = both(first.r1, second.r1),
                               .r2 = both(first.r2, second.r2),
                               .J1 = both(first.J1, second.J1),
                               .J2 = both(first.J2, second.J2),
                               .d1 = both(first.d1, second.d1),
                               .d2 = both(first.d2, second.d2),
                               .M10 = both(first.M10, second.M10),
                               .M20 = both(first.M20, second.M20)};
  const paper::Gains<double> g{.ks0 = 19.0, .ks1 = 32.0, .gamma = 21.0, .ka1 = 1.0, .p12 = 0.05, .p22 = 0.03};
  const paper::Gains<Pair> gs{.ks0 = g.ks0, .ks1 = g.ks1, .gamma = g.gamma, .ka1 = g.ka1, .p12 = g.p12, .p22 = g.p22};
  const paper::Reading<double> y{.omega1 = 140.0, .omega2 = 170.0, .lambda_ref = 0.15, .phi = 0.8};
  const paper::Reading<Pair> ys{.omega1 = y.omega1, .omega2 = y.omega2, .lambda_ref = y.lambda_ref, .phi = y.phi};
  const paper::AdaptiveState<double> x{.I = 0.1, .omega1_hat = 141.0, .zeta = 20.0};
  const paper::AdaptiveState<Pair> xs{.I = x.I, .omega1_hat = x.omega1_hat, .zeta = x.zeta};

  const Pair torque = pack.adaptive_T_b(gs, ys, xs), nominal = pack.nominal_T_b(gs, ys, 0.1, 23.0);
  const paper::AdaptiveState<Pair> dot = pack.adaptive_dot(gs, ys, xs, torque);
  for (const std::size_t lane : {std::size_t{0}, std::size_t{1}}) {
    const auto& one = lane == 0 ? first : second;
    CHECK(torque.lanes[lane] == one.adaptive_T_b(g, y, x));
    CHECK(nominal.lanes[lane] == one.nominal_T_b(g, y, 0.1, 23.0));
    const auto dot_of_one = one.adaptive_dot(g, y, x, one.adaptive_T_b(g, y, x));
    CHECK(dot.I.lanes[lane] == dot_of_one.I);
    CHECK(dot.omega1_hat.lanes[lane] == dot_of_one.omega1_hat);
    CHECK(dot.zeta.lanes[lane] == dot_of_one.zeta);
  }
}
