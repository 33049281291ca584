// The table of controllers: making one by name, adding one, and what is refused.
#include "abs_hil/control/registry.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>

#include "catch.hpp"
#include "control/classic_controllers.hpp"

using namespace abs_hil;
using Catch::Matchers::Contains;

TEST_CASE("Every controller in the table can be made and brakes") {
  const control::ControlOptions options;
  const rig::RigParameters parameters;
  REQUIRE(control::controllers().size() >= 3);
  for (const auto& entry : control::controllers()) {
    CAPTURE(std::string(entry.name));
    CHECK_FALSE(entry.summary.empty());
    const auto controller = control::make_controller(entry.name, {options, parameters});
    const control::SlipInput input{.speeds = {168.0, 170.0},
                                   .slip = 0.0068,
                                   .slip_ref = 0.15,
                                   .max_brake_torque_Nm = std::numeric_limits<double>::infinity()};
    controller->reset(input);
    const auto output = controller->step(input);
    CHECK(output.brake_torque_Nm > 0.0);
    const double slip_ref = std::isnan(output.slip_ref) ? input.slip_ref : output.slip_ref;
    CHECK(output.slip_velocity_error_m_s ==
          Catch::Detail::Approx((1 - slip_ref) * 0.0990 * 170.0 - 0.0995 * 168.0).epsilon(1e-12));
  }
}

TEST_CASE("An unknown name is answered with the nearest and all known ones") {
  const control::ControlOptions options;
  const rig::RigParameters parameters;
  CHECK_THROWS_WITH(
      control::make_controller("adaptve", {options, parameters}),
      Contains("'adaptve'") && Contains("did you mean 'adaptive'") && Contains("nominal") && Contains("locked"));
  CHECK_THROWS_WITH(control::make_controller("loked", {options, parameters}), Contains("did you mean 'locked'"));
  CHECK_THROWS_AS(control::make_controller("", {options, parameters}), std::invalid_argument);
  CHECK_THROWS_WITH(control::make_controller("my_law:Law", {options, parameters}),
                    Contains("my_law:Law") && Contains("no classes in Python") && !Contains("did you mean"));
  CHECK_THROWS_WITH(control::make_controller("my-law:Law", {options, parameters}),
                    Contains("my-law:Law") && Contains("give a class in Python as MODULE:CLASS"));
}

TEST_CASE("A registered controller stands beside ours; a taken or empty name is refused") {
  constexpr auto entry =
      control::controller_entry<control::LawController<control::LockedLaw>>("own-locked", "as locked");
  const std::size_t before = control::controllers().size();
  control::register_controller(entry);
  REQUIRE(control::controllers().size() == before + 1);
  CHECK(control::controllers().back().name == "own-locked");
  const control::ControlOptions options;
  const rig::RigParameters parameters;
  CHECK(control::make_controller("own-locked", {options, parameters}) != nullptr);
  CHECK_THROWS_WITH(control::register_controller(entry), Contains("'own-locked' already exists"));
  CHECK_THROWS_AS(control::register_controller({"", "none", entry.make}), std::invalid_argument);
}

