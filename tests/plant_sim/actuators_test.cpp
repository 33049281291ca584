// Motor and brake of the plant: what they do at each duty, with the real and the ideal actuator.
#include <cmath>

#include "abs_hil/plant_sim/plant.hpp"
#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using abs_hil::rig::RigParameters;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

/// Time at which full duty from rest brings the upper wheel to `target_rad_s`, interpolated between 1 ms ticks.
double run_up_s(const PlantOptions& options, double target_rad_s) {
  Plant plant(options);
  double before_rad_s = 0.0;
  for (int tick = 1; tick < 20000; ++tick) {
    plant.advance(1e-3, {.motor_duty = 1.0});
    const double now_rad_s = plant.state().omega1_rad_s;
    if (now_rad_s >= target_rad_s) return 1e-3 * (tick - (now_rad_s - target_rad_s) / (now_rad_s - before_rad_s));
    before_rad_s = now_rad_s;
  }
  return HUGE_VAL;
}

/// The same for wheels that roll on each other without slip, everything referred to the lower one:
/// J w' = K - M - (K / w0 + d) w.
double lumped_run_up_s(const RigParameters& rig, double target_rad_s) {
  const auto& w = rig.wheels;
  const double n = w.r2_m / w.r1_m;
  const double J = w.J2_kg_m2 + n * n * w.J1_kg_m2;
  const double M = w.M20_Nm + n * w.M10_Nm;
  const double K = rig.motor.stall_torque_Nm;
  const double damping = K / rig.motor.no_load_speed_rad_s + w.d2_Nms_rad + n * n * w.d1_Nms_rad;
  const double final_rad_s = (K - M) / damping;
  return -J / damping * std::log(1.0 - target_rad_s / n / final_rad_s);
}

}  // namespace

TEST_CASE("The calibrated motor brings the upper wheel to 170 rad/s when the paper's plots start braking") {
  const double idle_s = 0.05;
  const PlantOptions options;
  const double time_s = run_up_s(options, 170.0);
  CHECK_THAT(idle_s + time_s, WithinAbs(6.2, 0.1));   // read from the paper's plots
  CHECK_THAT(idle_s + time_s, WithinAbs(6.2, 1e-3));  // the target of the calibration
  CHECK_THAT(time_s, WithinRel(lumped_run_up_s(options.rig, 170.0), 0.01));
  CHECK_THAT(run_up_s(options, 80.0), WithinRel(lumped_run_up_s(options.rig, 80.0), 0.01));
}

TEST_CASE("At duty 0 the motor neither drives nor brakes") {
  Plant plant(frictionless());
  plant.reset({.omega1_rad_s = 300.0 * 0.0990 / 0.0995, .omega2_rad_s = 300.0});  // beyond the no-load speed
  plant.advance(1.0, {});
  CHECK_THAT(plant.state().omega2_rad_s, WithinRel(300.0, 1e-12));
  plant.advance(1.0, {.motor_duty = 0.1});
  CHECK(plant.state().omega2_rad_s < 299.0);  // back-EMF brakes there
}

TEST_CASE("Traction drives the upper wheel: the tyre force is positive in braking, and negative slip drives") {
  Plant plant{PlantOptions{}};
  plant.reset({.omega1_rad_s = 50.0, .omega2_rad_s = 100.0});
  CHECK(plant.slip() > 0.0);
  CHECK(plant.tyre_force_N() > 0.0);
  plant.reset({.omega1_rad_s = 100.0, .omega2_rad_s = 50.0});
  CHECK(plant.slip() < 0.0);
  CHECK(plant.tyre_force_N() < 0.0);
  plant.advance(1e-3, {});
  CHECK(plant.state().omega1_rad_s < 100.0);
  CHECK(plant.state().omega2_rad_s > 50.0);
}

