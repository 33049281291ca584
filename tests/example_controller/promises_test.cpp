// What every slip controller promises, whatever its law: scripts/new_controller.sh copies this file as the first test
// of a new one. It holds after an edit of the law, as long as the law brakes.

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "abs_hil/control/registry.hpp"
#include "catch.hpp"
#include "control/braking_bench.hpp"
#include "proportional_controller.hpp"

using namespace abs_hil;

namespace {

std::unique_ptr<control::SlipController> made(const example::ProportionalOptions& own = {}) {
  const control::ControlOptions options;
  return std::make_unique<example::ProportionalController>(control::ControllerContext{options, rig::RigParameters{}},
                                                           own);
}

/// The outputs over speeds and slips, from standstill to beyond what the rig reaches.
std::vector<control::SlipOutput> outputs_of(control::SlipController& controller) {
  std::vector<control::SlipOutput> outputs;
  control::SlipInput input{.slip_ref = 0.15};
  controller.reset(input);
  for (const double lower_rad_s : {0.0, 3.0, 60.0, 180.0, 400.0}) {
    for (const double slip : {-1.0, 0.0, 0.05, 0.15, 0.5, 1.0}) {
      input.speeds = {.omega1_rad_s = lower_rad_s * (1.0 - slip), .omega2_rad_s = lower_rad_s};
      input.slip = slip;
      outputs.push_back(controller.step(input));
      input.dt_s = 0.001;
    }
  }
  return outputs;
}

}  // namespace

TEST_CASE("It stops the rig sooner than a locked wheel, with the real actuator and encoders") {
  bench::Setup setup;
  setup.ideal_actuator = false;
  setup.encoders = true;
  const auto controller = made();
  CHECK(bench::brake(setup, *controller).stop_time_s < bench::brake(setup, "locked").stop_time_s);
}

TEST_CASE("The torque is a number at every speed and slip; an estimate is known always or never") {
  const auto controller = made();
  const std::vector<control::SlipOutput> outputs = outputs_of(*controller);
  for (const control::SlipOutput& output : outputs) {
    CHECK(std::isfinite(output.brake_torque_Nm));
    CHECK(std::isnan(output.theta_est_N) == std::isnan(outputs.front().theta_est_N));
  }
}

TEST_CASE("A reset forgets all of the braking before") {
  const auto controller = made();
  const std::vector<control::SlipOutput> first = outputs_of(*controller), second = outputs_of(*controller);
  for (std::size_t i = 0; i < first.size(); ++i) CHECK(first[i].brake_torque_Nm == second[i].brake_torque_Nm);
}

TEST_CASE("A value that is not a number is refused for each key, by its name") {
  example::ProportionalOptions own;
  rig::for_each_option(own, "control.proportional.", [&](const std::string& name, const auto&, auto& value) {
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, double>) {
      const double before = std::exchange(value, std::numeric_limits<double>::quiet_NaN());
      CHECK_THROWS_WITH(made(own), Catch::Matchers::Contains(name));
      value = before;
    }
  });
}
