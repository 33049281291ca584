#include "runtime/command_gate.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <tuple>
#include <utility>

#include "catch.hpp"
#include "runtime/fault_brake.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using rig::Phase;
using rig::Reason;

namespace {
constexpr GateInput moderate{{100.0, 100.0}, Phase::brake, 0};
constexpr std::int64_t ms = 1'000'000;
constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

bool is_safe(const rig::Command& command) {
  return command.motor_duty == 0.0 && command.brake_duty == 0.0 && !command.motor_enable &&
         command.brake_torque_Nm == 0.0;
}
}  // namespace

TEST_CASE("a sound command passes unchanged") {
  CommandGate gate(GateOptions{});
  const GateResult result = gate.check({.brake_duty = 0.7, .brake_torque_Nm = 4.0}, moderate);
  CHECK(result.action == GateAction::passed);
  CHECK(result.command.brake_duty == 0.7);
  CHECK(result.command.brake_torque_Nm == 4.0);
  CHECK(gate.count(GateAction::passed) == 1);
}

TEST_CASE("duties are limited, and that is counted") {
  CommandGate gate({.motor_duty_max = 0.8, .brake_duty_max = 0.7});
  CHECK(gate.check({.brake_duty = 0.9}, moderate).command.brake_duty == 0.7);
  CHECK(gate.check({.brake_duty = -0.1}, moderate).command.brake_duty == 0.0);
  CHECK(gate.check({.motor_duty = 1.0, .motor_enable = true}, {.now_ns = ms}).command.motor_duty == 0.8);
  CHECK(gate.count(GateAction::brake_clamped) == 2);
  CHECK(gate.count(GateAction::motor_clamped) == 1);
}

TEST_CASE("the motor is off while the brake acts and while it is not enabled") {
  CommandGate gate(GateOptions{});
  const GateResult both = gate.check({.motor_duty = 1.0, .brake_duty = 0.5, .motor_enable = true}, moderate);
  CHECK(both.action == GateAction::motor_blocked_by_brake);
  CHECK(both.command.motor_duty == 0.0);
  CHECK_FALSE(both.command.motor_enable);
  CHECK(both.command.brake_duty == 0.5);
  const GateResult disabled = gate.check({.motor_duty = 1.0}, {.now_ns = ms});
  CHECK(disabled.action == GateAction::motor_blocked_by_disable);
  CHECK(disabled.command.motor_duty == 0.0);
}

TEST_CASE("a value that is not finite latches a fault; from then on only the safe command passes") {
  for (const double bad : {not_a_number, infinite, -infinite}) {
    CommandGate gate(GateOptions{});
    CHECK(is_safe(gate.check({.brake_duty = bad}, moderate).command));
    CHECK(gate.fault() == rig::Reason::command_not_finite);
    const GateResult later = gate.check({.brake_duty = 0.5}, moderate);
    CHECK(is_safe(later.command));
    CHECK(later.action == GateAction::refused);
    CHECK(later.fault == rig::Reason::command_not_finite);

    CommandGate blind(GateOptions{});
    CHECK(is_safe(blind.check({.brake_duty = 0.5}, {.speeds = {bad, 1.0}}).command));
    CHECK(blind.fault() == rig::Reason::estimate_not_finite);
    CommandGate other(GateOptions{});
    CHECK(is_safe(other.check({.brake_duty = 0.5}, {.speeds = {1.0, bad}}).command));
    CHECK(other.fault() == rig::Reason::estimate_not_finite);
    CommandGate torque(GateOptions{});
    CHECK(is_safe(torque.check({.brake_torque_Nm = bad}, moderate).command));
    CHECK(torque.fault() == rig::Reason::command_not_finite);
  }
}

TEST_CASE("overspeed of either wheel, either way round, latches; the limit itself does not") {
  const double limit = GateOptions{}.overspeed_rad_s;
  for (const rig::WheelSpeeds speeds : {rig::WheelSpeeds{limit + 0.1, 0.0}, rig::WheelSpeeds{0.0, -limit - 0.1}}) {
    CommandGate gate(GateOptions{});
    CHECK(gate.check({.motor_duty = 1.0, .motor_enable = true}, {.speeds = {limit, limit}}).action ==
          GateAction::passed);
    CHECK(is_safe(gate.check({.motor_duty = 1.0, .motor_enable = true}, {.speeds = speeds}).command));
    CHECK(gate.fault() == rig::Reason::overspeed);
    CHECK(gate.fault_value() == limit + 0.1);
  }
}

