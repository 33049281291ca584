// Standing and locked wheels: they stay at zero, and break away when they must.
#include <cmath>

#include "abs_hil/plant_sim/plant.hpp"
#include "brake_profiles.hpp"
#include "catch.hpp"
#include "rigs.hpp"

using namespace abs_hil::plant_sim;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

TEST_CASE("A locked wheel stays at exactly zero until both wheels stand for good") {
  Plant plant{PlantOptions{}};
  plant.reset(rolling_at_170);
  check_locks_then_stands(plant, 4000);
}

TEST_CASE("A standing pair takes no substeps") {
  Plant plant{PlantOptions{}};
  plant.advance(1e9, {.brake_duty = 1.0});  // would take 2e12 steps otherwise
  CHECK_THAT(plant.state().brake_torque_Nm, WithinAbs(9.03, 1e-12));
}

TEST_CASE("A full brake from 170 rad/s stops as the prototype's locked wheel does") {
  const PlantOptions options;
  Plant plant(options);
  plant.reset(rolling_at_170);
  double v_m_s = 170.0 * options.rig.wheels.r2_m;
  double distance_m = 0.0;
  int ticks = 0;
  while (v_m_s >= 0.3 && ticks < 5000) {
    plant.advance(1e-3, {.brake_duty = 1.0});
    ++ticks;
    const double next_m_s = plant.state().omega2_rad_s * options.rig.wheels.r2_m;
    distance_m += 0.5e-3 * (v_m_s + next_m_s);
    v_m_s = next_m_s;
  }
  CHECK_THAT(1e-3 * ticks, WithinRel(3.19, 0.005));
  CHECK_THAT(distance_m, WithinRel(26.9, 0.005));
}

TEST_CASE("A released wheel breaks away when the falling brake torque lets the tyre force win") {
  const PlantOptions options;
  Plant plant(options);
  plant.reset({.omega2_rad_s = 100.0, .brake_torque_Nm = 9.0});
  // Locked, slip is 1: r1 theta phi(1) = M10 + 9 exp(-c31 t).
  const double pull_Nm = 0.0995 * 23.0 * std::sin(1.68 * std::atan(28.0));
  const double break_away_s = std::log(9.0 / (pull_Nm - 0.0032)) / 20.37;
  plant.advance(break_away_s - 1e-6, {});
  CHECK(plant.state().omega1_rad_s == 0.0);
  plant.advance(1e-3, {});
  CHECK(plant.state().omega1_rad_s > 0.0);
  // Just after: J1 w1'' = c31 (pull - M10), so w1 = c31 (pull - M10) t^2 / 2 J1.
  const double t_s = 1e-3 - 1e-6;
  CHECK_THAT(plant.state().omega1_rad_s, WithinRel(20.37 * (pull_Nm - 0.0032) * t_s * t_s / (2.0 * 7.54e-3), 0.02));
  plant.advance(1.0, {});
  CHECK_THAT(plant.slip(), WithinAbs(0.0, 1e-3));
}

TEST_CASE("A held wheel whose pull barely exceeds its rising friction soon stands again") {
  // Locked, slip is 1. The brake torque rises at c31 (9.03 - Tb), so the wheel slides for 2 excess / that rate: from
  // far below the rounding of any step to many microseconds.
  const double pull_Nm = 0.0995 * 23.0 * std::sin(1.68 * std::atan(28.0));
  const double excess_Nm = GENERATE(1e-15, 1e-12, 1e-9, 1e-6, 1e-5, 1e-3);
  Plant plant{PlantOptions{}};
  plant.reset({.omega2_rad_s = 100.0, .brake_torque_Nm = pull_Nm - 0.0032 - excess_Nm});
  plant.advance(2e-3, {.brake_duty = 1.0});
  CHECK(plant.state().omega1_rad_s == 0.0);
  CHECK(plant.state().angle1_rad >= 0.0);
  // J1 w1' = excess - rate t leads to the angle 2 excess^3 / (3 J1 rate^2).
  const double rate_Nm_s = 20.37 * (9.03 - (pull_Nm - 0.0032));
  const double angle_rad = 2.0 * std::pow(excess_Nm, 3) / (3.0 * 7.54e-3 * rate_Nm_s * rate_Nm_s);
  CHECK_THAT(plant.state().angle1_rad, WithinAbs(angle_rad, 0.01 * angle_rad + 1e-16));
}

TEST_CASE("A pull within rounding of the friction neither moves the wheel nor stalls the simulation") {
  PlantOptions options;
  options.ideal_actuator = true;
  Plant plant(options);
  plant.reset({.omega2_rad_s = 100.0});
  double torque_Nm = options.rig.wheels.r1_m * plant.tyre_force_N() - options.rig.wheels.M10_Nm;
  for (int i = 0; i < 8; ++i) torque_Nm = std::nextafter(torque_Nm, 0.0);
  for (int i = 0; i < 16; ++i) {
    plant.reset({.omega2_rad_s = 100.0});
    plant.advance(0.1, {.brake_torque_Nm = torque_Nm});
    CHECK(plant.state().omega1_rad_s >= 0.0);
    CHECK(plant.state().omega1_rad_s < 1e-12);
    torque_Nm = std::nextafter(torque_Nm, 10.0);
  }
}

