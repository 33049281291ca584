// The paper's experiment: its phases, their order, and what never happens together.
#include "catch.hpp"
#include "simulated_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment::test;
using Catch::Matchers::WithinAbs;
using rig::Phase;
using rig::Reason;

TEST_CASE("the paper's experiment goes through its phases in order") {
  const Result result = simulated({});
  CHECK(result.outcome.completed());
  std::vector<Phase> phases;
  std::vector<Reason> reasons;
  for (const auto& record : result.records) {
    if (phases.empty() || phases.back() != record.phase) {
      phases.push_back(record.phase);
      reasons.push_back(record.reason);
    }
  }
  CHECK(phases == std::vector{Phase::idle, Phase::accelerate, Phase::coast, Phase::brake, Phase::hold, Phase::stopped});
  CHECK(reasons == std::vector{Reason::run_started, Reason::phase_duration_over, Reason::speed_threshold_reached,
                               Reason::phase_duration_over, Reason::end_speed_reached, Reason::standstill_reached});
  CHECK_THAT(result.metrics.brake_start_s, WithinAbs(6.2, 0.15));
  CHECK(result.records.front().time_s == 0.0);
  CHECK(result.records.back().truth.speeds.omega2_rad_s == 0.0);
}

TEST_CASE("motor and brake never act together, and the last command is the safe one") {
  const Result result = simulated({});
  for (const auto& record : result.records) {
    if (record.phase != Phase::accelerate) {
      CHECK(record.command.motor_duty == 0.0);
      CHECK_FALSE(record.command.motor_enable);
    } else {
      CHECK(record.command.brake_duty == 0.0);
    }
  }
  const rig::Command& last = result.records.back().command;
  CHECK(last.motor_duty == 0.0);
  CHECK(last.brake_duty == 0.0);
}

TEST_CASE("distance counts from the start of braking and never falls") {
  const Result result = simulated({});
  for (std::size_t i = 1; i < result.records.size(); ++i) {
    if (result.records[i].time_s <= result.metrics.brake_start_s) CHECK(result.distances_m[i] == 0.0);
    CHECK(result.distances_m[i] >= result.distances_m[i - 1]);
  }
  CHECK(result.distances_m.back() >= result.metrics.stop_distance_m);
}

TEST_CASE("the motor is also cut at the detected peak of the upper wheel's speed") {
  Setup setup;
  setup.experiment.cut = "peak";
  setup.experiment.motor_duty = 0.6;
  setup.experiment.accelerate_limit_s = 60.0;
  const Result result = simulated(setup);
  CHECK(result.outcome.completed());
  const auto accelerating = result.in_phase(Phase::accelerate);
  double fastest = 0.0;
  for (const auto& record : result.records) fastest = std::max(fastest, record.truth.speeds.omega1_rad_s);
  CHECK(accelerating.back().truth.speeds.omega1_rad_s > 0.97 * fastest);
  CHECK(fastest > 60.0);
}

TEST_CASE("a motor too weak for the threshold runs into the time limit: a fault, and everything off") {
  Setup setup;
  setup.experiment.motor_duty = 0.3;
  setup.experiment.accelerate_limit_s = 3.0;
  const Result result = simulated(setup);
  CHECK_FALSE(result.outcome.completed());
  CHECK(result.outcome.reason == Reason::phase_time_limit);
  CHECK(result.records.back().phase == Phase::fault);
  CHECK(result.records.back().command.motor_duty == 0.0);
}

TEST_CASE("overspeed latches a fault in the cycle that sees it") {
  Setup setup;
  setup.gate.overspeed_rad_s = 100.0;
  const Result result = simulated(setup);
  CHECK(result.outcome.reason == Reason::overspeed);
  CHECK_THAT(result.outcome.reason_value, WithinAbs(100.0, 1.0));
  for (const auto& record : result.records) {
    if (std::max(record.control.speeds_est.omega1_rad_s, record.control.speeds_est.omega2_rad_s) > 100.0) {
      CHECK(record.command.motor_duty == 0.0);
    }
  }
}

TEST_CASE("a stop request ends the run with everything off") {
  int polls = 0;
  const Result result = simulated({}, [&polls] { return ++polls > 2 ? Reason::interrupt_signal : Reason::none; });
  CHECK(result.outcome.reason == Reason::interrupt_signal);
  CHECK(result.records.back().phase == Phase::stopped);
  CHECK(result.records.back().command.motor_duty == 0.0);
  CHECK(result.records.size() < 4100);
}

TEST_CASE("the same seed gives the same run; another seed gives other encoder phases") {
  const auto last_counts = [](std::uint64_t seed) {
    Setup setup = braking("adaptive");
    setup.seed = seed;
    const Result result = simulated(setup);
    double sum = 0.0;
    for (const auto& record : result.records)
      sum += record.control.theta_est_N == record.control.theta_est_N ? record.control.theta_est_N : 0.0;
    return sum;
  };
  CHECK(last_counts(7) == last_counts(7));
  CHECK(last_counts(7) != last_counts(8));
}

TEST_CASE("an end speed below the least speed for slip control: the brake holds in between") {
  Setup setup = braking("adaptive");
  setup.experiment.end_speed_m_s = 0.1;
  const Result result = simulated(setup);
  CHECK(result.outcome.completed());
  CHECK(result.in_phase(Phase::hold).front().reason == Reason::slip_control_left_at_low_speed);
  CHECK(result.metrics.stop_time_s > simulated(braking("adaptive")).metrics.stop_time_s);
}
