// Parameters that drift: a brake that fades, bearings that dry, a motor that weakens, in closed form.
#include <cmath>
#include <stdexcept>

#include "abs_hil/plant_sim/plant.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using Catch::Matchers::Contains;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double J1 = 7.54e-3;
constexpr double J2 = 25.60e-3;

/// Advances the plant by `duration_s` in ticks of `tick_s`, which need not divide it.
void pass(Plant& plant, double duration_s, double tick_s, const PlantInput& input) {
  double left_s = duration_s;
  for (; left_s > tick_s; left_s -= tick_s) plant.advance(tick_s, input);
  plant.advance(left_s, input);
}

}  // namespace

TEST_CASE("A fading brake decelerates a free wheel by its closed form, for any division of the time") {
  // J1 w' = -f(t) T with f = 1 up to 0.1003217 s, then falling to 0.4 over a second.
  PlantOptions options = wheels_apart();
  options.rig.wheels.d1_Nms_rad = options.rig.wheels.M10_Nm = 0.0;
  options.ideal_actuator = true;
  options.drift.brake_torque = "time: 1; 0.4 from 0.1003217 to 1.1003217";
  const double tick_s = GENERATE(1e-3, 0.37e-3, 0.25, 2.0);
  Plant plant(options);
  plant.reset(rolling_at_170);
  pass(plant, 0.6003217, tick_s, {.brake_torque_Nm = 0.5});
  CHECK_THAT(plant.state().omega1_rad_s, WithinAbs(170.0 - 0.5 / J1 * (0.1003217 + 0.5 * 0.85), 1e-9));
  pass(plant, 1.0, tick_s, {.brake_torque_Nm = 0.5});
  CHECK_THAT(plant.state().omega1_rad_s, WithinAbs(170.0 - 0.5 / J1 * (0.1003217 + 0.7 + 0.5 * 0.4), 1e-9));
  CHECK_THAT(plant.truth().brake_torque_Nm, WithinRel(0.2, 1e-12));
}

TEST_CASE("With the lag a fading brake follows its closed form") {
  // Tb' = c (s(t) b - Tb), s = 1 - 0.25 t: Tb = b (s + 0.25/c) + K exp(-c t).
  PlantOptions options = wheels_apart();
  options.drift.brake_torque = "braking time: 1; 0.5 from 0 to 2";
  Plant plant(options);
  plant.reset(rolling_at_170);
  plant.advance(3.0, {});  // nothing drifts before the brake acts
  const double c = options.rig.brake.c31_per_s;
  const double b = abs_hil::rig::brake_torque_at(options.rig.brake, 0.6);
  pass(plant, 0.3, 1e-3, {.brake_duty = 0.6});
  const double expected = b * (1.0 - 0.25 * 0.3 + 0.25 / c) - b * (1.0 + 0.25 / c) * std::exp(-c * 0.3);
  CHECK_THAT(plant.state().brake_torque_Nm, WithinRel(expected, 1e-6));
  REQUIRE(plant.state().omega1_rad_s > 0.0);
}

TEST_CASE("A drying bearing decelerates its wheel by the closed form of its growing friction") {
  // J2 w' = -f(t) (d w + M), f = 1 + 2 t: w = (w0 + M/d) exp(-d (t + t^2)/J2) - M/d.
  PlantOptions options = wheels_apart();
  options.drift.lower_bearing = "time: 1; 5 from 0 to 2";
  Plant plant(options);
  plant.reset(rolling_at_170);
  pass(plant, 1.5, 1e-3, {});
  const double d = options.rig.wheels.d2_Nms_rad;
  const double M = options.rig.wheels.M20_Nm;
  const double expected = (170.0 + M / d) * std::exp(-d * (1.5 + 1.5 * 1.5) / J2) - M / d;
  CHECK_THAT(plant.state().omega2_rad_s, WithinAbs(expected, 1e-8));
  CHECK(plant.state().omega1_rad_s > 160.0);  // the upper bearing does not drift
}

TEST_CASE("A motor that loses torque drives by its closed form") {
  // J2 w' = f(t) (K - k w) without friction, f = 1 - t/4.
  PlantOptions options = wheels_apart();
  options.rig.wheels.d2_Nms_rad = options.rig.wheels.M20_Nm = 0.0;
  options.drift.motor_torque = "time: 1; 0.5 from 0 to 2";
  Plant plant(options);
  plant.reset({});
  pass(plant, 1.0, 1e-3, {.motor_duty = 1.0});
  const double no_load = options.rig.motor.no_load_speed_rad_s;
  const double k = options.rig.motor.stall_torque_Nm / no_load;
  CHECK_THAT(plant.state().omega2_rad_s, WithinRel(no_load * (1.0 - std::exp(-k / J2 * (1.0 - 0.125))), 1e-8));
}

