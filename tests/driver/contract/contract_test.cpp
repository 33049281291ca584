// Behaviour that every backend must have.

#include <limits>
#include <numbers>

#include "bench.hpp"
#include "catch.hpp"
#include "rig/encoder_scale.hpp"

using namespace abs_hil;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using driver::DriverState;
using driver::IoError;
using test::Bench;
using test::make_bench;

namespace {

constexpr std::int64_t ms = 1'000'000;
constexpr rig::Command drive{.motor_duty = 0.5, .motor_enable = true};
constexpr rig::Command brake{.brake_duty = 0.6, .brake_torque_Nm = 2.9};
constexpr double duty_step = 1.0 / 4095.0;

std::unique_ptr<Bench> active_bench(std::int64_t now_ns = 0) {
  auto bench = make_bench();
  REQUIRE(bench != nullptr);
  bench->driver().configure();
  bench->driver().activate(now_ns);
  return bench;
}

void check_safe(Bench& bench) {
  const Bench::Wire wire = bench.wire();
  CHECK(wire.drive_duty == 0.0);
  CHECK(wire.brake_duty == 0.0);
}

/// Reads and commands once a millisecond, as a run does, and returns the last measurement.
rig::Measurement read_until(driver::RigDriver& driver, std::int64_t from_ns, std::int64_t to_ns,
                            const rig::Command& command = rig::safe_command) {
  rig::Measurement measurement;
  for (std::int64_t now = from_ns; now <= to_ns; now += ms) {
    REQUIRE(driver.read(now, measurement).ok());
    REQUIRE(driver.write(command).ok());
  }
  return measurement;
}

}  // namespace

TEST_CASE("Lifecycle: unconfigured, inactive, active, inactive, active") {
  auto bench = make_bench();
  REQUIRE(bench != nullptr);
  driver::RigDriver& rig = bench->driver();
  CHECK(rig.state() == DriverState::unconfigured);
  CHECK_THROWS_AS(rig.activate(0), driver::Unavailable);
  rig.configure();
  CHECK(rig.state() == DriverState::inactive);
  rig.activate(0);
  CHECK(rig.state() == DriverState::active);
  CHECK(rig.deactivate().ok());
  CHECK(rig.deactivate().ok());
  CHECK(rig.state() == DriverState::inactive);
  rig.activate(5 * ms);
  CHECK(rig.state() == DriverState::active);
}

TEST_CASE("Nothing is written while inactive") {
  auto bench = make_bench();
  REQUIRE(bench != nullptr);
  driver::RigDriver& rig = bench->driver();
  rig::Measurement measurement;
  CHECK(rig.write(brake).error == IoError::not_active);
  rig.configure();
  CHECK(rig.write(brake).error == IoError::not_active);
  CHECK(rig.read(0, measurement).error == IoError::not_active);
  CHECK(rig.deactivate().ok());
  CHECK(bench->writes() == 0);
  check_safe(*bench);

  rig.activate(0);
  if (bench->has_registers()) CHECK(bench->writes() > 0);
  check_safe(*bench);
  CHECK(rig.deactivate().ok());
  const std::uint64_t writes = bench->writes();
  CHECK(rig.write(brake).error == IoError::not_active);
  CHECK(bench->writes() == writes);
  check_safe(*bench);
}

TEST_CASE("Commands reach the wire as 12-bit duties; the motor only while enabled") {
  auto bench = active_bench();
  REQUIRE(bench->driver().write(drive).ok());
  CHECK(std::abs(bench->wire().drive_duty - 0.5) <= 0.5 * duty_step + 1e-6);
  CHECK(bench->wire().brake_duty == 0.0);
  REQUIRE(bench->driver().write({.motor_duty = 0.5, .motor_enable = false}).ok());
  check_safe(*bench);
  REQUIRE(bench->driver().write(brake).ok());
  CHECK(std::abs(bench->wire().brake_duty - 0.6) <= 0.5 * duty_step + 1e-6);
  CHECK(bench->wire().drive_duty == 0.0);
}

