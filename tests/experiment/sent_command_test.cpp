// What is sent is not what is wanted: steps of the PWM, dead zone, limits; and outputs that are no numbers.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include "abs_hil/rig/brake_map.hpp"
#include "catch.hpp"
#include "rig/reason_text.hpp"
#include "simulated_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// RMS of the estimated brake torque's error over the whole run, N m.
double torque_error_Nm(const Result& result) {
  double sum = 0.0;
  for (const rig::CycleRecord& record : result.records) {
    sum += std::pow(record.control.brake_torque_est_Nm - record.truth.brake_torque_Nm, 2);
  }
  return std::sqrt(sum / static_cast<double>(result.records.size()));
}

/// The estimate of theta when the car falls through 3 m/s.
double theta_at_3_m_s(const Setup& setup, const Result& result) {
  for (const rig::CycleRecord& record : result.in_phase(rig::Phase::brake)) {
    if (setup.plant.rig.wheels.r2_m * record.truth.speeds.omega2_rad_s < 3.0) return record.control.theta_est_N;
  }
  return rig::unknown;
}

}  // namespace

TEST_CASE("wherever the dead zone ends, torque and theta are estimated from what the PWM sends") {
  for (const driver::PwmMode mode : {driver::PwmMode::bits_12, driver::PwmMode::bits_8}) {
    for (int n = 0; n <= 50; ++n) {
      Setup setup = braking("adaptive");
      setup.plant.rig.brake.u0 = 0.40 + 0.005 * n;
      setup.pwm_mode = mode;
      const Result result = simulated(setup);
      const double steps = driver::full_width(mode);
      CAPTURE(setup.plant.rig.brake.u0, steps);
      CHECK(result.outcome.completed());
      CHECK(torque_error_Nm(result) < 0.02);
      if (mode == driver::PwmMode::bits_12) CHECK_THAT(theta_at_3_m_s(setup, result), WithinRel(23.0, 0.03));
      for (const rig::CycleRecord& record : result.records) {
        const double duty = record.command.brake_duty;
        REQUIRE((duty == 0.0 || duty >= setup.plant.rig.brake.u0));  // never inside the dead zone
        REQUIRE(duty == std::round(duty * steps) / steps);
        REQUIRE_THAT(rig::brake_torque_at(setup.plant.rig.brake, duty),
                     WithinAbs(record.control.brake_torque_ref_Nm, 1e-9));
      }
    }
  }
}

TEST_CASE("u0 = 0.55, which 12 bits round into the dead zone, is as good as its neighbour 0.55031") {
  for (const double u0 : {0.55, 0.55031}) {
    Setup setup = braking("adaptive");
    setup.plant.rig.brake.u0 = u0;
    const Result result = simulated(setup);
    CHECK_THAT(theta_at_3_m_s(setup, result), WithinRel(23.0, 0.03));  // 29.2 before
    double sum_Nm = 0.0;
    const auto braking_records = result.in_phase(rig::Phase::brake);
    for (const rig::CycleRecord& record : braking_records) {
      sum_Nm += std::abs(record.control.brake_torque_est_Nm - record.truth.brake_torque_Nm);
    }
    CHECK(sum_Nm / static_cast<double>(braking_records.size()) < 1e-3);  // 0.53 before
  }
}

TEST_CASE("a slow rise of the brake takes no time in the dead zone and does not wind up the integral") {
  for (const char* controller : {"adaptive", "nominal", "pi", "adaptive-actuator", "super-twisting", "five-phase"}) {
    CAPTURE(controller);
    Setup setup;
    setup.control.controller = controller;
    setup.experiment.start_speed_rad_s = 0.0;  // the gate does not limit the first command of a run
    const double free_slip = simulated(setup).metrics.slip_overshoot;
    setup.gate.brake_rate_per_s = 0.5;  // 7.6 N m/s: 0.3 s to the torque of full grip
    const Result slow = simulated(setup);
    CHECK(slow.outcome.completed());
    CHECK(slow.metrics.slip_overshoot < free_slip + 0.05);
    const auto braking_records = slow.in_phase(rig::Phase::brake);
    REQUIRE(braking_records.size() > 1000);
    CHECK(braking_records.at(3).truth.brake_torque_Nm > 0.0);
    double before = 0.0;
    for (const rig::CycleRecord& record : braking_records) {
      REQUIRE(record.command.brake_duty <= std::max(before, setup.plant.rig.brake.u0) + 0.5e-3 + 1.0 / 4095.0);
      before = record.command.brake_duty;
    }
  }
}

TEST_CASE("a standing upper wheel teaches nothing about the tyre") {
  Setup setup = braking("adaptive");
  setup.experiment.start_speed_rad_s = 10.0;
  setup.control.adaptive.zeta0 = 100.0;
  for (const bool ideal : {false, true}) {
    setup.plant.ideal_sensors = ideal;
    const Result result = simulated(setup);
    double at_lock_N = rig::unknown;
    for (const rig::CycleRecord& record : result.in_phase(rig::Phase::brake)) {
      if (record.truth.speeds.omega1_rad_s != 0.0) continue;
      if (std::isnan(at_lock_N)) at_lock_N = record.control.theta_est_N;
      CHECK(record.control.theta_est_N <= at_lock_N);
    }
    CHECK(at_lock_N < 65.0);
  }
}

