// The gate's checks of each measurement: board, wheels, and whether they can judge.

#include <cstdint>
#include <tuple>
#include <utility>

#include "catch.hpp"
#include "runtime/command_gate.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using rig::Phase;
using rig::Reason;

namespace {
constexpr std::int64_t ms = 1'000'000;
}  // namespace

TEST_CASE("a fault that the board reports latches and makes the command safe") {
  struct Row {
    rig::Measurement measurement;
    Reason reason;
    double value;
  };
  const Row row = GENERATE(values<Row>({
      {{.trip_flags = 1}, Reason::board_interlock_tripped, 1.0},
      {{.trip_flags = 2}, Reason::board_supply_tripped, 2.0},
      {{.trip_flags = 3}, Reason::board_interlock_tripped, 3.0},
      {{.trip_flags = 4}, Reason::board_interlock_tripped, 4.0},
      {{.trip_flags = 6}, Reason::board_interlock_tripped, 6.0},
      {{.supply_V = 11.9}, Reason::board_supply_low, 11.9},
      {{.supply_V = 12.0}, Reason::none, 0.0},
      {{.temperature_C = 80.1}, Reason::board_too_hot, 80.1},
      {{.temperature_C = 80.0}, Reason::none, 0.0},
      {{}, Reason::none, 0.0},  // NaN: the board cannot tell
      {{.supply_V = 0.0, .temperature_C = 200.0, .trip_flags = 2}, Reason::board_supply_tripped, 2.0},
  }));
  CommandGate gate({.supply_min_V = 12.0, .temperature_max_C = 80.0});
  std::ignore = gate.check_measurement(row.measurement, 0);
  CHECK(gate.fault() == row.reason);
  CHECK(gate.fault_value() == row.value);
  const GateResult result = gate.check({.brake_duty = 0.5}, {});
  CHECK((result.command.brake_duty == 0.0) == (row.reason != Reason::none));
}

TEST_CASE("a board without supply is refused even if no least supply is set") {
  CommandGate gate(GateOptions{.supply_min_V = 0.0});
  std::ignore = gate.check_measurement({.supply_V = 0.1}, 0);
  CHECK(gate.fault() == Reason::none);
  std::ignore = gate.check_measurement({.supply_V = 0.0}, ms);
  CHECK(gate.fault() == Reason::board_supply_low);
}

TEST_CASE("a board that stops reporting its health is a fault, one that never reported it is not") {
  CommandGate supply(GateOptions{});
  std::ignore = supply.check_measurement({.supply_V = 24.0}, 0);
  std::ignore = supply.check_measurement({}, ms);
  CHECK(supply.fault() == Reason::board_health_lost);
  CHECK(supply.fault_value() == 1.0);
  CommandGate temperature(GateOptions{});
  std::ignore = temperature.check_measurement({.temperature_C = 30.0}, 0);
  std::ignore = temperature.check_measurement({.supply_V = 24.0}, ms);
  CHECK(temperature.fault() == Reason::board_health_lost);
  CHECK(temperature.fault_value() == 2.0);
  CommandGate healthy(GateOptions{});
  for (int i = 0; i < 3; ++i)
    std::ignore = healthy.check_measurement({.supply_V = 24.0, .temperature_C = 30.0}, i * ms);
  CHECK(healthy.fault() == Reason::none);
  CommandGate never(GateOptions{});
  std::ignore = never.check_measurement({}, 0);
  std::ignore = never.check_measurement({}, ms);
  CHECK(never.fault() == Reason::none);
}