TEST_CASE("the first fault stays") {
  CommandGate gate(GateOptions{});
  gate.latch(rig::Reason::driver_read_failed, 2.0);
  gate.latch(rig::Reason::overspeed, 300.0);
  const GateResult refused = gate.check({}, moderate);
  CHECK(refused.fault == rig::Reason::driver_read_failed);
  CHECK(refused.fault_value == 2.0);
  CHECK(gate.fault() == rig::Reason::driver_read_failed);
  CHECK(gate.fault_value() == 2.0);
}

TEST_CASE("a command exactly at the limits passes and is not counted as limited") {
  CommandGate gate({.motor_duty_max = 0.8, .brake_duty_max = 0.7});
  CHECK(gate.check({.brake_duty = 0.7}, moderate).command.brake_duty == 0.7);
  CHECK(gate.check({.motor_duty = 0.8, .motor_enable = true}, moderate).action == GateAction::motor_rate_limited);
  CHECK(gate.check({}, {.now_ns = ms}).command.brake_duty == 0.0);
  CHECK(gate.check({.motor_duty = 0.8, .motor_enable = true}, {.now_ns = 2 * ms}).action == GateAction::passed);
  CHECK(gate.count(GateAction::brake_clamped) == 0);
  CHECK(gate.count(GateAction::motor_clamped) == 0);
}

TEST_CASE("a torque below 0 becomes 0") {
  CommandGate gate(GateOptions{});
  CHECK(gate.check({.brake_torque_Nm = -1.0}, moderate).command.brake_torque_Nm == 0.0);
}

TEST_CASE("duties rise no faster than their rates by real elapsed time, and fall at once") {
  CommandGate gate({.motor_rate_per_s = 100.0, .brake_rate_per_s = 50.0});
  const auto check = [&](const rig::Command& wanted, std::int64_t at_ms) {
    return gate.check(wanted, {.phase = Phase::brake, .now_ns = at_ms * ms});
  };
  static_cast<void>(check({.brake_duty = 0.2}, 0));  // the first: the outputs have been 0 for long
  CHECK(gate.count(GateAction::brake_rate_limited) == 0);
  CHECK(check({.brake_duty = 1.0}, 2).command.brake_duty == Approx(0.3));
  CHECK(gate.count(GateAction::brake_rate_limited) == 1);
  CHECK(check({.brake_duty = 0.4}, 4).command.brake_duty == 0.4);  // just what the rate allows
  CHECK(gate.count(GateAction::brake_rate_limited) == 1);
  CHECK(check({.brake_duty = 1.0}, 14).command.brake_duty == Approx(0.9));
  CHECK(check({.brake_duty = 0.0}, 15).command.brake_duty == 0.0);
  CHECK(check({.brake_duty = 1.0}, 16).command.brake_duty == Approx(0.05));
  const GateResult motor = check({.motor_duty = 0.7, .motor_enable = true}, 18);
  CHECK(motor.command.motor_duty == Approx(0.2));
  CHECK(motor.action == GateAction::motor_rate_limited);
  CHECK(gate.count(GateAction::motor_rate_limited) == 1);
  CHECK(check({.motor_duty = 0.1, .motor_enable = true}, 19).command.motor_duty == 0.1);
  // Nothing rises while time stands still or runs backwards.
  CHECK(check({.motor_duty = 0.2, .motor_enable = true}, 19).command.motor_duty == Approx(0.1));
}

TEST_CASE("the rate limits the brake's torque: the dead zone is crossed at once") {
  CommandGate gate({.brake_rate_per_s = 50.0}, any_phase(), {}, 0.4);
  const auto check = [&](double duty, std::int64_t at_ms) {
    return gate.check({.brake_duty = duty}, {.phase = Phase::brake, .now_ns = at_ms * ms}).command.brake_duty;
  };
  CHECK(check(0.0, 0) == 0.0);
  CHECK(check(0.4, 1) == 0.4);  // no torque yet
  CHECK(check(1.0, 2) == Approx(0.45));
  CHECK(check(0.0, 3) == 0.0);
  CHECK(check(1.0, 4) == Approx(0.45));  // 1 ms of torque beyond u0
  CHECK(check(1.0, 6) == Approx(0.55));
  CHECK(gate.count(GateAction::brake_rate_limited) == 3);
}

TEST_CASE("a rise goes on from what was sent, but a PWM's steps do not swallow a slow one") {
  CommandGate gate({.motor_rate_per_s = 0.1, .brake_rate_per_s = 0.1});
  const auto duty_at = [&](std::int64_t at_ms) {
    return gate.check({.motor_duty = 1.0, .motor_enable = true}, {.phase = Phase::accelerate, .now_ns = at_ms * ms})
        .command.motor_duty;
  };
  static_cast<void>(gate.check({}, {.now_ns = 0}));
  // 0.1/s is less than half a step of 8 bits in each cycle, which the driver rounds to 0.
  double duty = 0.0;
  for (int n = 1; n <= 1000; ++n) {
    duty = duty_at(n);
    gate.note_sent({.motor_duty = std::round(duty * 255.0) / 255.0, .motor_enable = true});
  }
  CHECK(duty == Approx(0.1));
  // The board did not take the last commands: the output is still 0.
  gate.note_sent({});
  CHECK(duty_at(1001) < 0.003);
}

