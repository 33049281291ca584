// adaptive-optimal: its distance, what it costs the brake, and what it does not depend on.

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "catch.hpp"
#include "control/adaptive_optimal_controller.hpp"
#include "control/peak_bench.hpp"

using namespace abs_hil;
using namespace bench;
using Catch::Matchers::WithinRel;

namespace {

struct Braking {
  double distance_m{0.0};
  double variation_Nm{0.0};  ///< of the static torque that is sent
  double largest_slip{0.0};  ///< above 3 m/s
};

Braking measured(const bench::Setup& s) {
  const auto run = bench::brake(s, "adaptive-optimal");
  REQUIRE(std::isfinite(run.stop_time_s));
  Braking result{.distance_m = run.stop_distance_m, .largest_slip = largest_slip(run, s.plant->wheels.r2_m)};
  double last = 0.0;
  for (const auto& tick : run.ticks) {
    result.variation_Nm += std::abs(tick.applied_Nm - last);
    last = tick.applied_Nm;
  }
  return result;
}

}  // namespace

TEST_CASE("Table 1 from 170 rad/s: within 4 % of the causal optimum of 15.62 m, and the brake moves by 100 N m") {
  Draw draw{std::mt19937_64{5}};
  for (int i = 0; i < 10; ++i) {
    auto s = real_rig();
    s.angle1_start = draw(0.0, 0.1);
    s.angle2_start = draw(0.0, 0.1);
    CAPTURE(s.angle1_start, s.angle2_start);
    const Braking run = measured(s);
    CHECK(run.distance_m <= 1.04 * 15.622);
    CHECK(run.distance_m > 15.29);  // no controller beats phi = 1 throughout
    CHECK(run.variation_Nm < 100.0);
    CHECK(run.largest_slip < 0.15);
  }
}

TEST_CASE("Behind a dead time: near the optimum, which coasts so much longer, also where it is told 30 % wrong") {
  constexpr double dead_s = 0.024, optimum_m = 15.622 + 170.0 * 0.0990 * dead_s;
  auto s = real_rig();
  s.plant->brake.brake_dead_time_s = dead_s;
  s.omega1_start = s.omega2_start * s.rig.wheels.r2_m / s.rig.wheels.r1_m;  // no slip, as after coasting
  const auto told = [&](double part) {
    s.rig.brake.brake_dead_time_s = part * dead_s;
    return measured(s);
  };
  const Braking right = told(1.0);
  CHECK(right.distance_m < 1.045 * optimum_m);
  CHECK(right.largest_slip < 0.25);
  for (const double part : {0.7, 1.3}) {
    CAPTURE(part);
    CHECK(told(part).distance_m < 1.085 * optimum_m);
  }
  CHECK(told(0.0).distance_m > 1.2 * optimum_m);  // what a law without a predictor needs
}

TEST_CASE(
    "All forces times ten and a tenth: the same distance and times the same torque, with a dead time and without") {
  for (const double dead_s : {0.0, 0.02}) {
    const auto braked = [&](double factor) {
      auto s = real_rig();
      s.rig.brake.brake_dead_time_s = s.plant->brake.brake_dead_time_s = dead_s;
      scale_forces(s.rig, factor);
      scale_forces(*s.plant, factor);
      return measured(s);
    };
    const Braking as_it_is = braked(1.0);
    for (const double factor : {0.1, 10.0}) {
      CAPTURE(dead_s, factor);
      const Braking run = braked(factor);
      CHECK_THAT(run.distance_m, WithinRel(as_it_is.distance_m, 1e-6));
      CHECK_THAT(run.variation_Nm, WithinRel(factor * as_it_is.variation_Nm, 1e-4));
    }
  }
}

TEST_CASE("adaptive-optimal uses neither tyre parameters nor the slip reference: no bit changes") {
  auto s = real_rig();
  const auto first = bench::brake(s, "adaptive-optimal");
  const auto check = [&] {
    const auto other = bench::brake(s, "adaptive-optimal");
    REQUIRE(other.ticks.size() == first.ticks.size());
    for (std::size_t n = 0; n < first.ticks.size(); ++n) {
      REQUIRE(other.ticks[n].output.brake_torque_Nm == first.ticks[n].output.brake_torque_Nm);
    }
  };
  for (const auto& tyre : {rig::TyreParameters{23.0, 28.0, 1.68}, rig::TyreParameters{90.0, 3.0, 1.9}}) {
    s.rig.tyre = tyre;
    check();
  }
  s.options.slip_ref = 0.4;
  check();
}

