// From an experiment's script to the plan of its phases.
#include "config/plan.hpp"

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::config;
using Catch::Matchers::Contains;
using experiment::BrakeAction;
using experiment::EndKind;

namespace {

Script parsed(const std::string& text) {
  return parse(text, "test.toml", [](const std::string&) { return std::nullopt; });
}

constexpr const char* brake =
    "[[phase]]\nname = \"a\"\nbrake = { slip_ref = { from = 0.1, to = 0.3, over_s = 2 } }\n"
    "until = { lasts_s = 2 }\n";

std::vector<std::string> names_of(const Plan& plan) {
  std::vector<std::string> names;
  for (const experiment::PhasePlan& phase : plan.phases) names.push_back(phase.name);
  return names;
}

}  // namespace

TEST_CASE("the paper's script gives the plan that C++ code gave before") {
  config::Settings s;
  const Plan whole = plan(*find("paper"), s);
  CHECK(names_of(whole) == std::vector<std::string>{"idle", "accelerate", "coast", "brake", "hold", "stopped"});
  CHECK(whole.phases[1].motor_duty.at(0.0) == 1.0);
  REQUIRE(whole.phases[1].ends_on.size() == 1);
  CHECK(whole.phases[1].ends_on[0].value == 170.0);
  CHECK(whole.phases[0].time_limit_s == 1.05);
  CHECK(whole.phases[4].brake_torque_Nm.at(0.0) == 2.0);
  s.experiment.cut = "peak";
  CHECK(plan(*find("paper"), s).phases[1].ends_on[0].kind == EndKind::upper_wheel_peak);
  s.experiment.start_speed_rad_s = 100.0;
  CHECK(names_of(plan(*find("paper"), s)) == std::vector<std::string>{"brake", "hold", "stopped"});
}

TEST_CASE("slip control always ends at the least speed for it, whatever the script says") {
  config::Settings s;
  s.control.v_min_m_s = 0.7;
  const Plan made = plan(parsed(brake), s);
  const experiment::EndCondition& last = made.phases[0].ends_on.back();
  CHECK(last.kind == EndKind::car_speed_below);
  CHECK(last.value == 0.7);
  CHECK(last.reason == rig::Reason::slip_control_left_at_low_speed);
  CHECK(made.phases[0].phase == rig::Phase::brake);
  CHECK(made.phases[0].slip_ref.at(1.0) == 0.2);
}

TEST_CASE("a phase that ends above the least speed gets no second condition") {
  config::Settings s;
  s.experiment.end_speed_m_s = s.control.v_min_m_s = 0.3;
  CHECK(plan(*find("paper"), s).phases[3].ends_on.size() == 1);
  s.control.v_min_m_s = 0.4;
  const auto ends = plan(*find("paper"), s).phases[3].ends_on;
  REQUIRE(ends.size() == 2);
  CHECK(ends[1].value == 0.4);
  // A condition with a further part may hold too late, so the least speed is added.
  const Script both = parsed(
      "[[phase]]\nname = \"a\"\nbrake = \"controller\"\nat_most_s = 3\n"
      "until.all = [{ car_speed_below_m_s = 1 }, { distance_m = 5 }]\n");
  CHECK(plan(both, s).phases[0].ends_on.size() == 2);
}

TEST_CASE("a configuration value out of the range it is used in is refused with its key") {
  config::Settings s;
  s.experiment.hold_torque_Nm = 1.0;
  const Script script =
      parsed("[[phase]]\nname = \"a\"\nmotor = \"$experiment.motor_duty\"\nuntil = { lasts_s = 1 }\n");
  s.experiment.motor_duty = 3.0;
  CHECK_THROWS_WITH(plan(script, s),
                    Contains("test.toml:3:9") && Contains("$experiment.motor_duty is 3") && Contains("[0, 1]"));
}

TEST_CASE("a script whose every phase is left out is refused") {
  const Script script = parsed("[[phase]]\nname = \"a\"\nwhen = \"control.slip_ref > 0.5\"\nuntil = { lasts_s = 1 }\n");
  CHECK_THROWS_WITH(plan(script, config::Settings{}), Contains("leaves out every phase"));
}

TEST_CASE("limits of a script only tighten") {
  const Script script =
      parsed(std::string(brake) + "[limits]\nwheel_speed_rad_s = 100\nbrake_duty = 0.9\nrun_time_s = 5\n");
  config::Settings s;
  s.gate.brake_duty_max = 0.7;
  apply(script, s);
  CHECK(s.gate.overspeed_rad_s == 100.0);
  CHECK(s.gate.brake_duty_max == 0.7);
  CHECK(plan(script, s).limits.run_time_s == 5.0);
}

TEST_CASE("the simulated board's cap of the brake caps the gate, as a board's does") {
  const Script script = parsed(brake);
  config::Settings s;
  s.plant.brake_duty_max = 0.7;
  apply(script, s);
  CHECK(s.gate.brake_duty_max == 0.7);
  s.gate.brake_duty_max = 0.5;
  apply(script, s);
  CHECK(s.gate.brake_duty_max == 0.5);

  config::Settings rig;  // whose own driver has a cap; it has no simulated plant
  rig.backend = "rig";
  rig.plant.brake_duty_max = 0.7;
  apply(script, rig);
  CHECK(rig.gate.brake_duty_max == 1.0);
}