TEST_CASE("The driver tells the command as its outputs show it, to the last bit of its grid") {
  auto bench = active_bench();
  driver::RigDriver& rig = bench->driver();
  rig::Command sent;
  for (int n = 0; n <= 200; ++n) {
    const double duty = n / 200.0 * 0.99999;
    const rig::Command command{
        .motor_duty = duty, .brake_duty = 1.0 - duty, .motor_enable = n % 3 != 0, .brake_torque_Nm = 2.5};
    REQUIRE(rig.write(command, sent).ok());
    const rig::Command expected = rig.as_sent(command);
    CHECK(sent.motor_duty == expected.motor_duty);
    CHECK(sent.brake_duty == expected.brake_duty);
    CHECK(sent.motor_enable == command.motor_enable);
    CHECK(sent.brake_torque_Nm == 2.5);
    CHECK(rig.as_sent(sent).brake_duty == sent.brake_duty);
    CHECK(rig.as_sent(sent).motor_duty == sent.motor_duty);
    if (n % 20 == 0) {
      // The emulator behind FUSE prints 4 digits; half a step is 1.2e-4 at the finest.
      CHECK_THAT(sent.motor_duty, WithinAbs(bench->wire().drive_duty, 5.1e-5));
      CHECK_THAT(sent.brake_duty, WithinAbs(bench->wire().brake_duty, 5.1e-5));
    }
  }
  CHECK(rig.write({.brake_duty = 2.0}, sent).error == IoError::command_out_of_range);
  CHECK(sent.brake_duty == 0.0);
  sent = brake;
  CHECK(rig.write(brake, sent).error == IoError::not_active);
  CHECK(sent.brake_duty == 0.0);
}

TEST_CASE("Counters start near 0 and count 4096 to a revolution, up for forward") {
  auto bench = active_bench();
  const rig::Measurement first = read_until(bench->driver(), 0, 0);
  CHECK(std::abs(first.upper_counts) <= 1);
  CHECK(std::abs(first.lower_counts) <= 1);
  CHECK(first.time_ns == 0);
  const rig::Measurement last = read_until(bench->driver(), ms, 100 * ms);
  CHECK(last.time_ns == 100 * ms);
  // 60 rad/s for 0.1 s; bearing friction takes a few tenths of a percent.
  const double revolutions = test::bench_speed_rad_s * 0.1 / (2.0 * std::numbers::pi);
  CHECK_THAT(static_cast<double>(rig::counts_between(first.upper_counts, last.upper_counts)),
             WithinRel(4096.0 * revolutions, 0.02));
  CHECK_THAT(static_cast<double>(rig::counts_between(first.lower_counts, last.lower_counts)),
             WithinRel(4096.0 * revolutions, 0.02));
}

TEST_CASE("The brake slows the upper wheel, in the units of the measurement") {
  auto bench = active_bench();
  rig::Measurement before = read_until(bench->driver(), 0, 100 * ms);
  const std::int32_t free_counts = before.upper_counts;
  REQUIRE(bench->driver().write(brake).ok());
  const rig::Measurement braked = read_until(bench->driver(), 101 * ms, 200 * ms, brake);
  CHECK(rig::counts_between(before.upper_counts, braked.upper_counts) < free_counts * 97 / 100);
}

TEST_CASE("Deactivation leaves the safe state, from driving and from braking") {
  for (const rig::Command& command : {drive, brake}) {
    auto bench = active_bench();
    REQUIRE(bench->driver().write(command).ok());
    REQUIRE(bench->wire().drive_duty + bench->wire().brake_duty > 0.4);
    CHECK(bench->driver().deactivate().ok());
    check_safe(*bench);
  }
}

TEST_CASE("The destructor leaves the safe state") {
  for (const rig::Command& command : {drive, brake}) {
    auto bench = active_bench();
    REQUIRE(bench->driver().write(command).ok());
    bench->destroy_driver();
    check_safe(*bench);
  }
}

TEST_CASE("Configuring anew leaves the safe state first") {
  auto bench = active_bench();
  REQUIRE(bench->driver().write(brake).ok());
  bench->driver().configure();
  check_safe(*bench);
  CHECK(bench->driver().state() == DriverState::inactive);
}