TEST_CASE("Where friction falls to a half and returns, slip is back at the peak within 0.15 s") {
  auto s = real_rig();
  s.theta_at = [](double t) { return t < 0.6 || t >= 1.0 ? 23.0 : 12.0; };
  const auto run = bench::brake(s, "adaptive-optimal");
  for (const auto& tick : run.ticks) {
    if (s.plant->wheels.r2_m * tick.omega2 < slow_m_s) break;
    CAPTURE(tick.t);
    REQUIRE(tick.slip < 0.25);
    const bool settled = (tick.t > 0.75 && tick.t < 1.0) || (tick.t > 1.15 && tick.t < 1.6);
    if (settled) {
      REQUIRE(tick.slip > 0.02);
      REQUIRE(tick.slip < 0.11);
    }
  }
  CHECK(measured(s).variation_Nm < 165.0);
}

TEST_CASE("Friction that changes in a straight line is not taken for another curve: within 3 % of the causal optimum") {
  struct Road {
    double first, last, from_s;
    double bound_m;  ///< python -m abs_hil.optimum
  };
  for (const Road& road : {Road{1.0, 0.5, 0.4, 17.853}, Road{0.5, 1.0, 0.3, 17.260}}) {
    Draw draw{std::mt19937_64{8}};
    for (int i = 0; i < 10; ++i) {
      auto s = real_rig();
      s.plant->tyre = {.theta_N = 27.0, .B = 30.0, .C = 1.6};
      s.theta_at = [&](double t) {
        return 27.0 * std::lerp(road.first, road.last, std::clamp((t - road.from_s) / 0.5, 0.0, 1.0));
      };
      s.angle1_start = draw(0.0, 0.1);
      s.angle2_start = draw(0.0, 0.1);
      CAPTURE(road.first, s.angle1_start, s.angle2_start);
      CHECK(measured(s).distance_m <= 1.03 * road.bound_m);
    }
  }
}

TEST_CASE("Random tyres, rigs off by 10 % and jumps: no lock in 200 runs, and the brake is spared") {
  Draw draw{std::mt19937_64{17}};
  std::vector<double> variation_Nm;
  for (int i = 0; i < 200; ++i) {
    CAPTURE(i);
    auto s = real_rig();
    s.plant->tyre = {.theta_N = draw(10.0, 60.0), .B = draw(10.0, 40.0), .C = draw(1.3, 1.9)};
    perturb(*s.plant, draw);
    s.omega1_start = s.omega2_start = draw(60.0, 180.0);
    s.angle1_start = draw(0.0, 0.1);
    const double jump_N = draw(10.0, 60.0), first_s = draw(0.1, 1.2), then_s = first_s + draw(0.1, 1.0);
    const double theta_N = s.plant->tyre.theta_N;
    if (i % 2 == 1) s.theta_at = [=](double t) { return t < first_s || t >= then_s ? theta_N : jump_N; };
    const Braking run = measured(s);
    REQUIRE(run.largest_slip < 0.9);
    variation_Nm.push_back(run.variation_Nm);
  }
  std::sort(variation_Nm.begin(), variation_Nm.end());
  CHECK(variation_Nm[variation_Nm.size() / 2] < 80.0);
}

TEST_CASE("adaptive-optimal brakes at other rates, and with an ideal actuator and true speeds") {
  for (const double rate_Hz : {500.0, 2000.0, 5000.0}) {
    CAPTURE(rate_Hz);
    auto s = real_rig();
    s.options.rate_Hz = rate_Hz;
    const Braking run = measured(s);
    CHECK(run.distance_m <= 1.04 * 15.622);
    CHECK(run.variation_Nm < 120.0);
    CHECK(run.largest_slip < 0.2);
  }
  auto s = real_rig();
  s.ideal_actuator = true;
  s.encoders = false;
  const Braking run = measured(s);
  CHECK(run.distance_m <= 1.04 * 15.29);
}