TEST_CASE("values beyond the rig's limits are named with phase, value and limit") {
  config::Settings s;
  s.gate.brake_duty_max = 0.7;
  const Script script = parsed(
      "[[phase]]\nname = \"hard\"\nbrake = { torque_Nm = { from = 0, to = 6, over_s = 1 } }\nuntil = { lasts_s = 1 "
      "}\n");
  const auto problems = beyond_limits(plan(script, s), s);
  REQUIRE(problems.size() == 1);
  CHECK(problems[0] == "phase \"hard\": brake torque 6 N m is more than the 4.458 N m that gate.brake_duty_max allows");
  s.gate.brake_duty_max = 1.0;
  CHECK(beyond_limits(plan(script, s), s).empty());
}

TEST_CASE("limits that every run must exceed are named") {
  const auto faults = [](const std::string& ends, const std::string& limits) {
    std::string script;
    for (const char* name : {"a", "b"}) script += "[[phase]]\nname = \"" + std::string(name) + "\"\n" + ends + "\n";
    Settings s;
    const Script read = parsed(script + "[limits]\n" + limits);
    apply(read, s);
    return certain_faults(plan(read, s), s);
  };
  const std::string fast = "{ upper_speed_above_rad_s = 100 }";
  CHECK(faults("until = " + fast + "\nat_most_s = 3", "wheel_speed_rad_s = 90").at(1) ==
        "phase \"b\" waits for a wheel speed of at least 100 rad/s, but limits.wheel_speed_rad_s "
        "(gate.overspeed_rad_s) is 90 rad/s: every run ends as a fault; change one");
  CHECK(faults("until = " + fast + "\nat_most_s = 3", "wheel_speed_rad_s = 100").empty());
  CHECK(faults("until.any = [" + fast + ", { lasts_s = 1 }]", "wheel_speed_rad_s = 90").empty());
  CHECK(faults("until.all = [" + fast + ", { lasts_s = 1 }]\nat_most_s = 3", "wheel_speed_rad_s = 90").size() == 2);
  CHECK(faults("until = { car_speed_above_m_s = 10 }\nat_most_s = 3", "wheel_speed_rad_s = 90").size() == 2);
  const auto late = faults("until = { lasts_s = 5 }\nat_most_s = 3", "");
  REQUIRE(late.size() == 2);
  CHECK(late[1] == "phase \"b\" lasts at least 5 s, but its at_most_s is 3 s: every run ends as a fault; change one");
  CHECK(faults("until = { lasts_s = 3 }\nat_most_s = 3", "run_time_s = 6").empty());
  CHECK_THAT(faults("until = { lasts_s = 0.3 }", "run_time_s = 0.5").at(0), Contains("run lasts at least 0.6 s"));
  CHECK_THAT(faults("until = { distance_m = 2 }\nat_most_s = 3", "distance_m = 3").at(0),
             Contains("goes at least 4 m"));
  // Any of several may end a phase; of `all` the last one does.
  const std::string more = "[{ lasts_s = 2 }, { distance_m = 2 }, { upper_wheel_peak_s = 2 }]\nat_most_s = 1";
  CHECK(faults("until.any = " + more, "run_time_s = 1\ndistance_m = 1").empty());
  CHECK(faults("until.all = " + more, "run_time_s = 1\ndistance_m = 1").size() == 4);
  CHECK(faults("until = { upper_wheel_peak_s = 2 }\nat_most_s = 1", "").size() == 2);
}

TEST_CASE("friction events make a profile; the configuration's own stays") {
  const std::string event = "[[event]]\nat_s = 1\nfriction = 0.5\ncounted_from = \"braking\"\n";
  const Script script = parsed(std::string(brake) + event +
                               "[[event]]\nat_s = 2\nover_s = 0.5\nfriction = 1\ncounted_from = \"braking\"\n");
  CHECK(profile(script, "friction") == "braking time: 1; 0.5 at 1; 1 from 2 to 2.5");
  config::Settings s;
  s.plant.friction_profile = "time: 0.7";
  apply(script, s);
  CHECK(s.plant.friction_profile == "time: 0.7");
}

TEST_CASE("every part of the plant has its own events and its own time base") {
  const Script script = parsed(std::string(brake) +
                               "[[event]]\nat_s = 0\nbrake_torque = \"80 %\"\nfriction = 0.9\n"
                               "[[event]]\nat_s = 1\nuntil = \"1.5 min\"\nbrake_torque = 0.5\nlower_bearing = 3\n"
                               "[[event]]\nat_s = 2\nover_s = 1\nupper_bearing = 2\ncounted_from = \"braking\"\n"
                               "[[event]]\nat_s = 90\nbrake_torque = 1\nmotor_torque = 0.7\n"
                               "[[event]]\nat_s = 91\nbrake_torque = 0.8\n");
  config::Settings s;
  s.plant.drift.motor_torque = "time: 0.4";
  apply(script, s);
  CHECK(s.plant.friction_profile == "time: 0.9");
  CHECK(s.plant.drift.brake_torque == "time: 0.8; 0.5 from 1 to 90; 1 at 90; 0.8 at 91");
  CHECK(s.plant.drift.upper_bearing == "braking time: 1; 2 from 2 to 3");
  CHECK(s.plant.drift.lower_bearing == "time: 1; 3 from 1 to 90");
  CHECK(s.plant.drift.motor_torque == "time: 0.4");
}

TEST_CASE("a phase may restart the slip controller that the phase before used") {
  const std::string two =
      "[[phase]]\nname = \"a\"\nbrake = \"controller\"\nuntil = { lasts_s = 1 }\n"
      "[[phase]]\nname = \"b\"\nbrake = \"controller\"\nuntil = { lasts_s = 1 }\n";
  CHECK_FALSE(plan(parsed(two), {}).phases[1].restart);
  CHECK(plan(parsed(two + "restart = true\n"), {}).phases[1].restart);
}