TEST_CASE("the checks of the wheels count the brake as it was sent, not as it was wanted") {
  const rig::RigParameters rig;
  const GateOptions options;
  CommandGate gate(options, any_phase(), plausibility_limits(rig, false, options));
  // The brake is wanted for a second, but the driver sent none, and the wheels keep their speed.
  double angle_rad = 0.0;
  for (int n = 0; n < 1000; ++n) {
    const auto counts = static_cast<std::int32_t>(angle_rad / (2.0 * std::numbers::pi) * 4096.0);
    CHECK(gate.check_measurement({.time_ns = n * ms, .upper_counts = counts, .lower_counts = counts}, n * ms));
    static_cast<void>(
        gate.check({.brake_duty = 0.9}, {.speeds = {100.0, 100.0}, .phase = Phase::brake, .now_ns = n * ms}));
    gate.note_sent({});
    angle_rad += 0.1;
  }
  CHECK(gate.fault() == rig::Reason::none);
}

TEST_CASE("motor and brake act only in the phases whose plan has them, together only where it says so") {
  PhasePermissions permissions{};
  permissions[static_cast<std::size_t>(Phase::accelerate)] = {.motor = true};
  permissions[static_cast<std::size_t>(Phase::brake)] = {.brake = true};
  permissions[static_cast<std::size_t>(Phase::hold)] = {.motor = true, .brake = true, .together = true};
  const rig::Command driving{.motor_duty = 0.5, .motor_enable = true};
  const rig::Command braking{.brake_duty = 0.5, .brake_torque_Nm = 1.0};
  const rig::Command both{.motor_duty = 0.5, .brake_duty = 0.5, .motor_enable = true, .brake_torque_Nm = 1.0};
  const auto in = [&](Phase phase, const rig::Command& wanted) {
    CommandGate gate(GateOptions{}, permissions);
    return gate.check(wanted, {.phase = phase});
  };
  CHECK(in(Phase::accelerate, driving).action == GateAction::passed);
  CHECK(in(Phase::accelerate, driving).command.motor_enable);
  CHECK(in(Phase::brake, braking).action == GateAction::passed);
  CHECK(in(Phase::hold, both).action == GateAction::passed);
  CHECK(in(Phase::hold, both).command.motor_duty == 0.5);
  CHECK(in(Phase::brake, driving).action == GateAction::motor_blocked_by_phase);
  CHECK(is_safe(in(Phase::brake, driving).command));
  CHECK(in(Phase::accelerate, braking).action == GateAction::brake_blocked_by_phase);
  CHECK(is_safe(in(Phase::accelerate, braking).command));
  CHECK(in(Phase::accelerate, {.brake_torque_Nm = 1.0}).action == GateAction::brake_blocked_by_phase);
  for (const Phase phase : {Phase::idle, Phase::coast, Phase::stopped, Phase::fault}) {
    CHECK(is_safe(in(phase, both).command));
    CHECK(is_safe(in(phase, driving).command));
    CHECK(is_safe(in(phase, braking).command));
  }
}

TEST_CASE("every action is counted, several of one command too") {
  CommandGate gate({.motor_duty_max = 0.5, .brake_duty_max = 0.5});
  static_cast<void>(gate.check({}, moderate));
  CHECK(gate.count(GateAction::passed) == 1);
  static_cast<void>(gate.check({.motor_duty = 0.9, .brake_duty = 0.9}, {.now_ns = ms}));
  gate.latch(Reason::overspeed, 1.0);
  static_cast<void>(gate.check({}, moderate));
  static_cast<void>(gate.check({}, moderate));
  const rig::GateCounts counts = gate.counts();
  CHECK(counts[static_cast<std::size_t>(GateAction::passed)] == 1);
  CHECK(counts[static_cast<std::size_t>(GateAction::motor_clamped)] == 1);
  CHECK(counts[static_cast<std::size_t>(GateAction::brake_clamped)] == 1);
  CHECK(counts[static_cast<std::size_t>(GateAction::motor_blocked_by_disable)] == 1);
  CHECK(counts[static_cast<std::size_t>(GateAction::refused)] == 2);
  CHECK(rig::interventions(counts) == 5);
  CHECK(rig::name_of(GateAction::brake_blocked_by_phase) == "brake_blocked_by_phase");
}