TEST_CASE("The ideal actuator applies the commanded torque at once, without map and lag, and ignores the duty") {
  PlantOptions options = wheels_apart();
  options.ideal_actuator = true;
  options.rig.wheels.d1_Nms_rad = 0.0;
  Plant plant(options);
  plant.reset(rolling_at_170);
  plant.advance(0.05, {.brake_duty = 1.0, .brake_torque_Nm = 12.0});  // more than b(1)
  CHECK(plant.state().brake_torque_Nm == 12.0);
  CHECK_THAT(plant.state().omega1_rad_s, WithinAbs(170.0 - (12.0 + 0.0032) / 7.54e-3 * 0.05, 1e-9));
  plant.advance(0.001, {.brake_duty = 1.0});
  CHECK(plant.state().brake_torque_Nm == 0.0);
}

TEST_CASE("The real actuator ignores the torque and obeys the duty") {
  Plant plant{PlantOptions{}};
  plant.reset(rolling_at_170);
  plant.advance(0.05, {.brake_torque_Nm = 5.0});
  CHECK(plant.state().brake_torque_Nm == 0.0);
}

TEST_CASE("The truth is the plant's state") {
  Plant plant{PlantOptions{}};
  plant.reset({.omega1_rad_s = 80.0, .omega2_rad_s = 100.0, .brake_torque_Nm = 1.5});
  const auto truth = plant.truth();
  CHECK(truth.speeds.omega1_rad_s == 80.0);
  CHECK(truth.speeds.omega2_rad_s == 100.0);
  CHECK(truth.brake_torque_Nm == 1.5);
  CHECK(truth.theta_N == 23.0);
  CHECK_THAT(truth.slip, WithinRel((9.9 - 7.96) / 9.9, 1e-14));
  CHECK_THAT(plant.tyre_force_N(), WithinRel(23.0 * std::sin(1.68 * std::atan(28.0 * truth.slip)), 1e-14));
}

TEST_CASE("Start resistors leave the motor less torque until the lower wheel's speed bridges them") {
  PlantOptions options = wheels_apart();
  abs_hil::rig::DriveMotorParameters& motor = options.rig.motor;
  motor = {.stall_torque_Nm = 2.7,
           .no_load_speed_rad_s = 488.0,
           .start_torque_Nm = 0.97,
           .start_until_rad_s = 60.0,
           .middle_torque_Nm = 1.5,
           .middle_until_rad_s = 105.0};
  const auto& w = options.rig.wheels;
  // J w' = A - M - (A / w0 + d) w from one speed to the next, under the stall torque A.
  const auto time_s = [&](double A, double from, double to) {
    const double damping = A / motor.no_load_speed_rad_s + w.d2_Nms_rad;
    const double final_rad_s = (A - w.M20_Nm) / damping;
    return w.J2_kg_m2 / damping * std::log((final_rad_s - from) / (final_rad_s - to));
  };
  const double duration_s = time_s(0.97, 0.0, 60.0) + time_s(1.5, 60.0, 105.0) + time_s(2.7, 105.0, 178.0);
  Plant plant(options);
  const double tick_s = GENERATE(1e-3, 0.02, 5.0);  // a resistor is bridged within a tick, too
  double left_s = duration_s;
  for (; left_s > tick_s; left_s -= tick_s) plant.advance(tick_s, {.motor_duty = 1.0});
  plant.advance(left_s, {.motor_duty = 1.0});
  CHECK_THAT(plant.state().omega2_rad_s, WithinAbs(178.0, 0.03));  // the step in which the torque jumps
  plant.reset({.omega2_rad_s = 100.0});
  plant.advance(1e-4, {.motor_duty = 0.5});
  const double driven_Nm = 0.5 * 1.5 * (1.0 - 100.0 / 488.0) - w.M20_Nm - w.d2_Nms_rad * 100.0;
  CHECK_THAT(plant.state().omega2_rad_s - 100.0, WithinRel(1e-4 * driven_Nm / w.J2_kg_m2, 1e-3));
}