TEST_CASE("Both wheels may stop within one substep, in either order or at once") {
  // Constant deceleration, so that the way to standstill is w^2 / 2c exactly. All stops are within the first 500 us.
  PlantOptions options = wheels_apart();
  auto& w = options.rig.wheels;
  w.d1_Nms_rad = w.d2_Nms_rad = 0.0;
  const double c1 = w.M10_Nm / w.J1_kg_m2;
  const double c2 = w.M20_Nm / w.J2_kg_m2;
  const auto [stop1_s, stop2_s] = GENERATE(table<double, double>(
      {{0.12e-3, 0.31e-3}, {0.31e-3, 0.12e-3}, {0.2e-3, 0.2e-3}, {0.2e-3, 0.2e-3 + 1e-15}, {1e-12, 0.4e-3}}));
  const double sign = GENERATE(1.0, -1.0);
  Plant plant(options);
  plant.reset({.omega1_rad_s = sign * c1 * stop1_s, .omega2_rad_s = sign * c2 * stop2_s});
  plant.advance(500e-6, {});
  CHECK(plant.state().omega1_rad_s == 0.0);
  CHECK(plant.state().omega2_rad_s == 0.0);
  CHECK_THAT(plant.state().angle1_rad, WithinAbs(sign * 0.5 * c1 * stop1_s * stop1_s, 1e-15));
  CHECK_THAT(plant.state().angle2_rad, WithinAbs(sign * 0.5 * c2 * stop2_s * stop2_s, 1e-15));
}

TEST_CASE("The motor moves the standing lower wheel only beyond its friction") {
  const PlantOptions options;
  const double threshold = options.rig.wheels.M20_Nm / options.rig.motor.stall_torque_Nm;
  Plant plant(options);
  plant.advance(1.0, {.motor_duty = 0.999 * threshold});
  CHECK(plant.state().omega2_rad_s == 0.0);
  CHECK(plant.state().angle2_rad == 0.0);
  plant.advance(1.0, {.motor_duty = 1.001 * threshold});
  CHECK(plant.state().omega2_rad_s > 0.0);
  CHECK(plant.state().omega1_rad_s >= 0.0);
}

TEST_CASE("At a start with full brake the upper wheel holds while the lower one turns under it") {
  PlantOptions options;
  options.rig.tyre.theta_N = 10.0;  // r2 theta is well below the motor's torque
  Plant plant(options);
  plant.reset({.brake_torque_Nm = 9.03});
  plant.advance(0.5, {.motor_duty = 1.0, .brake_duty = 1.0});
  CHECK(plant.state().omega1_rad_s == 0.0);
  CHECK(plant.state().omega2_rad_s > 1.0);
  CHECK(plant.slip() == 1.0);
}

TEST_CASE("Against a braked wheel with more grip than the motor has torque, the lower wheel creeps below 1 mm/s") {
  // The regularised slip turns static friction between the wheels into a slow creep; this bounds it.
  const PlantOptions options;
  Plant plant(options);
  plant.reset({.brake_torque_Nm = 9.03});
  plant.advance(0.5, {.motor_duty = 1.0, .brake_duty = 1.0});
  CHECK(plant.state().omega1_rad_s == 0.0);
  CHECK(plant.state().omega2_rad_s * options.rig.wheels.r2_m < 1e-3);
  CHECK_THAT(plant.tyre_force_N() * options.rig.wheels.r2_m,
             WithinAbs(options.rig.motor.stall_torque_Nm - options.rig.wheels.M20_Nm, 1e-3));
}

TEST_CASE("A reversed rig mirrors the forward one exactly") {
  Plant forward{PlantOptions{}};
  Plant backward{PlantOptions{}};
  forward.reset({.omega1_rad_s = 12.0, .omega2_rad_s = 30.0});
  backward.reset({.omega1_rad_s = -12.0, .omega2_rad_s = -30.0});
  for (int tick = 0; tick < 1500; ++tick) {
    const PlantInput input{.brake_duty = (tick / 50) % 2 == 0 ? 0.7 : 0.0};
    forward.advance(1e-3, input);
    backward.advance(1e-3, input);
    REQUIRE(forward.state().omega1_rad_s == -backward.state().omega1_rad_s);
    REQUIRE(forward.state().omega2_rad_s == -backward.state().omega2_rad_s);
    REQUIRE(forward.state().angle1_rad == -backward.state().angle1_rad);
  }
  CHECK(forward.state().omega2_rad_s == 0.0);
  CHECK(forward.state().angle1_rad > 0.0);
}

TEST_CASE("A wheel pulled through zero speed continues in the other direction without sticking") {
  // The upper wheel turns backward over a lower wheel going forward: it must pass zero without sticking.
  PlantOptions options;
  options.ideal_actuator = true;
  Plant plant(options);
  plant.reset({.omega1_rad_s = -5.0, .omega2_rad_s = 100.0});
  plant.advance(0.5, {.brake_torque_Nm = 0.2});
  CHECK(plant.state().omega1_rad_s > 20.0);
  // With more brake than the tyre can pull, it stays at zero instead.
  plant.reset({.omega1_rad_s = -5.0, .omega2_rad_s = 100.0});
  plant.advance(0.5, {.brake_torque_Nm = 3.0});
  CHECK(plant.state().omega1_rad_s == 0.0);
}

TEST_CASE("A spinning upper wheel stops on a lower wheel that its friction holds") {
  PlantOptions options;
  options.rig.wheels.M20_Nm = 5.0;  // more than r2 theta
  Plant plant(options);
  plant.reset({.omega1_rad_s = 60.0});
  double before_rad_s = 60.0;
  for (int tick = 0; tick < 2000; ++tick) {
    plant.advance(1e-3, {});
    REQUIRE(plant.state().omega2_rad_s == 0.0);
    REQUIRE(plant.state().omega1_rad_s >= 0.0);
    REQUIRE(plant.state().omega1_rad_s <= before_rad_s);
    before_rad_s = plant.state().omega1_rad_s;
  }
  CHECK(plant.state().omega1_rad_s == 0.0);
  CHECK(plant.state().angle2_rad == 0.0);
}
