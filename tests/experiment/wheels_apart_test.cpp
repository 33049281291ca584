// Runs in which the upper wheel is lifted off the lower one and lowered again: no check of the gate speaks without a
// fault, and each fault that can still be found is found.

#include <algorithm>

#include "catch.hpp"
#include "injected_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;
using rig::Reason;

namespace {

PhasePlan phase(rig::Phase kind, const char* name, double lasts_s) {
  return {.phase = kind,
          .name = name,
          .ends_on = {{EndKind::duration, lasts_s, Reason::phase_duration_over}},
          .time_limit_s = lasts_s + 1.0};
}

/// Run up together, part, brake the free upper wheel, drive the lower one alone, join, brake both.
Setup lifted() {
  Setup setup;
  PhasePlan up = phase(rig::Phase::accelerate, "up", 2.4);
  up.motor_duty = 1.0;
  PhasePlan out = phase(rig::Phase::coast, "lifted", 4.0);
  out.wheels_apart = true;
  PhasePlan step = phase(rig::Phase::brake, "step", 0.5);
  step.wheels_apart = true;
  step.brake = BrakeAction::torque;
  step.brake_torque_Nm = 2.0;
  PhasePlan drive = phase(rig::Phase::accelerate, "drive", 2.0);
  drive.wheels_apart = true;
  drive.motor_duty = 0.6;
  const PhasePlan roll = phase(rig::Phase::coast, "roll", 5.0);
  PhasePlan stop = phase(rig::Phase::brake, "stop", 1.0);
  stop.brake = BrakeAction::torque;
  stop.brake_torque_Nm = 2.0;
  PhasePlan end = phase(rig::Phase::hold, "end", 1.0);
  end.ends_on = {{EndKind::standstill, 0.0, Reason::standstill_reached}};
  end.time_limit_s = 20.0;
  end.brake = BrakeAction::torque;
  end.brake_torque_Nm = 2.0;
  setup.plans = {up, out, step, drive, roll, stop, end};
  return setup;
}

}  // namespace

TEST_CASE("wheels that part and join in a run trip no check, and the records tell when they do") {
  for (const char* load : {"constant", "lever"}) {
    CAPTURE(load);
    Setup setup = lifted();
    setup.plant.load = load;
    const Result result = simulated(setup);
    CHECK(result.outcome.reason == Reason::sequence_complete);
    for (const rig::CycleRecord& record : result.records) {
      const bool apart = record.phase_index >= 1 && record.phase_index <= 3;
      REQUIRE(record.wheels_apart == apart);
    }
    // After the lift the wheels run out alone, at different rates; later they roll together again.
    const auto last_of = [&](std::uint16_t index) {
      const auto is_it = [index](const rig::CycleRecord& record) { return record.phase_index == index; };
      return *std::find_if(result.records.rbegin(), result.records.rend(), is_it);
    };
    CHECK(last_of(3).truth.speeds.omega1_rad_s < 0.5 * last_of(3).truth.speeds.omega2_rad_s);
    CHECK(std::abs(last_of(4).truth.slip) < 0.01);
  }
}

TEST_CASE("the same run with wheels that nobody said are apart would not pass") {
  // What the checks see is the same; only the statement differs.
  Setup setup = lifted();
  for (PhasePlan& plan : setup.plans) plan.wheels_apart = false;
  runtime::VirtualClock clock;
  class Lifted final : public driver::RigDriver {
   public:
    explicit Lifted(const Setup& s) : sim_(s.plant, {}) {}
    ~Lifted() override { static_cast<void>(deactivate()); }
    [[nodiscard]] std::string_view name() const noexcept override { return "lifted"; }

   private:
    void do_configure() override { sim_.configure(); }
    void do_activate(std::int64_t now_ns) override { sim_.activate(now_ns); }
    driver::IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
      sim_.note_wheels_apart(now_ns > 2'900'000'000);
      return sim_.read(now_ns, measurement);
    }
    driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
      return sim_.write(command, sent);
    }
    driver::IoResult do_make_safe() noexcept override { return sim_.deactivate(); }
    driver::SimDriver sim_;
  } driver(setup);
  Recorder recorder;
  SetupRun run(setup, {.clock = &clock, .driver = &driver});
  run->record_into({&recorder});
  const run::RunOutcome outcome = run->go(go_on);
  CHECK((outcome.reason == Reason::released_wheel_stands || outcome.reason == Reason::encoders_disagree ||
         outcome.reason == Reason::encoder_upper_stuck));
}

TEST_CASE("faults of one wheel are found while the wheels are apart") {
  struct Case {
    const char* fault;
    Reason reason;
    const char* phase;
  };
  for (const Case& c : {Case{"coast@encoder_upper:stuck+0.5s", Reason::encoder_upper_stuck, "lifted"},
                        Case{"coast@encoder_lower:stuck+0.5s", Reason::encoder_lower_stuck, "lifted"},
                        Case{"coast@encoder_upper:wrong=-1+0.5s", Reason::encoder_upper_reversed, "lifted"},
                        Case{"coast@encoder_lower:wrong=-1+0.5s", Reason::encoder_lower_reversed, "lifted"},
                        Case{"brake@brake_pwm:off", Reason::brake_no_response, "step"},
                        Case{"coast@motor_pwm:off", Reason::motor_no_response, "drive"},
                        Case{"accelerate@motor_pwm:stuck+1s,accelerate@enable:stuck+1s",
                             Reason::speed_rises_with_motor_off, "lifted"}}) {
    CAPTURE(c.fault);
    const InjectedResult result = run_injected(lifted(), config::parse_injections(c.fault));
    CHECK(result.outcome.reason == c.reason);
    const Setup setup = lifted();
    CHECK(setup.plans.at(result.records.back().phase_index).name == c.phase);
    CHECK(result.outputs.motor_duty == 0.0);
    CHECK(result.outputs.brake_duty == 0.0);
  }
}

TEST_CASE("a run that ends early leaves the wheels as they are") {
  Setup setup = lifted();
  int polls = 0;
  const Result result = simulated(setup, [&polls] { return ++polls == 4 ? Reason::stop_command : Reason::none; });
  CHECK(result.outcome.reason == Reason::stop_command);
  CHECK(result.records.back().wheels_apart);
}

TEST_CASE("slip control is refused while the wheels are apart") {
  Setup setup = lifted();
  setup.plans[2].brake = BrakeAction::slip_control;
  CHECK_THROWS_WITH(Sequence(setup.plans), Catch::Matchers::Contains("no slip to control"));
}
