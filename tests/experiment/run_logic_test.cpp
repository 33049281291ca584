// The logic of a run between measurement and command: estimates, the stop brake, phases in a row.
#include "experiment/run_logic.hpp"

#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>

#include "catch.hpp"
#include "control/tracking_observer.hpp"
#include "rig/encoder_scale.hpp"
#include "simulated_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;

TEST_CASE("a measurement repeated with the same time stamp changes no estimate") {
  RunLogic logic(logic_parts(braking("adaptive")));
  runtime::RunLatch latch;
  rig::CycleRecord record;
  static_cast<void>(logic.step({.time_ns = 1000}, latch, record));
  logic.commanded(rig::safe_command);
  const rig::WheelSpeeds before = record.control.speeds_est;
  static_cast<void>(logic.step({.time_ns = 1000}, latch, record));
  CHECK(record.control.speeds_est.omega1_rad_s == before.omega1_rad_s);
  CHECK(record.control.speeds_est.omega2_rad_s == before.omega2_rad_s);
}

TEST_CASE("the torque estimate follows the sent command, not the wanted one") {
  RunLogic logic(logic_parts(braking("adaptive")));
  runtime::RunLatch latch;
  rig::CycleRecord record;
  static_cast<void>(logic.step({.time_ns = 0}, latch, record));
  CHECK(record.control.brake_torque_ref_Nm > 0.0);
  logic.commanded(rig::safe_command);  // the gate blocked the command
  static_cast<void>(logic.step({.time_ns = 1'000'000}, latch, record));
  CHECK(record.control.brake_torque_est_Nm == 0.0);
}

TEST_CASE("a duty at its limit is no intervention, and the output stays below the limit") {
  RunLogic logic(logic_parts(braking("adaptive")));
  runtime::CommandGate gate = logic.make_gate({.brake_duty_max = 0.5});
  const runtime::GateResult result = gate.check({.brake_duty = 0.5}, {.phase = rig::Phase::brake});
  CHECK(result.action == runtime::GateAction::passed);
  CHECK(result.command.brake_duty == 2047.0 / 4095.0);
}

namespace {

/// Records its inputs.
class Probe final : public control::SlipController {
 public:
  explicit Probe(control::SlipInput& seen) : seen_{seen} {}
  void reset(const control::SlipInput&) noexcept override {}
  [[nodiscard]] control::SlipOutput step(const control::SlipInput& input) noexcept override {
    seen_ = input;
    return {};
  }

 private:
  control::SlipInput& seen_;
};

}  // namespace

TEST_CASE("controllers get the observers' accelerations, or the mean over the past cycle if speeds are true") {
  for (const bool ideal : {false, true}) {
    control::SlipInput seen;
    const auto setup = braking("adaptive");
    RunLogicParts parts = logic_parts(setup);
    const control::ObserverOptions observer = parts.control.observer;
    const std::int32_t per_rev = parts.rig.encoder_counts_per_rev;
    parts.controller = std::make_unique<Probe>(seen);
    RunLogic logic(std::move(parts));
    control::TrackingObserver upper(observer, per_rev), lower(observer, per_rev);
    runtime::RunLatch latch;
    rig::CycleRecord record;
    double omega1_before = 0.0, omega2_before = 0.0;
    for (int n = 0; n <= 300; ++n) {
      // Both wheels decelerate steadily, the upper one at 90 rad/s^2, the lower one at 70.
      const double t = 1e-3 * n;
      const double omega1 = 170.0 - 90.0 * t, omega2 = 170.0 - 70.0 * t;
      const auto counts = [&](double omega, double alpha) {
        return static_cast<std::int32_t>((omega * t + 0.5 * alpha * t * t) / rig::radians_per_count(per_rev));
      };
      rig::Measurement measurement{
          .time_ns = n * 1'000'000, .upper_counts = counts(170.0, -90.0), .lower_counts = counts(170.0, -70.0)};
      if (ideal) measurement.ideal_speeds = rig::WheelSpeeds{omega1, omega2};
      static_cast<void>(logic.step(measurement, latch, record));
      logic.commanded(rig::safe_command);
      if (n == 0) {
        upper.reset(0, 170.0);
        lower.reset(0, 170.0);
        CHECK(seen.alpha1_rad_s2 == 0.0);
        CHECK(seen.alpha2_rad_s2 == 0.0);
      } else {
        upper.update(measurement.upper_counts, 1e-3);
        lower.update(measurement.lower_counts, 1e-3);
        const double alpha1 = ideal ? (omega1 - omega1_before) / 1e-3 : upper.alpha_rad_s2();
        const double alpha2 = ideal ? (omega2 - omega2_before) / 1e-3 : lower.alpha_rad_s2();
        CHECK_THAT(seen.alpha1_rad_s2, Catch::Matchers::WithinAbs(alpha1, 1e-6));
        CHECK_THAT(seen.alpha2_rad_s2, Catch::Matchers::WithinAbs(alpha2, 1e-6));
      }
      omega1_before = omega1;
      omega2_before = omega2;
    }
    CHECK_THAT(seen.alpha1_rad_s2, Catch::Matchers::WithinAbs(-90.0, ideal ? 1e-6 : 5.0));
    CHECK_THAT(seen.alpha2_rad_s2, Catch::Matchers::WithinAbs(-70.0, ideal ? 1e-6 : 5.0));
  }
}

