// What holds for the proportional law alone: its closed form and its gains' ranges.

#include "proportional_controller.hpp"

#include <cmath>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "abs_hil/control/registry.hpp"
#include "catch.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;

namespace {

example::ProportionalController made(const example::ProportionalOptions& own = {}) {
  const control::ControlOptions options;
  const rig::RigParameters rig;
  return example::ProportionalController{{options, rig}, own};
}

}  // namespace

TEST_CASE("The torque is proportional to the slip error") {
  auto controller = made();
  control::SlipInput input{.speeds = {140.0, 160.0}, .slip = 0.05, .slip_ref = 0.15};
  controller.reset(input);
  CHECK_THAT(controller.step(input).brake_torque_Nm, WithinAbs(2.0 + 10.0 * 0.10, 1e-12));
  input.slip = 0.35;
  CHECK_THAT(controller.step(input).brake_torque_Nm, WithinAbs(2.0 - 10.0 * 0.20, 1e-12));
  CHECK(std::isnan(controller.step(input).theta_est_N));
}

TEST_CASE("A gain of zero and a negative torque are refused") {
  CHECK_THROWS_AS(made({.base_Nm = -1.0}), std::invalid_argument);
  CHECK_THROWS_AS(made({.gain_Nm = 0.0}), std::invalid_argument);
}

TEST_CASE("A registered controller's options are options of the configuration, each in its own copy") {
  control::register_controller(
      control::controller_entry<example::ProportionalController>("p-only", "torque proportional to the slip error"));
  control::ControlOptions options;
  const control::ControlOptions before = options;
  std::string names;
  rig::for_each_option(options, "control.", [&](const std::string& name, const rig::OptionFacts&, auto& value) {
    if (!name.starts_with("control.p_only.")) return;
    names += name + ' ';
    if constexpr (std::is_same_v<std::remove_cvref_t<decltype(value)>, double>) value *= 2.0;
  });
  CHECK(names == "control.p_only.base_Nm control.p_only.gain_Nm ");
  control::SlipInput input{.speeds = {140.0, 160.0}, .slip = 0.05, .slip_ref = 0.15};
  const auto torque_Nm = [&](const control::ControlOptions& of) {
    const auto controller = control::make_controller("p-only", {of, rig::RigParameters{}});
    controller->reset(input);
    return controller->step(input).brake_torque_Nm;
  };
  CHECK_THAT(torque_Nm(options), WithinAbs(4.0 + 20.0 * 0.10, 1e-12));
  CHECK_THAT(torque_Nm(before), WithinAbs(2.0 + 10.0 * 0.10, 1e-12));
}