namespace {

/// Feeds a gate that checks the wheels, with wheels that turn at given speeds, at 1 kHz.
struct CheckedWheels {
  explicit CheckedWheels(const PlausibilityLimits& limits) : gate(GateOptions{}, any_phase(), limits) {}
  void run(double omega1_rad_s, double omega2_rad_s, int cycles, const rig::Command& command = {}) {
    for (int i = 0; i < cycles; ++i) {
      now_ns += ms;
      angle1 += omega1_rad_s * 1e-3;
      angle2 += omega2_rad_s * 1e-3;
      std::ignore = gate.check_measurement({.time_ns = now_ns,
                                            .upper_counts = static_cast<std::int32_t>(angle1 * 651.8986),
                                            .lower_counts = static_cast<std::int32_t>(angle2 * 651.8986)},
                                           now_ns, reading_ns);
      static_cast<void>(gate.check(command, {.phase = Phase::brake, .now_ns = now_ns}));
    }
  }
  CommandGate gate;
  std::int64_t reading_ns{0};
  std::int64_t now_ns{0};
  double angle1{0.0};
  double angle2{0.0};
};

PlausibilityLimits paper_limits() { return plausibility_limits({}, false, {}); }

}  // namespace

TEST_CASE("the gate checks the wheels: encoders, response to what it sent, samples") {
  CheckedWheels sound(paper_limits());
  sound.run(100.0, 100.0, 1000);
  CHECK(sound.gate.fault() == Reason::none);
  sound.run(0.0, 100.0, 10);
  CHECK(sound.gate.fault() == Reason::encoder_upper_stuck);

  CheckedWheels rolling_on(paper_limits());
  rolling_on.run(100.0, 100.0, 700, {.brake_duty = 0.7});
  CHECK(rolling_on.gate.fault() == Reason::brake_no_response);

  CheckedWheels silent(paper_limits());
  silent.run(100.0, 100.0, 10);
  for (int i = 0; i < 30; ++i) std::ignore = silent.gate.check_measurement({.time_ns = 10 * ms}, (10 + i) * ms);
  CHECK(silent.gate.fault() == Reason::samples_missing);
  CHECK_FALSE(silent.gate.check_measurement({.time_ns = 10 * ms}, 40 * ms));
  CHECK(CommandGate(GateOptions{}, any_phase(), paper_limits()).check_measurement({.time_ns = ms}, ms));

  // A leap is found however slow the reading is.
  CheckedWheels held_up(paper_limits());
  held_up.run(100.0, 100.0, 10);
  std::ignore = held_up.gate.check_measurement({.time_ns = 11 * ms, .upper_counts = 100'000}, 11 * ms, 700'000);
  CHECK(held_up.gate.fault() == Reason::encoder_upper_jumped);

  CheckedWheels unchecked({});
  unchecked.run(100.0, 100.0, 10);
  unchecked.run(0.0, 100.0, 10);
  for (int i = 0; i < 30; ++i) CHECK(unchecked.gate.check_measurement({.time_ns = 10 * ms}, (20 + i) * ms));
  CHECK(unchecked.gate.fault() == Reason::none);
  CHECK(unchecked.gate.unjudged_share() == 0.0);
}

TEST_CASE("slow readings are judged: a stuck, a reversed and a swapped encoder are found") {
  for (const std::int64_t reading_us : {0, 400, 600, 950}) {
    CAPTURE(reading_us);
    const auto found = [reading_us](double omega1, double omega2, const rig::Command& command) {
      CheckedWheels wheels(paper_limits());
      wheels.reading_ns = reading_us * 1000;
      wheels.run(100.0, 100.0, 400);
      CHECK(wheels.gate.fault() == Reason::none);
      wheels.run(omega1, omega2, 300, command);
      return wheels.gate.fault();
    };
    CHECK(found(100.0, 0.0, {}) == Reason::encoder_lower_stuck);
    CHECK(found(0.0, 100.0, {}) == Reason::encoder_upper_stuck);
    CHECK(found(100.0, -100.0, {}) == Reason::encoder_lower_reversed);
    CHECK(found(100.0, 80.0, {.brake_duty = 0.7}) != Reason::none);
    CHECK(found(100.0, 100.0, {}) == Reason::none);
  }
}

TEST_CASE("checks that cannot judge for too long while an output is on are a fault of their own") {
  // Readings of 3 ms at 1 kHz: no window of less than 24 ms can be judged.
  GateOptions options{.judge_within_s = 0.02};
  const auto blind = [&options](const rig::Command& command, int cycles, std::int64_t reading_ns) {
    CommandGate gate(options, any_phase(), plausibility_limits({}, false, options));
    for (int i = 0; i < cycles; ++i) {
      std::ignore = gate.check_measurement({.time_ns = i * ms}, i * ms, reading_ns);
      std::ignore = gate.check(command, {.phase = Phase::brake, .now_ns = i * ms});
    }
    return std::pair(gate.fault(), gate.fault_value());
  };
  const rig::Command braking{.brake_duty = 0.1};
  CHECK(blind(braking, 100, 2'400'000).first == Reason::none);  // 19.2 ms
  CHECK(blind(braking, 21, 3 * ms).first == Reason::none);
  CHECK(blind(braking, 22, 3 * ms).first == Reason::checks_cannot_judge);
  CHECK(blind(braking, 22, 3 * ms).second == Approx(0.021));
  CHECK(blind({.motor_duty = 0.1, .motor_enable = true}, 22, 3 * ms).first == Reason::checks_cannot_judge);
  CHECK(blind({.brake_torque_Nm = 0.1}, 22, 3 * ms).first == Reason::checks_cannot_judge);
  CHECK(blind({}, 100, 12 * ms).first == Reason::none);  // nothing is on
}

TEST_CASE("pulses of an output count together until the checks judge again") {
  CommandGate gate({.judge_within_s = 0.02}, any_phase(), plausibility_limits({}, false, {}));
  for (int i = 0; i < 42; ++i) {
    CHECK(gate.fault() == Reason::none);
    std::ignore = gate.check_measurement({.time_ns = i * ms}, i * ms, 12 * ms);
    std::ignore = gate.check({.brake_duty = i % 2 == 0 ? 0.1 : 0.0}, {.phase = Phase::brake, .now_ns = i * ms});
  }
  std::ignore = gate.check_measurement({.time_ns = 43 * ms}, 43 * ms, 12 * ms);
  CHECK(gate.fault() == Reason::checks_cannot_judge);
}

TEST_CASE("the gate tells the share of time in which its checks could not judge") {
  CheckedWheels wheels(paper_limits());
  CHECK(wheels.gate.unjudged_share() == 0.0);
  wheels.run(100.0, 100.0, 1);
  CHECK(wheels.gate.unjudged_share() == 0.0);
  wheels.run(100.0, 100.0, 100);
  CHECK(wheels.gate.unjudged_share() == 0.0);
  // Of 5 ms, a verdict is due after 2 ms and comes at the end of the fifth: due and missing in 3 of 5 cycles.
  CheckedWheels slow(paper_limits());
  slow.reading_ns = 600'000;
  slow.run(100.0, 100.0, 1001);
  CHECK(slow.gate.unjudged_share() == Approx(0.6).margin(0.005));
}

TEST_CASE("the checks doubt a speed that its wheel cannot reach, and while a verdict is due") {
  CheckedWheels wheels(paper_limits());
  wheels.run(100.0, 100.0, 100);
  CHECK(wheels.gate.wheels_sound());
  wheels.run(100.0, 0.0, 4);
  CHECK(wheels.gate.fault() == Reason::none);
  CHECK_FALSE(wheels.gate.wheels_sound());
  wheels.run(100.0, 100.0, 6);
  CHECK(wheels.gate.wheels_sound());
  wheels.run(0.0, 100.0, 4);
  CHECK_FALSE(wheels.gate.wheels_sound());

  // Of windows of 5 ms, a verdict is due after 2 ms and comes at the end of the fifth.
  CheckedWheels slow(paper_limits());
  slow.reading_ns = 600'000;
  slow.run(100.0, 100.0, 101);
  int sound = 0;
  for (int cycle = 0; cycle < 5; ++cycle) {
    slow.run(100.0, 100.0, 1);
    sound += slow.gate.wheels_sound() ? 1 : 0;
  }
  CHECK(sound == 2);

  CheckedWheels unchecked({});
  unchecked.reading_ns = 600'000;
  for (int i = 0; i < 10; ++i) {
    unchecked.run(100.0, 100.0, 1);
    CHECK(unchecked.gate.wheels_sound());
  }
}
