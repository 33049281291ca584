// Super-twisting: its implicit step, its continuous limit, perturbations with a bounded slope.
#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "catch.hpp"
#include "control/baseline_bench.hpp"
#include "control/sliding_mode_controllers.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

namespace {

double sign(double x) { return x > 0 ? 1.0 : (x < 0 ? -1.0 : 0.0); }

}  // namespace

TEST_CASE("The super-twisting step satisfies its implicit equation and never moves z beyond what takes e to 0") {
  std::mt19937 random{9};
  std::uniform_real_distribution<double> unit{-1.0, 1.0};
  int inside = 0;
  for (int i = 0; i < 2000; ++i) {
    const double h = std::pow(10.0, -3.0 + unit(random));
    const double k1 = 10 + 9 * unit(random), k2 = 60 + 50 * unit(random);
    const double scale = std::pow(10.0, -3.0 + 3.5 * unit(random));
    const double e = scale * unit(random), z = 10 * scale * unit(random);
    const auto next = control::super_twisting_step(e, z, k1, k2, h);
    const double e_end = e + h * next.root_rate_m_s2;
    CHECK(e_end * e >= 0.0);
    CHECK_THAT(next.root_rate_m_s2, WithinAbs(-k1 * std::sqrt(std::abs(e_end)) * sign(e), 1e-6 * k1));
    CHECK_THAT(next.integral_m_s2, WithinAbs(z - h * k2 * next.sign, 1e-12 * (1 + scale)));
    if (std::abs(e) >= h * h * k2) {
      CHECK(next.sign == sign(e));
    } else {
      CHECK_THAT(next.integral_m_s2, WithinAbs(z - e / h, 1e-9));
      ++inside;
    }
  }
  CHECK(inside > 20);
}

TEST_CASE("For vanishing periods the super-twisting step tends to the continuous law") {
  for (const double e : {-1.3, -0.2, 0.4, 2.0}) {
    for (const double z : {-8.0, 0.0, 5.0}) {
      const auto next = control::super_twisting_step(e, z, 9.0, 70.0, 1e-7);
      CHECK_THAT(next.root_rate_m_s2 + next.integral_m_s2,
                 WithinAbs(-9.0 * std::sqrt(std::abs(e)) * sign(e) + z, 1e-4));
      CHECK_THAT((next.integral_m_s2 - z) / 1e-7, WithinAbs(-70.0 * sign(e), 1e-3));
    }
  }
}

TEST_CASE("Unperturbed, the Lyapunov function falls and (0, 0) is reached within the time that it promises") {
  // Moreno and Osorio (2012): V = x'Px of x = (sqrt|e| sign(e), z), V' = -x'Qx/sqrt|e|, for any k1, k2 > 0, hence
  // V' <= -c sqrt(V) with c = sqrt(lambda_min(P)) lambda_min(Q)/lambda_max(P), and V = 0 by 2 sqrt(V(0))/c.
  for (const double h : {1e-4, 1e-3, 1e-2}) {
    for (const auto& [k1, k2] : {std::pair{2.0, 3.0}, {1.5, 1.0}, {2.5, 1.2}}) {
      Eigen::Matrix2d P, Q;
      P << 4 * k2 + k1 * k1, -k1, -k1, 2;
      P *= 0.5;
      Q << 2 * k2 + k1 * k1, -k1, -k1, 1;
      Q *= 0.5 * k1;
      const auto V = [&](double e, double z) {
        const Eigen::Vector2d x{std::sqrt(std::abs(e)) * sign(e), z};
        return x.dot(P * x);
      };
      const Eigen::Vector2d p = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>{P}.eigenvalues();
      const double c = std::sqrt(p[0]) * Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>{Q}.eigenvalues()[0] / p[1];
      double e = -2.5, z = 0.0;
      const double promised = 2 * std::sqrt(V(e, z)) / c;
      CAPTURE(h, k1, k2, promised);
      const int steps = static_cast<int>(promised / h) + 5;
      int compared = 0, risen = 0;
      for (int n = 0; n < steps; ++n) {
        const auto next = control::super_twisting_step(e, z, k1, k2, h);
        const double e_next = e + h * (next.root_rate_m_s2 + next.integral_m_s2);
        // Where a period is short against the motion the sampled V falls as the continuous one does.
        if (std::abs(e) > 100 * h * h * (k1 * k1 + k2)) {
          ++compared;
          if (!(V(e_next, next.integral_m_s2) < V(e, z))) ++risen;
        }
        e = e_next;
        z = next.integral_m_s2;
      }
      CHECK(promised < 200.0);
      CHECK(compared > 0);
      CHECK(risen == 0);
      CHECK_THAT(e, WithinAbs(0.0, 1e-12));
      CHECK_THAT(z, WithinAbs(0.0, 1e-9));
    }
  }
}

