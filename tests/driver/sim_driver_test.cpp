// The simulated rig as a board: when it obeys, and its steps of duty.
#include "driver/sim/sim_driver.hpp"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "catch.hpp"

using namespace abs_hil::driver;
using abs_hil::plant_sim::PlantOptions;
using abs_hil::rig::Command;
using abs_hil::rig::Measurement;
using Catch::Matchers::WithinAbs;

namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr Command accelerate{.motor_duty = 1.0, .motor_enable = true};
constexpr Command brake{.brake_duty = 0.5, .brake_torque_Nm = 1.4};

bool outputs_safe(const SimDriver& driver) {
  const auto& out = driver.outputs();
  return out.motor_duty == 0.0 && out.brake_duty == 0.0 && out.brake_torque_Nm == 0.0;
}

}  // namespace

TEST_CASE("The simulated rig obeys commands only while active and is safe after") {
  SimDriver driver({}, {});
  CHECK(driver.write(brake).error == IoError::not_active);
  CHECK(outputs_safe(driver));
  driver.configure();
  CHECK(driver.write(brake).error == IoError::not_active);
  CHECK(outputs_safe(driver));
  driver.activate(5 * ms);
  CHECK(outputs_safe(driver));
  REQUIRE(driver.write(accelerate).ok());
  CHECK(driver.outputs().motor_duty == 1.0);
  REQUIRE(driver.write(brake).ok());
  CHECK(driver.outputs().motor_duty == 0.0);
  CHECK(driver.outputs().brake_duty > 0.0);
  CHECK(driver.outputs().brake_torque_Nm == 1.4);
  CHECK(driver.deactivate().ok());
  CHECK(outputs_safe(driver));
  CHECK(driver.write(brake).error == IoError::not_active);
  CHECK(outputs_safe(driver));
}

TEST_CASE("The motor gets its duty only while enabled") {
  SimDriver driver({}, {});
  driver.configure();
  driver.activate(0);
  REQUIRE(driver.write({.motor_duty = 1.0, .motor_enable = false}).ok());
  CHECK(driver.outputs().motor_duty == 0.0);
  Measurement measurement;
  REQUIRE(driver.read(100 * ms, measurement).ok());
  CHECK(driver.truth().speeds.omega2_rad_s == 0.0);
}

TEST_CASE("Duties are those of a 12-bit PWM") {
  SimDriver driver({}, {});
  driver.configure();
  driver.activate(0);
  for (const double duty : {0.0, 1.0, 0.5, 0.3333, 0.415, 0.9999}) {
    REQUIRE(driver.write({.motor_duty = duty, .brake_duty = duty, .motor_enable = true}).ok());
    const double steps = driver.outputs().brake_duty * 4095.0;
    CHECK_THAT(steps, WithinAbs(std::round(steps), 1e-9));
    CHECK_THAT(driver.outputs().brake_duty, WithinAbs(duty, 0.5 / 4095.0 + 1e-15));
    CHECK(driver.outputs().motor_duty == driver.outputs().brake_duty);
  }
  REQUIRE(driver.write({.brake_duty = 0.5 / 4095.0 - 1e-9}).ok());
  CHECK(driver.outputs().brake_duty == 0.0);
  REQUIRE(driver.write({.brake_duty = 0.5 / 4095.0 + 1e-9}).ok());
  CHECK(driver.outputs().brake_duty == 1.0 / 4095.0);
}

TEST_CASE("The ideal actuator has no quantisation of the brake; the motor keeps it") {
  SimDriver driver({.ideal_actuator = true}, {});
  driver.configure();
  driver.activate(0);
  REQUIRE(
      driver.write({.motor_duty = 0.3333, .brake_duty = 0.3333, .motor_enable = true, .brake_torque_Nm = 2.5}).ok());
  CHECK(driver.outputs().brake_duty == 0.3333);
  CHECK(driver.outputs().motor_duty == 1365.0 / 4095.0);
  Measurement measurement;
  REQUIRE(driver.read(1 * ms, measurement).ok());
  CHECK(driver.truth().brake_torque_Nm == 2.5);
}