TEST_CASE("the stop brake acts within the gate's cap until standstill and is then released") {
  Setup setup;
  setup.experiment.stop_brake_duty = 0.9;
  setup.gate.brake_duty_max = 0.7;
  // The stop request comes after a second of acceleration.
  const Result result = simulated(setup, [] { return rig::Reason::terminate_signal; });
  CHECK(result.outcome.reason == rig::Reason::terminate_signal);
  CHECK(result.outcome.safe_state.ok());
  const auto braking = result.in_phase(rig::Phase::hold);
  REQUIRE(braking.size() > 100);
  CHECK(braking.front().reason == rig::Reason::terminate_signal);
  CHECK(braking.front().truth.speeds.omega2_rad_s > 20.0);
  for (const rig::CycleRecord& record : braking) {
    CHECK(record.command.motor_duty == 0.0);
    CHECK(record.command.brake_duty == 2866.0 / 4095.0);  // the last step of the PWM below the cap
  }
  const rig::CycleRecord& last = result.records.back();
  CHECK(last.phase == rig::Phase::stopped);
  CHECK(last.command.brake_duty == 0.0);
  CHECK(last.truth.speeds.omega2_rad_s < 0.5);

  setup.experiment.stop_brake_limit_s = 0.2;
  CHECK(simulated(setup, [] { return rig::Reason::terminate_signal; }).in_phase(rig::Phase::hold).size() == 200);
  setup.experiment.stop_brake_duty = 0.0;
  CHECK(simulated(setup, [] { return rig::Reason::terminate_signal; }).in_phase(rig::Phase::hold).empty());
}

TEST_CASE("a controller goes on over consecutive phases that use it, unless the second restarts it") {
  const PhasePlan whole{.phase = rig::Phase::brake,
                        .brake = BrakeAction::slip_control,
                        .ends_on = {{EndKind::duration, 1.0, rig::Reason::phase_duration_over}},
                        .time_limit_s = 2.0};
  PhasePlan half = whole;
  half.ends_on.front().value = 0.5;
  PhasePlan anew = half;
  anew.restart = true;
  for (const control::ControllerEntry& entry : control::controllers()) {
    const std::string_view controller = entry.name;
    INFO(controller);
    Setup one = braking(std::string(controller)), two = one, restarted = one;
    one.plans = {whole};
    two.plans = {half, half};
    restarted.plans = {half, anew};
    const auto expected = simulated(one).records, split = simulated(two).records, begun = simulated(restarted).records;
    std::size_t differing = 0;
    for (std::size_t n = 0; n + 1 < expected.size(); ++n) {
      CHECK(split[n].command.brake_duty == expected[n].command.brake_duty);
      CHECK(std::bit_cast<std::uint64_t>(split[n].control.theta_est_N) ==
            std::bit_cast<std::uint64_t>(expected[n].control.theta_est_N));
      if (begun[n].command.brake_duty != expected[n].command.brake_duty) ++differing;
    }
    CHECK(split[600].phase_index == 1);
    // The laws without a memory begin anew unseen.
    if (!std::isnan(expected[600].control.theta_est_N)) CHECK(differing > 0);
  }
}

TEST_CASE("a run with injected faults is refused where nothing injects them") {
  config::Settings settings;  // this program has no extra
  settings.inject = "brake@write:off";
  const run::Prepared prepared(settings);
  CHECK_THROWS_WITH(run::Run(prepared), Catch::Matchers::Contains("run.inject = brake@write:off") &&
                                            Catch::Matchers::Contains("-DABS_HIL_INJECTION=ON"));
}
