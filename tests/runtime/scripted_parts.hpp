#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "runtime/clock.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cyclic_executive.hpp"

namespace abs_hil::runtime::test {

inline constexpr std::int64_t us = 1'000;
inline constexpr std::int64_t ms = 1'000'000;

/// How long each part of one cycle takes.
struct CycleScript {
  std::int64_t wakeup_ns{0};
  std::int64_t read_ns{0};
  std::int64_t control_ns{0};
  std::int64_t write_ns{0};
};

/// Scripted time: late wake-ups, and given durations of the parts of a cycle.
class ScriptedClock final : public Clock {
 public:
  [[nodiscard]] std::int64_t now_ns() noexcept override { return time_ns_; }
  void sleep_until(std::int64_t time_ns) noexcept override {
    asked_ns.push_back(time_ns);
    time_ns_ = std::max(time_ns_, time_ns) + wakeup_ns;
  }
  void pass(std::int64_t duration_ns) noexcept { time_ns_ += duration_ns; }
  [[nodiscard]] std::int64_t suspended_ns() noexcept override {
    if (held_up_ns.empty()) return suspension_ns;
    const std::int64_t missing_ns = held_up_ns.back();
    held_up_ns.pop_back();
    return suspension_ns - missing_ns;
  }

  std::int64_t wakeup_ns{0};
  std::int64_t suspension_ns{77 * ms};   ///< its origin is arbitrary
  std::vector<std::int64_t> held_up_ns;  ///< the next readings of the suspended time are too small by these, last first
  std::vector<std::int64_t> asked_ns;    ///< every wake-up time asked for

 private:
  std::int64_t time_ns_{1'000 * ms};
};

/// A driver with scripted answers and durations.
class ScriptedDriver final : public driver::RigDriver {
 public:
  explicit ScriptedDriver(ScriptedClock& clock) : clock_(clock) {
    configure();
    activate(0);
  }
  ~ScriptedDriver() override { static_cast<void>(deactivate()); }
  [[nodiscard]] std::string_view name() const noexcept override { return "scripted"; }
  void note_wheels_apart(bool now_apart) noexcept override { apart.push_back(now_apart); }
  void note_phase(rig::Phase phase) noexcept override { phases.push_back(phase); }
  [[nodiscard]] rig::PlantTruth truth() const noexcept override { return {.slip = 0.25}; }
  [[nodiscard]] bool took_other_command(rig::Command& command) const noexcept override {
    if (took) command = *took;
    return took.has_value();
  }
  std::int64_t stamp_lag_ns{0};  ///< the counters are read so long before the reading begins

  CycleScript script{};
  driver::IoResult read_result{};
  driver::IoResult write_result{};
  std::uint32_t trip_flags{0};
  std::array<std::int32_t, 2> counts_per_cycle{};  ///< upper, lower
  std::array<std::int32_t, 2> counts{};
  std::optional<rig::Command> sends;  ///< what it makes of every command; empty: the command
  std::optional<rig::Command> took;   ///< what the board took instead of the command before; empty: that one
  std::vector<rig::Command> written;
  std::vector<rig::Phase> phases;
  std::vector<bool> apart;  ///< what it was told about the wheels, in order
  int made_safe{0};

 private:
  void do_configure() override {}
  void do_activate(std::int64_t) override {}
  driver::IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override {
    clock_.pass(script.read_ns);
    measurement.time_ns = now_ns - stamp_lag_ns;
    measurement.trip_flags = trip_flags;
    for (std::size_t i = 0; i < 2; ++i) counts[i] += counts_per_cycle[i];
    measurement.upper_counts = counts[0];
    measurement.lower_counts = counts[1];
    return read_result;
  }
  driver::IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override {
    sent = as_sent(command);
    if (sends) sent = *sends;
    clock_.pass(script.write_ns);
    written.push_back(command);
    return write_result;
  }
  driver::IoResult do_make_safe() noexcept override {
    ++made_safe;
    return {};
  }

  ScriptedClock& clock_;
};

/// Wants the same command in every cycle. Ends as the sequence does: with one last cycle of the safe command.
class ScriptedLogic final : public CycleLogic {
 public:
  explicit ScriptedLogic(ScriptedClock& clock) : clock_(clock) {}

  void wheels_judged(bool sound) noexcept override { wheels_sound = sound; }
  [[nodiscard]] rig::Command step(const rig::Measurement&, RunLatch& latch,
                                  rig::CycleRecord& record) noexcept override {
    clock_.pass(script.control_ns);
    if (ended_by == rig::Reason::none) {
      const bool fault = latch.fault() != rig::Reason::none;
      ended_by = fault ? latch.fault() : latch.stop_request();
      ended_value = fault ? latch.fault_value() : 0.0;
    }
    finished_ = ended_by != rig::Reason::none;
    record.phase = finished_ ? rig::Phase::fault : rig::Phase::brake;
    record.reason = ended_by;
    record.wheels_apart = wheels_apart;
    return finished_ ? rig::safe_command : wanted;
  }
  void commanded(const rig::Command& command) noexcept override { told.push_back(last = command); }
  [[nodiscard]] bool finished() const noexcept override { return finished_; }

  CycleScript script{};
  rig::Command wanted{.brake_duty = 0.5};
  rig::Command last{};
  std::vector<rig::Command> told;  ///< every command that acted, as the cycle told it
  bool wheels_sound{false};
  bool wheels_apart{false};
  rig::Reason ended_by{rig::Reason::none};
  double ended_value{0.0};

 private:
  ScriptedClock& clock_;
  bool finished_{false};
};

/// An executive on scripted parts, at 1 kHz.
struct Bench {
  explicit Bench(const OverrunOptions& overruns = {.startup_cycles = 0, .max_consecutive = 0},
                 std::size_t ring_capacity = 1024)
      : ring(ring_capacity), executive(clock, driver, logic, gate, ring, ms, overruns) {}

  bool cycle(const CycleScript& script = {}) {
    clock.wakeup_ns = script.wakeup_ns;
    driver.script = script;
    logic.script = script;
    return executive.step();
  }
  rig::CycleRecord record() {
    rig::CycleRecord record;
    ring.pop(record);
    return record;
  }

  ScriptedClock clock{};
  ScriptedDriver driver{clock};
  ScriptedLogic logic{clock};
  CommandGate gate{GateOptions{}};
  RecordRing ring;
  CyclicExecutive executive;
};

}  // namespace abs_hil::runtime::test