TEST_CASE("A command outside its range is refused, and the rig is made safe until a new configure") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const Command bad = GENERATE_COPY(values<Command>({{.motor_duty = -1e-9},
                                                     {.motor_duty = 1.0 + 1e-9},
                                                     {.motor_duty = nan},
                                                     {.brake_duty = -1e-9},
                                                     {.brake_duty = 1.0 + 1e-9},
                                                     {.brake_duty = infinity},
                                                     {.brake_torque_Nm = -1e-9},
                                                     {.brake_torque_Nm = nan},
                                                     {.brake_torque_Nm = infinity}}));
  SimDriver driver({}, {});
  driver.configure();
  driver.activate(0);
  REQUIRE(driver.write(brake).ok());
  CHECK(driver.write(bad).error == IoError::command_out_of_range);
  CHECK(outputs_safe(driver));
  CHECK(driver.state() == DriverState::failed);
  CHECK(driver.write(brake).error == IoError::not_active);
  CHECK(outputs_safe(driver));
}

TEST_CASE("A late read meets a plant that has moved on under the held command") {
  SimDriver punctual({}, {.start_speed_rad_s = 170.0});
  SimDriver late({}, {.start_speed_rad_s = 170.0});
  Measurement measurement;
  for (SimDriver* driver : {&punctual, &late}) {
    driver->configure();
    driver->activate(1000 * ms);
    REQUIRE(driver->read(1000 * ms, measurement).ok());
    REQUIRE(driver->write(brake).ok());
  }
  REQUIRE(punctual.read(1010 * ms, measurement).ok());
  const Measurement in_time = measurement;
  REQUIRE(late.read(1013 * ms, measurement).ok());
  CHECK(measurement.time_ns == 1013 * ms);
  CHECK(measurement.lower_counts > in_time.lower_counts + 300);  // 3 ms at 110000 counts/s
  CHECK(late.truth().brake_torque_Nm > punctual.truth().brake_torque_Nm);
  REQUIRE(punctual.read(1013 * ms, measurement).ok());
  CHECK_THAT(punctual.truth().speeds.omega1_rad_s, WithinAbs(late.truth().speeds.omega1_rad_s, 1e-7));
}

TEST_CASE("The truth is that of the last read, and a second read at the same time changes nothing") {
  SimDriver driver({}, {.start_speed_rad_s = 100.0});
  driver.configure();
  driver.activate(0);
  CHECK(driver.truth().speeds.omega1_rad_s == 100.0);
  Measurement first;
  REQUIRE(driver.read(10 * ms, first).ok());
  const double speed_rad_s = driver.truth().speeds.omega1_rad_s;
  CHECK(speed_rad_s < 100.0);
  REQUIRE(driver.write(brake).ok());
  CHECK(driver.truth().speeds.omega1_rad_s == speed_rad_s);
  Measurement second;
  REQUIRE(driver.read(10 * ms, second).ok());
  CHECK(second.upper_counts == first.upper_counts);
  CHECK(driver.truth().speeds.omega1_rad_s == speed_rad_s);
}

TEST_CASE("Activation starts the run anew") {
  SimDriver driver({}, {.start_speed_rad_s = 50.0});
  driver.configure();
  driver.activate(0);
  REQUIRE(driver.write({.brake_duty = 1.0}).ok());
  Measurement first;
  REQUIRE(driver.read(200 * ms, first).ok());
  CHECK(driver.truth().speeds.omega1_rad_s < 40.0);
  REQUIRE(driver.deactivate().ok());
  driver.activate(5000 * ms);
  CHECK(outputs_safe(driver));
  Measurement again;
  REQUIRE(driver.read(5000 * ms, again).ok());
  CHECK(again.upper_counts == 0);
  CHECK(again.lower_counts == 0);
  CHECK(driver.truth().speeds.omega1_rad_s == 50.0);
  CHECK(driver.truth().brake_torque_Nm == 0.0);
  REQUIRE(driver.write({.brake_duty = 1.0}).ok());
  REQUIRE(driver.read(5200 * ms, again).ok());
  CHECK(again.upper_counts == first.upper_counts);
}

TEST_CASE("An invalid start speed is refused") {
  CHECK_THROWS_AS(SimDriver({}, {.start_speed_rad_s = -1.0}), std::invalid_argument);
  CHECK_THROWS_AS(SimDriver({}, {.start_speed_rad_s = std::nan("")}), std::invalid_argument);
  PlantOptions bad;
  bad.max_step_s = 0.0;
  CHECK_THROWS_AS(SimDriver(bad, {}), std::invalid_argument);
}