TEST_CASE(
    "The slower the car, the faster the slip runs away past the peak, and the farther below it is the reference") {
  // The mean of the reference over the peak while the lower wheel's speed is in a range.
  const auto reference_over_peak = [](double runaway, double least_rad_s, double most_rad_s) {
    auto s = real_rig();
    s.options.adaptive_optimal.runaway = runaway;
    s.options.adaptive_optimal.search_part = 0.0;
    double sum = 0.0;
    int count = 0;
    for (const auto& tick : bench::brake(s, "adaptive-optimal").ticks) {
      if (tick.omega2 < least_rad_s || tick.omega2 > most_rad_s) continue;
      sum += (tick.output.slip_ref + tick.output.signals[1]) / tick.output.signals[0];
      ++count;
    }
    return sum / count;
  };
  const double factor = control::ControlOptions{}.adaptive_optimal.peak_factor;
  CHECK(std::abs(reference_over_peak(1e6, 100.0, 140.0) - factor) < 0.02);
  CHECK(std::abs(reference_over_peak(1e6, 20.0, 40.0) - factor) < 0.02);
  const double fast = reference_over_peak(0.4, 100.0, 140.0), slow = reference_over_peak(0.4, 20.0, 40.0);
  CHECK(fast < factor - 0.01);
  CHECK(slow < fast - 0.05);
}

TEST_CASE("Where the slip runs away within the brake's lag, nothing searches") {
  // By how much the reference moves, over the peak, while the lower wheel's speed is in a range.
  const auto swing = [](const rig::TyreParameters& tyre, double least_rad_s, double most_rad_s) {
    auto s = real_rig();
    s.plant->tyre = tyre;
    double least = 1.0, most = 0.0;
    for (const auto& tick : bench::brake(s, "adaptive-optimal").ticks) {
      if (tick.omega2 < least_rad_s || tick.omega2 > most_rad_s) continue;
      const double part = (tick.output.slip_ref + tick.output.signals[1]) / tick.output.signals[0];
      least = std::min(least, part);
      most = std::max(most, part);
    }
    return most - least;
  };
  const double part = control::ControlOptions{}.adaptive_optimal.search_part;
  CHECK(swing({30.0, 12.0, 1.4}, 60.0, 120.0) > 1.5 * part);
  CHECK(swing({55.0, 38.0, 1.85}, 12.0, 25.0) < 0.3 * part);
}

TEST_CASE("The excess torque is the largest from which a brake of limited rate still ends at the wanted slip") {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  control::ProximateTorque loop{.mass_kg_m = 0.0758,
                                .gain_per_s = 1e6,
                                .near_per_s = 1e6,
                                .near_m_s = 0.1,
                                .swing_per_s = 20.37,
                                .rate_limit_Nm_s = 100.0};
  // With a rate limit: while the excess z falls to 0 at 100 N m/s, e_v moves by the whole error.
  for (const double error : {0.01, 0.1, 1.0}) {
    const double z = loop.excess_Nm(error, 1e3, 1.0);
    CHECK_THAT(z * z / (2.0 * 100.0 * 0.0758), WithinRel(error, 1e-12));
  }
  // With the lag alone: the torque falls faster at first than the rate at its end, so the error is not used up.
  loop.rate_limit_Nm_s = infinite;
  const double hold = 3.0, error = 0.2;
  const double z = loop.excess_Nm(error, hold, 1.0);
  double moved = 0.0;
  for (double torque = hold + z; torque > hold; torque -= 1e-6 * 20.37 * torque)
    moved += 1e-6 * (torque - hold) / 0.0758;
  CHECK(moved < error);
  CHECK(moved > 0.5 * error);
  // Near the target it is linear.
  loop.gain_per_s = 60.0;
  loop.near_per_s = 10.0;
  CHECK_THAT(loop.excess_Nm(1e-6, hold, 1.0), WithinRel(10.0 * 0.0758 * 1e-6, 1e-4));
  CHECK(loop.excess_Nm(0.0, hold, 1.0) == 0.0);
}