TEST_CASE("A perturbation with slope L is overcome if k2 > L and k1 > sqrt(k2 + L), and not if k2 < L") {
  // e' = u + rho with the worst slope for e at every moment: rho' = L sign(e); and a plain sine.
  const double L = 40.0, h = 1e-4;
  const auto largest_late = [&](double k1, double k2, bool worst) {
    double e = -0.4, z = 0.0, rho = 0.0, late = 0.0;
    for (int n = 0; n * h < 4.0; ++n) {
      const auto next = control::super_twisting_step(e, z, k1, k2, h);
      z = next.integral_m_s2;
      rho += h * (worst ? L * sign(e) : L * std::cos(L / 5.0 * n * h));
      e += h * (next.root_rate_m_s2 + z + rho);
      if (n * h > 3.0) late = std::max(late, std::abs(e));
    }
    return late;
  };
  // The error of sampling is of the order of h^2 (k1^2 + k2), 2e-6 here, not of h times the perturbation, 1e-2.
  for (const bool worst : {true, false}) {
    CHECK(largest_late(1.02 * std::sqrt(2.1 * L), 1.1 * L, worst) < 1e-5);
    CHECK(largest_late(1.5 * std::sqrt(L), 1.1 * L, worst) < 1e-5);  // Levant's setting
    CHECK(largest_late(3.0 * std::sqrt(L), 2.0 * L, worst) < 1e-5);
  }
  CHECK(largest_late(1.5 * std::sqrt(L), 0.7 * L, true) > 1.0);
}

TEST_CASE("The super-twisting control is continuous in e and z, also across e = 0") {
  const double h = 1e-3, k1 = 10.0, k2 = 60.0;
  const auto control = [&](double e, double z) {
    const auto step = control::super_twisting_step(e, z, k1, k2, h);
    return step.root_rate_m_s2 + step.integral_m_s2;
  };
  // Steepest where the step just reaches 0: slope -1/h in e, -1 ... 1 in z. So a step of 1e-9 m/s moves it by 1e-6 at
  // most.
  for (const double z : {-5.0, 0.0, 0.3}) {
    for (int i = -2000; i < 2000; ++i) {
      const double e = 1e-5 * i;
      CHECK(std::abs(control(e + 1e-9, z) - control(e, z)) <= 2.001e-6);
      CHECK(std::abs(control(e, z + 1e-6) - control(e, z)) <= 1.001e-6);
    }
  }
}

TEST_CASE("With an ideal actuator super-twisting reaches the surface at every rate, without chatter or wheel lock") {
  const double rate_Hz = GENERATE(100.0, 1000.0, 10'000.0);
  bench::Setup s;
  s.options.rate_Hz = rate_Hz;
  s.options.super_twisting = {.k1 = 10.0, .k2 = 40.0, .adaptation = {.gamma = 0.0, .theta0_N = 19.0}};
  const auto run = bench::brake(s, "super-twisting");
  CAPTURE(rate_Hz);
  double largest_jump = 0.0;
  for (std::size_t n = 1; n < run.ticks.size(); ++n) {
    const auto& tick = run.ticks[n];
    if (0.0990 * tick.omega2 <= 3.0) break;
    REQUIRE(tick.slip < 0.5);
    if (tick.t < 1.0) continue;
    CHECK(std::abs(tick.output.slip_velocity_error_m_s) < 0.01);
    largest_jump = std::max(largest_jump, std::abs(tick.applied_Nm - run.ticks[n - 1].applied_Nm));
  }
  CHECK(largest_jump < 0.05);
  CHECK(run.ticks.back().output.theta_est_N == 19.0);
}

TEST_CASE("The integral of the sign is held while it would drive the torque further out of the actuator's range") {
  bench::Setup s;
  s.options.super_twisting = {.k1 = 5.0, .k2 = 50.0, .adaptation = {.gamma = 0.0, .theta0_N = 20.0}};
  const auto controller = control::make_controller("super-twisting", {s.options, s.rig});
  auto in = baseline::input_at(s.rig, 150.0, -1.0, 0.0);
  in.max_brake_torque_Nm = 1.0;
  controller->reset(in);
  const double first = controller->step(in).brake_torque_Nm;
  REQUIRE(first > 1.0);
  in.dt_s = 1e-3;
  for (int n = 0; n < 500; ++n) {
    bench::note_sent(in, first);
    CHECK_THAT(controller->step(in).brake_torque_Nm, WithinAbs(first, 1e-12));
  }
  in.max_brake_torque_Nm = 9.0;
  // A rate limit, too, holds z. What was sent lags behind although the torque is in reach.
  for (int n = 0; n < 500; ++n) CHECK_THAT(controller->step(in).brake_torque_Nm, WithinAbs(first, 1e-12));
  in.unsent_torque_Nm = 0.0;
  const double before = controller->step(in).brake_torque_Nm;
  CHECK(controller->step(in).brake_torque_Nm > before + 1e-3);
}
