// The brake after a fault.

#include <limits>
#include <tuple>

#include "catch.hpp"
#include "gate_inputs.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/run_latch.hpp"

using namespace abs_hil;
using namespace abs_hil::runtime;
using namespace abs_hil::runtime::test_bench;
using rig::Phase;
using rig::Reason;

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
  CHECK(gate.fault() == Reason::encoder_upper_stuck);
  CHECK(gate.check({.brake_duty = 0.2}, {.now_ns = 15 * ms}).command.brake_duty == 0.2);
  CHECK(is_safe(gate.check({.brake_duty = 0.2}, {.now_ns = 15 * ms + 1}).command));
  CHECK(gate.count(GateAction::passed) == 0);
  CHECK(gate.count(GateAction::refused) == 3);
}

TEST_CASE("the brake's time after a fault counts from the first command, also at time 0") {
  CommandGate gate({.fault_brake_duty = 0.5, .fault_brake_limit_s = 0.01});
  gate.latch(Reason::overspeed, 0.0);
  for (const std::int64_t now_ns : {0 * ms, 5 * ms, 10 * ms}) {
    CHECK(gate.check({.brake_duty = 0.5}, {.phase = Phase::fault, .now_ns = now_ns}).command.brake_duty == 0.5);
  }
  CHECK(is_safe(gate.check({.brake_duty = 0.5}, {.phase = Phase::fault, .now_ns = 10 * ms + 1}).command));
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
  for (const Reason bars :
       {Reason::brake_no_response, Reason::driver_write_failed, Reason::driver_read_failed, Reason::board_too_hot,
        Reason::guardian_died, Reason::guardian_silent, Reason::cycle_gap, Reason::computer_suspended,
        Reason::samples_missing, Reason::checks_cannot_judge, Reason::released_wheel_stands}) {
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
