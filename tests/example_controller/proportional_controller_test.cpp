#include "proportional_controller.hpp"

#include <cmath>
#include <stdexcept>

#include "abs_hil/control/registry.hpp"
#include "catch.hpp"
#include "control/braking_bench.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

namespace {

constexpr auto entry =
    control::controller_entry<example::ProportionalController>("proportional", "torque proportional to the slip error");

}  // namespace

TEST_CASE("The torque is proportional to the slip error") {
  const control::ControlOptions options;
  const rig::RigParameters rig;
  const auto controller = entry.make({options, rig});
  control::SlipInput input{.speeds = {140.0, 160.0}, .slip = 0.05, .slip_ref = 0.15};
  controller->reset(input);
  CHECK_THAT(controller->step(input).brake_torque_Nm, WithinAbs(2.0 + 10.0 * 0.10, 1e-12));
  input.slip = 0.35;
  CHECK_THAT(controller->step(input).brake_torque_Nm, WithinAbs(2.0 - 10.0 * 0.20, 1e-12));
  CHECK(std::isnan(controller->step(input).theta_est_N));
}

TEST_CASE("It brakes the rig near the wanted slip, with the real actuator and encoders") {
  bench::Setup setup;
  setup.ideal_actuator = false;
  setup.encoders = true;
  const auto controller = entry.make({setup.options, setup.rig});
  const auto run = bench::brake(setup, *controller);
  CHECK(run.stop_time_s < 3.19);  // a locked wheel takes 3.19 s
  CHECK(run.slip_rms < 0.15);
}

TEST_CASE("Options out of range are refused") {
  const control::ControlOptions options;
  const rig::RigParameters rig;
  const auto made = [&](example::ProportionalOptions o) { return example::ProportionalController{{options, rig}, o}; };
  CHECK_THROWS_AS(made({.base_Nm = -1.0}), std::invalid_argument);
  CHECK_THROWS_AS(made({.gain_Nm = 0.0}), std::invalid_argument);
}