namespace {

/// Brakes with 1 N m, and from 0.2 s on gives one output that is no number.
class Breaking final : public control::SlipController {
 public:
  Breaking(std::size_t signal, double value, bool gives_all) : signal_{signal}, value_{value}, gives_all_{gives_all} {}
  void reset(const control::SlipInput&) noexcept override { time_s_ = 0.0; }
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& input) noexcept override {
    time_s_ += input.dt_s;
    control::SlipOutput output{.brake_torque_Nm = 1.0, .slip_ref = gives_all_ ? 0.1 : rig::unknown};
    if (!gives_all_) output.theta_est_N = output.slip_velocity_error_m_s = rig::unknown;
    if (time_s_ > 0.2) {
      const std::array<double*, 4> outputs{&output.brake_torque_Nm, &output.slip_velocity_error_m_s,
                                           &output.theta_est_N, &output.slip_ref};
      *outputs.at(signal_) = value_;
    }
    return output;
  }

 private:
  std::size_t signal_;
  double value_;
  bool gives_all_;
  double time_s_{0.0};
};

}  // namespace

TEST_CASE("an output of the controller that is no number ends the run before it acts, with its name") {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double value : {rig::unknown, infinity, -infinity}) {
    for (std::size_t signal = 0; signal < rig::controller_signals.size(); ++signal) {
      for (const bool gives_all : {true, false}) {
        CAPTURE(value, signal, gives_all);
        const Result result = simulated(
            braking("adaptive"), [] { return rig::Reason::none; },
            std::make_unique<Breaking>(signal, value, gives_all));
        // NaN of a signal that the controller never gave means that it still does not give it.
        if (!gives_all && signal != 0 && std::isnan(value)) {
          CHECK(result.outcome.reason != rig::Reason::controller_not_finite);
          continue;
        }
        CHECK(result.outcome.reason == rig::Reason::controller_not_finite);
        CHECK(rig::controller_signal(result.outcome.reason_value) == rig::controller_signals[signal]);
        REQUIRE(result.records.size() > 100);
        REQUIRE(result.records.size() < 210);
        for (const rig::CycleRecord& record : result.records) {
          REQUIRE(std::isfinite(record.command.brake_duty));
          REQUIRE(std::isfinite(record.control.brake_torque_ref_Nm));
          REQUIRE_FALSE(std::isinf(record.control.theta_est_N));
          REQUIRE_FALSE(std::isinf(record.control.slip_velocity_error_m_s));
          REQUIRE(std::isfinite(record.control.slip_ref));
        }
        CHECK(result.records[result.records.size() - 2].command.brake_duty == 0.0);  // in the same cycle
        CHECK(result.records.back().phase == rig::Phase::fault);
      }
    }
  }
}

namespace {

/// Reports two signals of its own. One of them takes another value after 0.2 s.
class Reporting final : public control::SlipController {
 public:
  Reporting(double first, double later) : first_{first}, later_{later} {}
  void reset(const control::SlipInput&) noexcept override { time_s_ = 0.0; }
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& input) noexcept override {
    time_s_ += input.dt_s;
    control::SlipOutput output{.brake_torque_Nm = 1.0};
    output.signals[0] = 1.0;
    output.signals[1] = time_s_ > 0.2 ? later_ : first_;
    output.signals[2] = rig::unknown;  // not one of its signals
    return output;
  }
  [[nodiscard]] std::span<const rig::Signal> signals() const noexcept override {
    static constexpr std::array<rig::Signal, 2> mine{{{"one_m", "m"}, {"two_m", "m"}}};
    return mine;
  }

 private:
  double first_;
  double later_;
  double time_s_{0.0};
};

}  // namespace

TEST_CASE("a signal of the controller's own that becomes no number ends the run, with its name") {
  const double infinity = std::numeric_limits<double>::infinity();
  const auto outcome = [](double first, double later) {
    return simulated(
               braking("adaptive"), [] { return rig::Reason::none; }, std::make_unique<Reporting>(first, later))
        .outcome;
  };
  const std::array<std::string, 2> names{"one_m", "two_m"};
  for (const double broken : {rig::unknown, infinity, -infinity}) {
    const run::RunOutcome ended = outcome(2.0, broken);
    CHECK(ended.reason == rig::Reason::controller_not_finite);
    CHECK(rig::controller_signal(ended.reason_value, names) == "two_m");
    CHECK(rig::controller_signal(ended.reason_value) == "own signal 2");
  }
  CHECK(outcome(infinity, infinity).reason == rig::Reason::controller_not_finite);
  // Unknown from the first cycle on, and known later: no fault.
  CHECK(outcome(rig::unknown, rig::unknown).reason != rig::Reason::controller_not_finite);
  CHECK(outcome(rig::unknown, 2.0).reason != rig::Reason::controller_not_finite);
  CHECK(rig::controller_signal(99.0, names).empty());
}
