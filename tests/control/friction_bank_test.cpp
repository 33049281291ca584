// The bank that learns the tyre's curve from slip and force.

#include "control/friction_bank.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include "abs_hil/rig/tyre_curve.hpp"
#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double period_s = 1e-3;
constexpr double delay_s = 8e-3;

/// A tyre on a road, seen by the bank with the delays that it has in the controller.
class Rolling {
 public:
  explicit Rolling(const rig::TyreParameters& tyre, double zero = 0.0,
                   const control::FrictionBankOptions<>& options = {})
      : bank{options, 1.0 / period_s, delay_s}, tyre_{tyre}, zero_{zero} {
    bank.reset({.slip = -zero, .car_speed_m_s = 10.0, .force_N = 0.0});
    late_.settle(-zero);
  }

  control::FrictionBank bank;
  double road{1.0};
  double noise_N{0.0};
  double quick_slip_error{0.0};  ///< of the reading that is not delayed, while the slip rises
  double quick_error_N{0.0};
  double car_speed_m_s{10.0};

  void slip(double reading) {
    const double force = road * tyre_.theta_N * rig::normalised_tyre_force(tyre_, reading + zero_);
    const double q = -std::expm1(-control::FrictionBankOptions<>{}.force_bandwidth_rad_s * period_s);
    quick_ += -std::expm1(-period_s / delay_s) * (force - quick_);
    bank.learn({.dt_s = period_s,
                .slip = reading + (time_s_ < 0.06 ? quick_slip_error : 0.0),
                .late_slip = late_(q, reading),
                .car_speed_m_s = car_speed_m_s,
                .force_N = delayed_(q, force) + noise_N * normal_(random_),
                .covered = q,
                .quick_force_N = quick_ + quick_error_N});
  }
  /// Slip up to `most` in 60 ms, then about it.
  void brake(double most, double lasts_s) {
    for (double t = 0.0; t < lasts_s; t += period_s, time_s_ += period_s) {
      const double rise = std::min(1.0, time_s_ / 0.06);
      slip(most * rise * (1.0 + 0.1 * std::sin(30.0 * time_s_)) - zero_);
    }
  }

 private:
  rig::TyreParameters tyre_;
  double zero_;
  control::ForceDelay<double> delayed_, late_;
  double quick_{0.0};
  double time_s_{0.0};
  std::mt19937_64 random_{3};
  std::normal_distribution<double> normal_{0.0, 1.0};
};

/// Part of the largest force that the bank's peak slip gives.
double used(const Rolling& rolling, const rig::TyreParameters& tyre, double zero) {
  const double reading = rolling.bank.peak_slip() - rolling.bank.slip_zero();
  return rig::normalised_tyre_force(tyre, reading + zero);
}

}  // namespace

TEST_CASE("Before braking the bank's curve is the mean of the magic formulas that it consists of") {
  const control::FrictionBankOptions<> o;
  const control::FrictionBank bank{o, 1000.0, delay_s};
  for (const double slip : {-0.3, -0.01, 0.0, 0.003, 0.02, 0.05, 0.1, 0.25, 0.6, 1.0}) {
    double sum = 0.0, weights = 0.0;
    for (int j = 0; j < 8; ++j) {
      const double peak = 0.02 * std::pow(12.5, j / 7.0);
      const double away = std::log(peak / o.slip0) / o.slip_spread;
      for (const double C : {1.15, 1.525, 1.9}) {
        const double weight = std::exp(-0.5 * away * away);
        const double B = std::tan(std::numbers::pi / (2.0 * C)) / peak;
        weights += weight;
        sum += weight * std::sin(C * std::atan(B * slip));
      }
    }
    CAPTURE(slip);
    CHECK_THAT(bank.at(slip).N, WithinAbs(o.level0_N * sum / weights, 3e-4 * o.level0_N));
  }
}

