// Motions of the wheels that have a closed form.
#include <cmath>

#include "abs_hil/plant_sim/plant.hpp"
#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using abs_hil::rig::WheelParameters;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// One wheel with viscous and Coulomb friction alone: w' = -a w - c.
struct CoastDown {
  double a_per_s;
  double c_rad_s2;
  double start_rad_s;
  double speed_rad_s(double t) const {
    return (start_rad_s + c_rad_s2 / a_per_s) * std::exp(-a_per_s * t) - c_rad_s2 / a_per_s;
  }
  double standstill_s() const { return std::log1p(a_per_s * start_rad_s / c_rad_s2) / a_per_s; }
  double angle_rad() const { return start_rad_s / a_per_s - c_rad_s2 / a_per_s * standstill_s(); }
};

CoastDown upper(const WheelParameters& w, double start_rad_s) {
  return {w.d1_Nms_rad / w.J1_kg_m2, w.M10_Nm / w.J1_kg_m2, start_rad_s};
}
CoastDown lower(const WheelParameters& w, double start_rad_s) {
  return {w.d2_Nms_rad / w.J2_kg_m2, w.M20_Nm / w.J2_kg_m2, start_rad_s};
}

}  // namespace

TEST_CASE("Coast-down of each wheel alone follows its closed form to standstill") {
  const PlantOptions options = wheels_apart();
  const CoastDown one = upper(options.rig.wheels, 170.0);
  const CoastDown two = lower(options.rig.wheels, 150.0);
  REQUIRE(two.standstill_s() < one.standstill_s());
  Plant plant(options);
  plant.reset({.omega1_rad_s = 170.0, .omega2_rad_s = 150.0});
  const double early_s = 10.0;
  plant.advance(early_s, {});
  CHECK_THAT(plant.state().omega1_rad_s, WithinAbs(one.speed_rad_s(early_s), 1e-8));
  CHECK_THAT(plant.state().omega2_rad_s, WithinAbs(two.speed_rad_s(early_s), 1e-8));

  plant.advance(two.standstill_s() - early_s - 1e-6, {});
  CHECK(plant.state().omega2_rad_s > 0.0);
  plant.advance(2e-6, {});
  CHECK(plant.state().omega2_rad_s == 0.0);
  CHECK_THAT(plant.state().angle2_rad, WithinAbs(two.angle_rad(), 1e-6));

  plant.advance(one.standstill_s() - two.standstill_s() - 2e-6, {});
  CHECK(plant.state().omega1_rad_s > 0.0);
  plant.advance(2e-6, {});
  CHECK(plant.state().omega1_rad_s == 0.0);
  CHECK_THAT(plant.state().angle1_rad, WithinAbs(one.angle_rad(), 1e-6));
  CHECK(plant.state().omega2_rad_s == 0.0);
}

TEST_CASE("The order of convergence survives the stop of a wheel") {
  // High friction, so that steps of tens of milliseconds leave a measurable error. The interval to standstill contains
  // the event: a stop located to first or second order would spoil the order of convergence.
  PlantOptions options = wheels_apart();
  options.rig.wheels.d1_Nms_rad = 10.0 * options.rig.wheels.J1_kg_m2;
  options.rig.wheels.M10_Nm = 100.0 * options.rig.wheels.J1_kg_m2;
  const CoastDown exact = upper(options.rig.wheels, 170.0);
  const auto error_rad = [&](double max_step_s) {
    options.max_step_s = max_step_s;
    Plant plant(options);
    plant.reset({.omega1_rad_s = 170.0});
    plant.advance(0.48, {});  // standstill is after 0.289 s
    REQUIRE(plant.state().omega1_rad_s == 0.0);
    return std::abs(plant.state().angle1_rad - exact.angle_rad());
  };
  const double coarse = error_rad(0.04);
  const double middle = error_rad(0.02);
  const double fine = error_rad(0.01);
  INFO(coarse << " " << middle << " " << fine << " rad");
  CHECK(std::log2(coarse / middle) > 3.6);
  CHECK(std::log2(middle / fine) > 3.6);
}