TEST_CASE("Options that are not usable are refused when the controller is made") {
  using Spoil = std::function<void(control::ControlOptions&)>;
  const auto refused = [](std::string_view name, const Spoil& spoil) {
    control::ControlOptions options;
    const rig::RigParameters parameters;
    spoil(options);
    CHECK_THROWS_AS(control::make_controller(name, {options, parameters}), std::invalid_argument);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused("adaptive", [](auto& o) { o.adaptive.gamma = 0.0; });
  refused("adaptive", [](auto& o) { o.adaptive.ka1 = -1.0; });
  refused("adaptive", [](auto& o) { o.adaptive.gamma = o.adaptive.ka1 = 1e-200; });
  refused("adaptive", [](auto& o) { o.adaptive.ks0 = 1e-300; });
  refused("adaptive", [](auto& o) { o.adaptive.q22 = -2.0; });
  refused("adaptive", [](auto& o) { o.adaptive.theta_min_N = 200.0; });
  refused("adaptive", [=](auto& o) { o.adaptive.zeta0 = nan; });
  refused("adaptive", [](auto& o) { o.rate_Hz = 0.0; });
  for (const std::string_view name : {"adaptive", "nominal"}) {
    refused(name, [](auto& o) { o.adaptive.ks0 = 0.0; });
    refused(name, [=](auto& o) { o.adaptive.ks1 = nan; });
    refused(name, [](auto& o) { o.v_min_m_s = 0.0; });
  }
  refused("adaptive-actuator", [](auto& o) { o.adaptive_actuator.law.gamma = 0.0; });
  refused("adaptive-actuator", [](auto& o) { o.adaptive_actuator.lag_gain_per_s = 0.0; });
  refused("adaptive-actuator", [](auto& o) { o.adaptive_actuator.lag_weight_s2 = -1.0; });
  refused("adaptive-actuator", [](auto& o) { o.adaptive_actuator.observer.force_rate_N2_s = 0.0; });
  refused("adaptive-peak", [](auto& o) { o.adaptive_peak.ks1 = 0.0; });
  refused("adaptive-peak", [](auto& o) { o.adaptive_peak.slip_min = 0.4; });
  refused("adaptive-peak", [](auto& o) { o.adaptive_peak.slip_start = 0.5; });
  refused("adaptive-peak", [](auto& o) { o.adaptive_peak.search_part = 1.0; });
  refused("adaptive-peak", [](auto& o) { o.adaptive_peak.peak.peak_slip0 = 0.5; });
  refused("adaptive-peak", [](auto& o) { o.adaptive_peak.peak.force_noise_N2_s = 0.0; });
  refused("adaptive-peak", [=](auto& o) { o.adaptive_peak.observer.brake_rate_Nm2_s = nan; });
  refused("adaptive-optimal", [](auto& o) { o.adaptive_optimal.slip_gain_per_s = 0.0; });
  refused("adaptive-optimal", [](auto& o) { o.adaptive_optimal.slip_min = 0.4; });
  refused("adaptive-optimal", [](auto& o) { o.adaptive_optimal.slip_start = 0.5; });
  refused("adaptive-optimal", [=](auto& o) { o.adaptive_optimal.play_Nm = nan; });
  refused("adaptive-optimal", [](auto& o) { o.adaptive_optimal.bank.force_noise_N2_s = 0.0; });
  refused("adaptive-optimal", [](auto& o) { o.adaptive_optimal.runaway = 0.0; });
  refused("adaptive-optimal", [](auto& o) { o.adaptive_optimal.bank.last_peak_slip = 1.0; });
  refused("adaptive-optimal", [](auto& o) { o.adaptive_optimal.bank.last_peak_part = 1.0; });
  refused("mixed-slip-deceleration", [](auto& o) { o.mixed_slip_deceleration.kp_Nm = 0.0; });
  refused("mixed-slip-deceleration", [=](auto& o) { o.mixed_slip_deceleration.weight = nan; });
  refused("braking-stiffness", [](auto& o) { o.braking_stiffness.memory_s = 0.0; });
  refused("braking-stiffness", [](auto& o) { o.braking_stiffness.slip_start = 0.5; });
  refused("braking-stiffness", [](auto& o) { o.braking_stiffness.observer.force_rate_N2_s = 0.0; });
  refused("nominal", [](auto& o) { o.nominal.theta0_N = -5.0; });
}

TEST_CASE("The locked controller gives the largest torque, and estimates nothing") {
  const control::ControlOptions options;
  const rig::RigParameters parameters;
  const auto locked = control::make_controller("locked", {options, parameters});
  control::SlipInput input{.speeds = {0.0, 170.0}, .slip = 1.0, .slip_ref = 0.15, .max_brake_torque_Nm = 4.0};
  locked->reset(input);
  CHECK(locked->step(input).brake_torque_Nm == 4.0);
  CHECK(std::isnan(locked->step(input).theta_est_N));
  input.max_brake_torque_Nm = std::numeric_limits<double>::infinity();
  CHECK(locked->step(input).brake_torque_Nm == Catch::Detail::Approx(15.24 - 6.21));
}