TEST_CASE("A command outside its range is refused, the rig made safe, the failure latched") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const rig::Command& bad : {rig::Command{.motor_duty = nan}, rig::Command{.brake_duty = 1.01},
                                  rig::Command{.brake_duty = -0.01}, rig::Command{.brake_torque_Nm = nan}}) {
    auto bench = active_bench();
    REQUIRE(bench->driver().write(drive).ok());
    CHECK(bench->driver().write(bad).error == IoError::command_out_of_range);
    check_safe(*bench);
    CHECK(bench->driver().state() == DriverState::failed);
    CHECK(bench->driver().write(drive).error == IoError::not_active);
    check_safe(*bench);
    bench->driver().configure();
    CHECK(bench->driver().state() == DriverState::inactive);
  }
}

TEST_CASE("An output that does not take its value is found, and the other output made safe") {
  auto bench = active_bench();
  REQUIRE(bench->driver().write(drive).ok());
  if (!bench->break_brake_output()) {
    CHECK_FALSE(bench->has_registers());  // only a backend without registers may be unable to fail
    return;
  }
  const rig::Command both{.motor_duty = 0.5, .brake_duty = 0.6, .motor_enable = true};
  driver::IoResult result = bench->driver().write(both);
  if (bench->read_back_cycles() == 0) {
    CHECK(bench->driver().state() == DriverState::failed);
  } else {
    // What the board applies comes with its answers. A failed read leaves the driver active, the drive at 0.
    REQUIRE(result.ok());
    rig::Measurement measurement;
    for (int i = 1; i <= bench->read_back_cycles() && result.ok(); ++i)
      result = bench->driver().read(i * ms, measurement);
    CHECK(bench->driver().state() == DriverState::active);
  }
  CHECK(result.error == IoError::read_back_mismatch);
  CHECK(bench->wire().drive_duty == 0.0);
}

TEST_CASE("Another writer's duty is found within five cycles, as a fault of its own, and made safe") {
  for (const rig::Command& command : {rig::safe_command, drive, brake}) {
    auto bench = active_bench();
    driver::IoResult result{};
    int cycles = 0;
    for (rig::Measurement measurement; result.ok() && cycles < 5;) {
      result = bench->driver().read(++cycles * ms, measurement);
      if (result.ok()) result = bench->driver().write(command);
      if (!result.ok()) break;
      // It writes after the driver has written: its duty stays for all but the moment of the driver's next write.
      if (!bench->write_as_other(1.0)) {
        CHECK_FALSE(bench->has_registers());
        return;
      }
    }
    CAPTURE(command.motor_duty, command.brake_duty, cycles, driver::error_text(result));
    CHECK(result.error == IoError::foreign_writer);
    CHECK(result.reason == rig::Reason::foreign_writer);
    CHECK(bench->driver().deactivate().ok());
    check_safe(*bench);
  }
}

TEST_CASE("Activation again starts the counters and the measurement anew") {
  auto bench = active_bench();
  const rig::Measurement old = read_until(bench->driver(), 0, 300 * ms);
  REQUIRE(old.upper_counts > 1000);
  CHECK(bench->driver().deactivate().ok());
  bench->driver().activate(1000 * ms);
  const rig::Measurement first = read_until(bench->driver(), 1000 * ms, 1000 * ms);
  CHECK(std::abs(first.upper_counts) <= 1);
  CHECK(std::abs(first.lower_counts) <= 1);
  CHECK(first.time_ns == 1000 * ms);
  check_safe(*bench);
  const rig::Measurement later = read_until(bench->driver(), 1001 * ms, 1010 * ms);
  CHECK(later.upper_counts > 50);  // the wheels still turn
}

TEST_CASE("Values that the board cannot measure are NaN; only the simulator knows the true values") {
  auto bench = active_bench();
  const rig::Measurement measurement = read_until(bench->driver(), 0, 10 * ms);
  CHECK(measurement.trip_flags == 0);
  CHECK_FALSE(measurement.ideal_speeds.has_value());
  if (bench->has_registers()) CHECK(std::isnan(bench->driver().truth().speeds.omega1_rad_s));
  if (bench->tells_health()) {
    CHECK_THAT(static_cast<double>(measurement.supply_V), WithinRel(24.0, 0.001));
    CHECK_THAT(measurement.temperature_C, WithinAbs(30.0, 0.1));
  } else {
    CHECK(std::isnan(measurement.supply_V));
    CHECK(std::isnan(measurement.temperature_C));
  }
}