TEST_CASE("The bank finds the peak of curves that are not in it, through a slip that is read wrong") {
  const std::array tyres{rig::TyreParameters{23.0, 28.0, 1.68}, rig::TyreParameters{47.0, 28.0, 1.68},
                         rig::TyreParameters{14.0, 18.0, 1.55}, rig::TyreParameters{34.0, 19.5, 1.27},
                         rig::TyreParameters{30.0, 38.0, 1.85}};
  const std::array zeros{0.0, 0.012, -0.012};
  for (const auto& tyre : tyres) {
    for (const double zero : zeros) {
      CAPTURE(tyre.theta_N, tyre.B, tyre.C, zero);
      Rolling rolling{tyre, zero};
      rolling.noise_N = 0.2;
      rolling.brake(1.2 * rig::peak_slip(tyre), 0.6);
      CHECK(used(rolling, tyre, zero) > 0.975);
      CHECK_THAT(rolling.bank.peak_force_N(), WithinRel(tyre.theta_N, 0.06));
      CHECK(rolling.bank.jumps() == 0);
    }
  }
}

TEST_CASE("An observer that reads the slip wrong while it rises does not mislead the bank") {
  const rig::TyreParameters tyre{30.0, 38.0, 1.85};
  const auto peak_with = [&](double quick_slip_error) {
    Rolling rolling{tyre};
    rolling.quick_slip_error = quick_slip_error;
    rolling.brake(1.2 * rig::peak_slip(tyre), 0.07);
    return rolling.bank.peak_slip() - rolling.bank.slip_zero();
  };
  CHECK_THAT(peak_with(0.006), WithinRel(peak_with(0.0), 0.05));
}

TEST_CASE("The slip that is read as braking begins holds, the less so the more force acts then") {
  const rig::TyreParameters tyre{23.0, 28.0, 1.68};
  const auto moved = [&](double force_N) {
    Rolling rolling{tyre};
    rolling.bank.reset({.slip = 0.012, .car_speed_m_s = 10.0, .force_N = force_N});
    CHECK_THAT(rolling.bank.slip_zero(), WithinAbs(-0.012, 1e-15));
    rolling.brake(0.055, 0.02);
    return std::abs(rolling.bank.slip_zero() + 0.012);
  };
  CHECK(moved(0.0) < 0.006);
  CHECK(moved(9.0) > 2.0 * moved(0.0));
}

TEST_CASE("A peak behind which the slip runs away is kept at a distance: an expectile of the bank's peaks") {
  control::FrictionBankOptions<> o;
  o.past_peak_cost = 7.0;
  const double per_N = 0.02;
  control::FrictionBank bank{o, 1000.0, delay_s};
  // Too slow a car to weigh the curves, and too short a time to learn them.
  for (int n = 0; n < 200; ++n) bank.learn({.dt_s = 1e-6, .covered = 1e-4, .runaway_per_N = per_N});
  const auto slope = [&](double slip) {
    double sum = 0.0;
    for (int j = 0; j < 8; ++j) {
      const double peak = 0.02 * std::pow(12.5, j / 7.0);
      const double away = std::log(peak / o.slip0) / o.slip_spread;
      for (const double C : {1.15, 1.525, 1.9}) {
        const double at = std::tan(std::numbers::pi / (2.0 * C));
        const double bent = std::pow(C * at / (1.0 + at * at) / peak, 2);
        const double runs_away = 0.1 * o.level0_N * bent * peak * per_N;
        const double weight = std::exp(-0.5 * away * away) * bent;
        sum += weight * (peak < slip ? 1.0 + o.past_peak_cost * runs_away : 1.0) * (slip - peak);
      }
    }
    return sum;
  };
  double least = 0.02, most = 0.25;  // between them the expected cost is least
  while (most - least > 1e-9) (slope(0.5 * (least + most)) < 0.0 ? least : most) = 0.5 * (least + most);
  CHECK_THAT(bank.peak_slip(), WithinRel(least, 1e-3));
  control::FrictionBank careless{{.past_peak_cost = 0.0}, 1000.0, delay_s};
  careless.learn({.dt_s = 1e-6, .covered = 1e-4, .runaway_per_N = per_N});
  CHECK(bank.peak_slip() < 0.95 * careless.peak_slip());
}

