#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "experiment/run_logic.hpp"
#include "rig/record_sink.hpp"
#include "runtime/clock.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/realtime_setup.hpp"
#include "runtime/record_pump.hpp"

namespace abs_hil::experiment {

/// How a run went, as far as the executive can tell; the metrics of braking come from the records.
struct RunOutcome {
  rig::Reason reason{rig::Reason::none};
  double reason_value{0.0};
  driver::IoResult io_error{};    ///< the driver's first error
  driver::IoResult safe_state{};  ///< did the safe state reach the board at the end?
  runtime::RealtimeReport realtime{};
  bool ran{false};  ///< false: real time was required and not to be had; nothing moved
  [[nodiscard]] bool completed() const noexcept { return reason == rig::Reason::sequence_complete; }
};

/// One run, from an unconfigured driver to the safe state. Owns what the real-time thread works on and keeps the slow
/// side, the sinks, in the calling thread.
class RunSession {
 public:
  /// @param sinks get every record, in this order, in the thread that calls `run_...`
  RunSession(runtime::Clock& clock, driver::RigDriver& driver, RunLogicParts parts,
             const runtime::GateOptions& gate_options, std::vector<rig::RecordSink*> sinks,
             const runtime::OverrunOptions& overruns = {});

  /// Asked every few milliseconds of a run in real time, every second of one in virtual time, outside the real-time
  /// thread: a reason other than `none` ends the run in an orderly way.
  using Poll = std::function<rig::Reason()>;

  /// Runs in the calling thread as fast as it can: for a virtual clock.
  /// Both throw driver::Unavailable if the driver cannot start, and what a sink throws when it finishes; the rig is in
  /// the safe state whichever way they end.
  RunOutcome run_fast(const Poll& poll);
  /// Runs the cycle in a thread of its own with the real-time set-up of `options`.
  RunOutcome run_realtime(const runtime::RealtimeOptions& options, const Poll& poll);

  /// Lets a run in real time begin at the next whole second of the clock plus `offset_ns`, >= 0, so that its ticks lie
  /// where those of `cyclictest --secaligned` do.
  void align_to_second(std::int64_t offset_ns) noexcept { second_offset_ns_ = offset_ns; }

  /// For runs in real time: `guard` stands by from between configuration and activation of the driver until its outputs
  /// are released. Both must outlive the run.
  void guard_with(runtime::RunGuard& guard) noexcept { guard_ = &guard; }
  void set_heartbeat(runtime::Heartbeat& heartbeat) noexcept { executive_.set_heartbeat(heartbeat); }
  /// Ends the run in an orderly way at its next cycle. Any thread or signal handler may call it.
  void request_stop(rig::Reason reason) noexcept { executive_.request_stop(reason); }

  /// For one slow thread, while it runs.
  [[nodiscard]] AdjustmentMailbox& adjustments() noexcept { return logic_.adjustments(); }
  [[nodiscard]] const runtime::CyclicExecutive& executive() const noexcept { return executive_; }
  [[nodiscard]] const runtime::CommandGate& gate() const noexcept { return gate_; }
  [[nodiscard]] std::uint64_t record_drops() const noexcept { return ring_.drops(); }
  /// True once the run's thread has obtained real time.
  [[nodiscard]] bool realtime() const noexcept { return realtime_.realtime(); }
  /// What it obtained. For the slow thread, from its first poll on.
  [[nodiscard]] const runtime::RealtimeReport& realtime_report() const noexcept { return realtime_; }
  /// How the run went. After it: the cycle's own thread writes what this reads.
  [[nodiscard]] RunOutcome outcome() const;
  [[nodiscard]] const rig::CycleRecord& latest() const noexcept { return pump_.latest(); }

 private:
  runtime::Clock& clock_;
  driver::RigDriver& driver_;
  RunLogic logic_;
  runtime::CommandGate gate_;
  runtime::RecordRing ring_;
  std::int64_t second_offset_ns_{-1};  ///< < 0: begin at once
  runtime::CyclicExecutive executive_;
  runtime::RecordPump pump_;
  runtime::RealtimeReport realtime_{};
  runtime::RunGuard* guard_{nullptr};
  driver::IoResult safe_state_{};
  bool ran_{false};
};

}  // namespace abs_hil::experiment