TEST_CASE("Under the tyre force alone J1 w1 / r1 + J2 w2 / r2 is conserved and slip dies out") {
  const PlantOptions options = frictionless();
  const WheelParameters& w = options.rig.wheels;
  const auto momentum = [&](const PlantState& s) {
    return w.J1_kg_m2 * s.omega1_rad_s / w.r1_m + w.J2_kg_m2 * s.omega2_rad_s / w.r2_m;
  };
  const auto [omega1_rad_s, omega2_rad_s] =
      GENERATE(table<double, double>({{20.0, 160.0}, {160.0, 20.0}, {-30.0, 90.0}, {100.0, 0.0}}));
  Plant plant(options);
  plant.reset({.omega1_rad_s = omega1_rad_s, .omega2_rad_s = omega2_rad_s});
  const double start = momentum(plant.state());
  for (int tick = 0; tick < 1500; ++tick) {
    plant.advance(1e-3, {});
    REQUIRE_THAT(momentum(plant.state()), WithinRel(start, 1e-11));
  }
  CHECK_THAT(plant.slip(), WithinAbs(0.0, 1e-9));
}

TEST_CASE("Without any torque the angles grow in proportion to time, for any division of the time") {
  Plant plant(frictionless());
  plant.reset({.omega1_rad_s = 99.0, .omega2_rad_s = 99.5});  // equal circumferential speeds
  double passed_s = 0.0;
  for (int i = 1; i <= 50; ++i) {
    const double duration_s = 1.2345e-3 / i;  // mostly no multiple of any step
    plant.advance(duration_s, {});
    passed_s += duration_s;
  }
  CHECK_THAT(plant.state().angle1_rad, WithinRel(99.0 * passed_s, 1e-12));
  CHECK_THAT(plant.state().angle2_rad, WithinRel(99.5 * passed_s, 1e-12));
}

TEST_CASE("The brake torque lags behind its map by the closed form of (6), turning or standing") {
  Plant turning{PlantOptions{}};
  Plant standing{PlantOptions{}};
  turning.reset(rolling_at_170);
  const double target_Nm = 15.24 * 0.6 - 6.21;
  turning.advance(0.05, {.brake_duty = 0.6});
  standing.advance(0.05, {.brake_duty = 0.6});
  const double expected_Nm = target_Nm * (1.0 - std::exp(-20.37 * 0.05));
  CHECK_THAT(turning.state().brake_torque_Nm, WithinAbs(expected_Nm, 1e-9));
  CHECK_THAT(standing.state().brake_torque_Nm, WithinAbs(expected_Nm, 1e-14));
  turning.advance(0.05, {.brake_duty = 0.4});  // in the dead zone
  CHECK_THAT(turning.state().brake_torque_Nm, WithinAbs(expected_Nm * std::exp(-20.37 * 0.05), 1e-9));
}

TEST_CASE("Wheels that are parted follow their closed forms alone, and roll together once they are joined") {
  for (const bool lever : {false, true}) {
    CAPTURE(lever);
    PlantOptions options{};
    if (lever) options.load = "lever";
    const double motor_duty = 0.5;
    const CoastDown one = upper(options.rig.wheels, 100.0);
    // The motor's back-EMF adds to the lower wheel's viscous friction, its stall torque drives it.
    const auto& motor = options.rig.motor;
    CoastDown two = lower(options.rig.wheels, 40.0);
    two.a_per_s += motor_duty * motor.stall_torque_Nm / motor.no_load_speed_rad_s / options.rig.wheels.J2_kg_m2;
    two.c_rad_s2 -= motor_duty * motor.stall_torque_Nm / options.rig.wheels.J2_kg_m2;
    Plant plant(options);
    plant.reset({.omega1_rad_s = 100.0, .omega2_rad_s = 40.0});
    plant.part_wheels(true);
    plant.advance(2.0, {.motor_duty = motor_duty});
    CHECK_THAT(plant.state().omega1_rad_s, WithinAbs(one.speed_rad_s(2.0), 1e-8));
    CHECK_THAT(plant.state().omega2_rad_s, WithinAbs(two.speed_rad_s(2.0), 1e-8));
    CHECK(plant.tyre_force_N() == 0.0);
    CHECK(plant.truth().theta_N == 0.0);
    plant.part_wheels(false);
    CHECK(plant.truth().theta_N > 0.0);
    plant.advance(3.0, {});
    CHECK_THAT(plant.slip(), WithinAbs(0.0, 1e-3));
    plant.part_wheels(true);
    plant.reset({.omega1_rad_s = 100.0, .omega2_rad_s = 40.0});
    CHECK(plant.tyre_force_N() < 0.0);  // a new run begins with the wheels together
  }
}