TEST_CASE("What the last braking has left decides its part of the first weights") {
  const double last = 0.12;
  const control::FrictionBankOptions<> o{.last_peak_slip = last};
  const control::FrictionBank bank{o, 1000.0, delay_s};
  double part[2] = {}, logarithm[2] = {};
  for (int j = 0; j < 8; ++j) {
    const double peak = 0.02 * std::pow(12.5, j / 7.0);
    const double away[2] = {std::log(peak / o.slip0) / o.slip_spread, std::log(peak / last) / o.last_peak_spread};
    for (const int i : {0, 1}) {
      part[i] += std::exp(-0.5 * away[i] * away[i]);
      logarithm[i] += std::exp(-0.5 * away[i] * away[i]) * std::log(peak);
    }
  }
  const double mean = (1.0 - o.last_peak_part) * logarithm[0] / part[0] + o.last_peak_part * logarithm[1] / part[1];
  CHECK_THAT(bank.learnt_peak_slip(), WithinRel(0.7 * std::exp(mean), 1e-12));
  // A slip that no member has says nothing.
  const control::FrictionBank far{{.last_peak_slip = 1e-9, .last_peak_spread = 0.05}, 1000.0, delay_s};
  CHECK(far.learnt_peak_slip() == control::FrictionBank({}, 1000.0, delay_s).learnt_peak_slip());
}

TEST_CASE("The last braking helps before the peak is seen, and is forgotten where the force contradicts it") {
  const rig::TyreParameters tyre{23.0, 12.0, 1.55};  // its peak is at a slip of 0.135
  const auto braked = [&](double last, double most, double lasts_s) {
    Rolling rolling{tyre, 0.0, {.last_peak_slip = last}};
    rolling.noise_N = 0.2;
    rolling.brake(most, lasts_s);
    return rolling;
  };
  const double peak = rig::peak_slip(tyre);
  // Up to a fifth of the peak's slip.
  const Rolling cold = braked(0.0, 0.3 * peak, 0.04);
  const Rolling warm = braked(peak, 0.3 * peak, 0.04);
  CHECK(std::abs(std::log(warm.bank.peak_slip() / peak)) < 0.7 * std::abs(std::log(cold.bank.peak_slip() / peak)));
  for (const double wrong : {0.25, 0.4, 2.0}) {
    CAPTURE(wrong);
    CHECK(used(braked(wrong * peak, 1.2 * peak, 0.6), tyre, 0.0) > 0.975);
  }
}

TEST_CASE("A jump of friction moves the level within 40 ms and leaves the shape") {
  const rig::TyreParameters tyre{23.0, 28.0, 1.68};
  for (const double level : {0.5, 1.8}) {
    CAPTURE(level);
    Rolling rolling{tyre};
    rolling.brake(0.05, 0.4);
    const double peak_slip = rolling.bank.peak_slip();
    rolling.road = level;
    rolling.brake(0.05, 0.04);
    CHECK(rolling.bank.jumps() >= 1);
    CHECK_THAT(rolling.bank.peak_force_N(), WithinRel(level * tyre.theta_N, 0.1));
    CHECK_THAT(rolling.bank.peak_slip(), WithinRel(peak_slip, 0.05));
  }
}

TEST_CASE("A force that an error of the slip explains is no jump: the more so, the slower the car") {
  const rig::TyreParameters tyre{23.0, 28.0, 1.68};
  const control::FrictionBankOptions<> o;
  const auto jumps_with = [&](double car_speed_m_s, double part) {
    Rolling rolling{tyre};
    rolling.brake(0.05, 0.4);
    for (double t = 0.0; t < 0.1; t += period_s) rolling.slip(0.05);
    const auto& bank = rolling.bank;
    const double by_slip_N = o.jump_slip_m_s * bank.late_force_N() / (car_speed_m_s * bank.peak_slip());
    rolling.car_speed_m_s = car_speed_m_s;
    rolling.quick_error_N = part * (std::max(o.jump_least_N, o.jump_share * bank.peak_force_N()) + by_slip_N);
    for (double t = 0.0; t < 0.01; t += period_s) rolling.slip(0.05);
    return bank.jumps();
  };
  for (const double car_speed_m_s : {10.0, 3.0, 1.2}) {
    CAPTURE(car_speed_m_s);
    CHECK(jumps_with(car_speed_m_s, 0.97) == 0);
    CHECK(jumps_with(car_speed_m_s, 1.03) == 1);
  }
}