TEST_CASE("a motor that is not enabled stays disabled, and the result tells the actions on this command only") {
  CommandGate gate(GateOptions{});
  CHECK_FALSE(gate.check({.motor_duty = 0.5}, moderate).command.motor_enable);
  const GateResult next = gate.check({.motor_enable = true}, {.now_ns = ms});
  CHECK(next.action == GateAction::passed);
  CHECK(next.command.motor_enable);
  CHECK(next.fault == Reason::none);
  CHECK(next.fault_value == 0.0);
}

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

TEST_CASE("after a fault the brake holds at most its duty for the fault, motor off, until its limit") {
  const GateOptions options{.brake_duty_max = 0.7, .fault_brake_duty = 0.5, .fault_brake_limit_s = 0.01};
  const rig::Command wanted{.motor_duty = 0.4, .brake_duty = 0.6, .motor_enable = true, .brake_torque_Nm = 3.0};
  CommandGate gate(options);
  gate.latch(Reason::encoder_upper_stuck, 0.0);
  CHECK(gate.brake_barred_by() == Reason::none);
  const GateResult first = gate.check(wanted, {.phase = Phase::fault, .now_ns = 5 * ms});
  CHECK(first.command.brake_duty == 0.5);
  CHECK(first.command.brake_torque_Nm == Approx(2.5));
  CHECK(first.command.motor_duty == 0.0);
  CHECK_FALSE(first.command.motor_enable);
  CHECK(first.action == GateAction::refused);
  CHECK(first.fault == Reason::encoder_upper_stuck);
  CHECK(gate.check({.brake_duty = 0.2}, {.now_ns = 15 * ms}).command.brake_duty == 0.2);
  CHECK(is_safe(gate.check({.brake_duty = 0.2}, {.now_ns = 15 * ms + 1}).command));
  CHECK(gate.count(GateAction::passed) == 0);
  CHECK(gate.count(GateAction::refused) == 3);
}

TEST_CASE("the brake after a fault is never above the largest duty, and only where the phase permits it") {
  CommandGate capped({.brake_duty_max = 0.3, .fault_brake_duty = 0.5});
  capped.latch(Reason::overspeed, 0.0);
  CHECK(capped.check({.brake_duty = 0.5}, moderate).command.brake_duty == 0.3);
  CommandGate elsewhere({.fault_brake_duty = 0.5}, PhasePermissions{});
  elsewhere.latch(Reason::overspeed, 0.0);
  CHECK(is_safe(elsewhere.check({.brake_duty = 0.5}, moderate).command));
}

TEST_CASE("faults of brake, board, driver, guardian and time bar the brake, also after another fault") {
  for (const rig::ReasonRow& row : rig::reasons) {
    CAPTURE(row.name);
    if (row.kind != rig::ReasonKind::fault) continue;
    CommandGate gate({.fault_brake_duty = 0.5});
    gate.latch(row.reason, 0.0);
    const bool holds = gate.check({.brake_duty = 0.5}, moderate).command.brake_duty == 0.5;
    CHECK(holds == brake_may_hold_after(row.reason));
    CHECK((gate.brake_barred_by() == Reason::none) == holds);
    CommandGate later({.fault_brake_duty = 0.5});
    later.latch(Reason::overspeed, 0.0);
    CHECK(later.check({.brake_duty = 0.5}, moderate).command.brake_duty == 0.5);
    later.latch(row.reason, 0.0);
    CHECK((later.check({.brake_duty = 0.5}, moderate).command.brake_duty == 0.5) == holds);
    CHECK(later.fault() == Reason::overspeed);
  }
  for (const Reason bars : {Reason::brake_no_response, Reason::driver_write_failed, Reason::driver_read_failed,
                            Reason::board_too_hot, Reason::guardian_died, Reason::guardian_silent, Reason::cycle_gap,
                            Reason::computer_suspended, Reason::samples_missing, Reason::checks_cannot_judge}) {
    CHECK_FALSE(brake_may_hold_after(bars));
  }
  CHECK_FALSE(brake_may_hold_after(Reason::none));
  CHECK_FALSE(brake_may_hold_after(static_cast<Reason>(999)));
}

TEST_CASE("a brake command that is no number is not held after a fault; without a duty for it nothing is") {
  for (const rig::Command& bad : {rig::Command{.brake_duty = not_a_number}, rig::Command{.brake_duty = -1.0},
                                  rig::Command{.brake_duty = 0.5, .brake_torque_Nm = infinite}}) {
    CommandGate gate({.fault_brake_duty = 0.5});
    gate.latch(Reason::overspeed, 0.0);
    CHECK(is_safe(gate.check(bad, moderate).command));
  }
  CommandGate gate(GateOptions{});
  gate.latch(Reason::overspeed, 0.0);
  CHECK(is_safe(gate.check({.brake_duty = 0.5, .brake_torque_Nm = 2.0}, moderate).command));
}
