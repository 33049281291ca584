// Numbers that a correct implementation must reproduce: from the independent prototype of theory.md (RK4 at 100 us) and
// closed forms.

#include <algorithm>
#include <cmath>

#include "catch.hpp"
#include "simulated_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment::test;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// e_v'' + ks1 e_v' + ks0 e_v = 0 from e_v(0) = 1, I(0) = 0.
double closed_form(double t_s, double ks0, double ks1) {
  const double root = std::sqrt(ks1 * ks1 - 4.0 * ks0);
  const double fast = (-ks1 - root) / 2.0;
  const double slow = (-ks1 + root) / 2.0;
  return (slow * std::exp(slow * t_s) - fast * std::exp(fast * t_s)) / (slow - fast);
}

double worst_against_closed_form(const Setup& setup) {
  const Result result = simulated(setup);
  const auto braking = result.in_phase(rig::Phase::brake);
  const double start_m_s = braking.front().control.slip_velocity_error_m_s;
  double worst = 0.0;
  for (const auto& record : braking) {
    const double t_s = record.time_s - braking.front().time_s;
    if (0.099 * record.truth.speeds.omega2_rad_s < 1.0) break;
    const double wanted = start_m_s * closed_form(t_s, setup.control.adaptive.ks0, setup.control.adaptive.ks1);
    worst = std::max(worst, std::abs(record.control.slip_velocity_error_m_s - wanted));
  }
  return worst;
}

}  // namespace

TEST_CASE("nominal, ideal actuator and sensors: stop, distance, and the error's closed form") {
  const Setup setup = ideal_braking("nominal");
  const Result result = simulated(setup);
  CHECK(result.outcome.completed());
  CHECK_THAT(result.metrics.stop_time_s, WithinRel(2.277, 0.005));
  CHECK_THAT(result.metrics.stop_distance_m, WithinRel(19.36, 0.005));
  CHECK(worst_against_closed_form(setup) < 0.005);
}

TEST_CASE("the error follows its closed form at other rates, gains and plants") {
  Setup setup = ideal_braking("nominal");
  for (const double rate_Hz : {500.0, 2000.0, 10000.0}) {
    setup.control.rate_Hz = rate_Hz;
    CHECK(worst_against_closed_form(setup) < 0.01);
  }
  setup.control.rate_Hz = 1000.0;
  setup.control.adaptive.ks0 = 60.0;
  setup.control.adaptive.ks1 = 20.0;
  setup.plant.rig.tyre.theta_N = 40.0;
  CHECK(worst_against_closed_form(setup) < 0.005);
}

TEST_CASE("adaptive, ideal actuator and sensors: stop, distance, convergence of theta") {
  const Result result = simulated(ideal_braking("adaptive"));
  CHECK_THAT(result.metrics.stop_time_s, WithinRel(2.283, 0.005));
  CHECK_THAT(result.metrics.stop_distance_m, WithinRel(19.32, 0.005));
  const auto braking = result.in_phase(rig::Phase::brake);
  const auto first = std::find_if(braking.begin(), braking.end(), [](const rig::CycleRecord& r) {
    return std::abs(r.control.theta_est_N - 23.0) < 0.02 * 23.0;
  });
  REQUIRE(first != braking.end());
  CHECK_THAT(first->time_s - braking.front().time_s, WithinAbs(0.22, 0.03));
}

TEST_CASE("adaptive finds the plant's theta at 3 m/s although its model has another") {
  Setup setup = braking("adaptive");
  setup.model = setup.plant.rig;
  setup.plant.rig.tyre.theta_N = 40.0;
  const Result result = simulated(setup);
  CHECK(result.outcome.completed());
  CHECK_THAT(result.metrics.theta_final_N, WithinRel(40.0, 0.03));
}

TEST_CASE("distance and stop are the plant's, whatever radius the model has") {
  Setup setup = braking("locked");
  const Result right = simulated(setup);
  setup.model = setup.plant.rig;
  setup.model->wheels.r2_m *= 1.1;
  const Result wrong = simulated(setup);
  CHECK_THAT(wrong.metrics.stop_distance_m, WithinRel(right.metrics.stop_distance_m, 1e-3));
  CHECK_THAT(wrong.distances_m.back(), WithinRel(right.distances_m.back(), 5e-3));
}

TEST_CASE("adaptive, theta = 45, ideal: the paper's 1.2 s") {
  Setup setup = ideal_braking("adaptive");
  setup.plant.rig.tyre.theta_N = 45.0;
  const Result result = simulated(setup);
  CHECK_THAT(result.metrics.stop_time_s, WithinRel(1.208, 0.005));
  CHECK_THAT(result.metrics.stop_distance_m, WithinRel(10.08, 0.005));
}

TEST_CASE("adaptive with the real actuator and 4096-count encoders") {
  const Result result = simulated(braking("adaptive"));
  CHECK_THAT(result.metrics.stop_time_s, WithinRel(2.325, 0.01));
  CHECK_THAT(result.metrics.stop_distance_m, WithinRel(19.72, 0.01));
  CHECK(result.metrics.slip_rms <= 0.010);
  for (const auto& record : result.in_phase(rig::Phase::brake)) {
    if (record.time_s < 0.4 || 0.099 * record.truth.speeds.omega2_rad_s <= 3.0) continue;
    CHECK(std::abs(record.control.theta_est_N - 23.0) <= 0.05 * 23.0);
  }
}

TEST_CASE("locked wheel: the bound without ABS") {
  const Result result = simulated(braking("locked"));
  CHECK_THAT(result.metrics.stop_time_s, WithinRel(3.19, 0.005));
  CHECK_THAT(result.metrics.stop_distance_m, WithinRel(26.9, 0.005));
  for (const auto& record : result.records) {
    CHECK(record.truth.speeds.omega1_rad_s >= 0.0);
    if (record.phase == rig::Phase::brake && record.time_s > 1.0) CHECK(record.truth.speeds.omega1_rad_s == 0.0);
  }
}

TEST_CASE("the result does not depend on the rate of control") {
  Setup setup = braking("adaptive");
  double least = 1e9;
  double most = 0.0;
  for (const double rate_Hz : {500.0, 1000.0, 2000.0, 5000.0}) {
    setup.control.rate_Hz = rate_Hz;
    const double distance_m = simulated(setup).metrics.stop_distance_m;
    least = std::min(least, distance_m);
    most = std::max(most, distance_m);
  }
  CHECK((most - least) / least < 0.01);
}