TEST_CASE("A constant factor equals a plant with scaled parameters, bit by bit") {
  PlantOptions other = GENERATE(PlantOptions{}, inteco_manual());
  PlantOptions drifting = other;
  other.rig.wheels.M10_Nm *= 2.0;
  other.rig.wheels.d1_Nms_rad *= 2.0;
  other.rig.wheels.M20_Nm *= 0.5;
  other.rig.wheels.d2_Nms_rad *= 0.5;
  other.rig.motor.stall_torque_Nm *= 0.5;
  other.rig.brake.b1_Nm *= 0.5;
  other.rig.brake.b2_Nm *= 0.5;
  drifting.drift = {"time: 0.5", "time: 0.5", "time: 2", "time: 0.5"};
  Plant expected(other);
  Plant plant(drifting);
  for (Plant* p : {&expected, &plant}) {
    p->reset({});
    pass(*p, 1.0, 1e-3, {.motor_duty = 1.0});
    pass(*p, 0.1, 1e-3, {.brake_duty = 0.6});
  }
  CHECK(plant.state().omega1_rad_s == expected.state().omega1_rad_s);
  CHECK(plant.state().omega2_rad_s == expected.state().omega2_rad_s);
  CHECK(plant.state().brake_torque_Nm == expected.state().brake_torque_Nm);
  CHECK(plant.truth().theta_N == expected.truth().theta_N);
}

TEST_CASE("A drying bearing holds a wheel that turned before, and a reset restores the bearing") {
  PlantOptions options;
  options.rig.wheels.d2_Nms_rad = 0.0;
  options.drift.lower_bearing = "time: 1; 10 at 0.5";
  Plant plant(options);
  for (int run = 0; run < 2; ++run) {
    plant.reset({});
    const PlantInput weak{.motor_duty = 3.0 * options.rig.wheels.M20_Nm / options.rig.motor.stall_torque_Nm};
    plant.advance(0.5, weak);
    CHECK(plant.state().omega2_rad_s > 1.0);
    plant.advance(0.5, weak);
    CHECK(plant.state().omega2_rad_s == 0.0);
  }
}

TEST_CASE("Halving the step quarters the error of constant factors within a part") {
  // Only with steeper ramps than any laboratory's: a brake that goes from 1 to 0.2 and back within 20 ms.
  PlantOptions options;
  options.drift.brake_torque = "braking time: 1; 0.2 from 0.05 to 0.07; 1 from 0.07 to 0.09";
  options.drift.upper_bearing = "time: 1; 10 from 0.01 to 0.05";
  const auto end = [&options](double max_step_s) {
    options.max_step_s = max_step_s;
    Plant plant(options);
    plant.reset(rolling_at_170);
    plant.advance(0.12, {.brake_duty = 0.5});
    return plant.state().omega2_rad_s;
  };
  const double reference = end(2e-6);
  const double coarse = std::abs(end(1e-3) - reference);
  const double fine = std::abs(end(0.25e-3) - reference);
  INFO(coarse << " " << fine << " rad/s");
  CHECK(coarse / fine > 12.0);
  CHECK(fine < 1e-5);
}

TEST_CASE("An unusable profile is refused with its key") {
  PlantOptions options;
  const auto [profile, key] = GENERATE(table<std::string DriftProfiles::*, const char*>(
      {{&DriftProfiles::brake_torque, "plant.brake_torque_profile: "},
       {&DriftProfiles::motor_torque, "plant.motor_torque_profile: "},
       {&DriftProfiles::upper_bearing, "plant.upper_bearing_profile: "},
       {&DriftProfiles::lower_bearing, "plant.lower_bearing_profile: "}}));
  options.drift.*profile = "distance: 1; 0.5 at 2";
  CHECK_THROWS_WITH(Plant(options),
                    Contains(std::string(key) + "\"distance\" is not an axis of this profile; write time or braking"));
  options.drift.*profile = "time: 1; 0 at 2";
  CHECK_THROWS_WITH(Plant(options), Contains(std::string(key) + "\"0 at 2\" has a factor outside (0, 10]"));
}
