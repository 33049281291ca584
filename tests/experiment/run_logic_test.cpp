#include "abs_hil/experiment/run_logic.hpp"

#include "catch.hpp"
#include "simulated_run.hpp"

using namespace abs_hil;
using namespace abs_hil::experiment;
using namespace abs_hil::experiment::test;

TEST_CASE("a measurement repeated with the same time stamp changes no estimate") {
  RunLogic logic(logic_parts(braking("adaptive")));
  rig::CycleRecord record;
  static_cast<void>(logic.step({.time_ns = 1000}, record));
  logic.commanded(rig::safe_command);
  const rig::WheelSpeeds before = record.control.speeds_est;
  static_cast<void>(logic.step({.time_ns = 1000}, record));
  CHECK(record.control.speeds_est.omega1_rad_s == before.omega1_rad_s);
  CHECK(record.control.speeds_est.omega2_rad_s == before.omega2_rad_s);
}

TEST_CASE("the torque estimate follows what was sent, not what was asked for") {
  RunLogic logic(logic_parts(braking("adaptive")));
  rig::CycleRecord record;
  static_cast<void>(logic.step({.time_ns = 0}, record));
  CHECK(record.control.brake_torque_ref_Nm > 0.0);
  logic.commanded(rig::safe_command);  // the gate let nothing pass
  static_cast<void>(logic.step({.time_ns = 1'000'000}, record));
  CHECK(record.control.brake_torque_est_Nm == 0.0);
}

TEST_CASE("an unknown experiment names the known ones") {
  ExperimentOptions options;
  options.name = "parade";
  CHECK_THROWS_WITH(plan_experiment(options, 0.3),
                    Catch::Matchers::Contains("parade") && Catch::Matchers::Contains("paper"));
}