TEST_CASE("Whatever the data say, the slip at no force stays near what was read as braking began") {
  const control::FrictionBankOptions<> o;
  for (const double read : {0.0, 0.015}) {
    control::FrictionBank bank{o, 1000.0, delay_s};
    bank.reset({.slip = -read, .car_speed_m_s = 10.0, .force_N = 1.0});
    const double room = 0.01 + o.zero_error_m_s / 10.0 + o.zero_error_per_N;
    double least = 1.0, most = -1.0;
    // A force that does not depend on the slip, and falls by a step: only a zero that wanders explains it.
    for (int n = 0; n < 4000; ++n) {
      const double slip = 0.02 + 0.015 * std::sin(0.03 * n);
      const double force_N = n < 2000 ? 25.0 : 6.0;
      bank.learn({.dt_s = period_s,
                  .slip = slip,
                  .late_slip = slip,
                  .car_speed_m_s = 10.0,
                  .force_N = force_N,
                  .covered = 0.15,
                  .quick_force_N = bank.late_force_N()});
      least = std::min(least, bank.slip_zero());
      most = std::max(most, bank.slip_zero());
    }
    CHECK(least >= read - room - 1e-12);
    CHECK(most <= read + room + 1e-12);
    CHECK(most - least > 0.01);
  }
}

TEST_CASE("Where the force stays unexplained for long, the level follows it sooner") {
  const rig::TyreParameters tyre{23.0, 28.0, 1.68};
  // Friction falls too slowly for a jump.
  const auto level_with = [&](double per_s) {
    Rolling rolling{tyre, 0.0, {.level_drift_unexplained_per_s = per_s}};
    rolling.brake(0.05, 0.4);
    for (double t = 0.0; t < 0.4; t += period_s) {
      rolling.road = 1.0 - t;
      rolling.brake(0.05, period_s);
    }
    CHECK(rolling.bank.jumps() == 0);
    return rolling.bank.peak_force_N() / tyre.theta_N;
  };
  CHECK_THAT(level_with(15.0), WithinAbs(0.6, 0.06));
  CHECK(std::abs(level_with(0.0) - 0.6) > 0.2);
}

TEST_CASE("No data make the bank lose its numbers, and it recovers") {
  const rig::TyreParameters tyre{23.0, 28.0, 1.68};
  Rolling rolling{tyre};
  std::mt19937_64 random{9};
  std::uniform_real_distribution<double> draw{-1.0, 1.0};
  for (int n = 0; n < 2000; ++n) {
    rolling.bank.learn({.dt_s = period_s,
                        .slip = draw(random),
                        .car_speed_m_s = 10.0 * (1.0 + draw(random)),
                        .force_N = 1e3 * draw(random),
                        .covered = 0.14,
                        .quick_force_N = 1e3 * draw(random)});
    REQUIRE(std::isfinite(rolling.bank.peak_slip()));
    REQUIRE(rolling.bank.peak_force_N() > 0.0);
    REQUIRE(rolling.bank.peak_force_N() <= 500.0);
    REQUIRE(std::isfinite(rolling.bank.at(0.05).N));
    REQUIRE(rolling.bank.at(0.05).spread_N >= 0.0);
  }
  rolling.bank.reset({.slip = 0.0, .car_speed_m_s = 10.0, .force_N = 0.0});
  rolling.brake(0.055, 0.6);
  CHECK(used(rolling, tyre, 0.0) > 0.97);
}

TEST_CASE("A jump that is seen while the slip is negative leaves the level in its bounds") {
  const rig::TyreParameters tyre{23.0, 28.0, 1.68};
  Rolling rolling{tyre};
  rolling.brake(0.05, 0.4);
  // The force is one that no negative slip explains, for long.
  for (int n = 0; n < 5000; ++n) {
    rolling.bank.learn({.dt_s = period_s,
                        .slip = -0.01,
                        .car_speed_m_s = 10.0,
                        .force_N = 20.0,
                        .covered = 0.14,
                        .quick_force_N = 20.0});
    REQUIRE(std::abs(rolling.bank.late_force_N()) <= 500.0);
    REQUIRE(rolling.bank.peak_force_N() > 0.0);
  }
}

TEST_CASE("Options of the bank out of range are refused") {
  const auto made = [](control::FrictionBankOptions<> o, double rate_Hz = 1e3, double late_s = delay_s) {
    return control::FrictionBank{o, rate_Hz, late_s};
  };
  CHECK_THROWS_AS(made({.force_noise_N2_s = 0.0}), std::invalid_argument);
  CHECK_THROWS_AS(made({.slip0 = 1.0}), std::invalid_argument);
  CHECK_THROWS_AS(made({.share_per_s = 0.0}), std::invalid_argument);
  CHECK_THROWS_AS(made({}, 0.0), std::invalid_argument);
  CHECK_THROWS_AS(made({}, 1e3, 0.0), std::invalid_argument);
}
