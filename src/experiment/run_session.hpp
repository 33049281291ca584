#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "abs_hil/driver/rig_driver.hpp"
#include "experiment/run_logic.hpp"
#include "rig/record_sink.hpp"
#include "runtime/clock.hpp"
#include "runtime/command_gate.hpp"
#include "runtime/cyclic_executive.hpp"
#include "runtime/early_end.hpp"
#include "runtime/realtime_setup.hpp"
#include "runtime/record_pump.hpp"

namespace abs_hil::experiment {

/// The outcome of a run as the cyclic executive knows it; the metrics of braking come from the records.
struct RunOutcome {
  rig::Reason reason{rig::Reason::none};
  double reason_value{0.0};
  driver::IoResult io_error{};    ///< the driver's first error
  driver::IoResult safe_state{};  ///< result of writing the safe state at the end
  runtime::RealtimeReport realtime{};
  bool ran{false};  ///< false: real time was required but unavailable; nothing moved
  [[nodiscard]] bool completed() const noexcept { return reason == rig::Reason::sequence_complete; }
};

/// One run, from an unconfigured driver to the safe state. It owns the data of the real-time thread; the sinks work in
/// the calling (slow) thread. If code in this program ends it during the run, the outputs are made safe first
/// (runtime::EarlyEndWatch).
class RunSession final : private runtime::Outputs {
 public:
  /// @param sinks get every record, in this order, in the thread that calls `run_...`
  RunSession(runtime::Clock& clock, driver::RigDriver& driver, RunLogicParts parts,
             const runtime::GateOptions& gate_options, std::vector<rig::RecordSink*> sinks,
             const runtime::OverrunOptions& overruns = {});

  /// Called outside the real-time thread, every few milliseconds in real time and every second of virtual time. A
  /// reason other than `none` ends the run in order.
  using Poll = std::function<rig::Reason()>;

  /// Runs in the calling thread as fast as possible, with a virtual clock. Both run functions throw driver::Unavailable
  /// if the driver cannot start, and whatever a sink throws when it finishes; the rig is in the safe state in every
  /// case.
  /// @param own_thread  true: the calling thread ends afterwards (runtime::CycleInThisThread)
  RunOutcome run_fast(const Poll& poll, bool own_thread = false);
  /// Runs the cycle in its own thread with the real-time set-up of `options`.
  RunOutcome run_realtime(const runtime::RealtimeOptions& options, const Poll& poll);

  /// Ends the program if a controller in this process does not return or, in virtual time, is much too slow. Not for
  /// boards: their guardian ends such a run.
  void watch_for_slow_cycles() noexcept { watch_slow_cycles_ = true; }

  /// Lets a real-time run begin at the next whole second of the clock plus `offset_ns`, >= 0: its ticks then coincide
  /// with those of `cyclictest --secaligned`.
  void align_to_second(std::int64_t offset_ns) noexcept { second_offset_ns_ = offset_ns; }

  /// For real-time runs: `guard` stands by from before the driver's activation until its outputs are released. Both
  /// must outlive the run.
  void guard_with(runtime::RunGuard& guard) noexcept { guard_ = &guard; }
  void set_watch(runtime::CycleWatch& watch) noexcept { executive_.set_watch(watch); }
  /// Ends the run in an orderly way at its next cycle. Any thread or signal handler may call it.
  void request_stop(rig::Reason reason) noexcept { executive_.request_stop(reason); }

  /// For one slow thread during the run.
  [[nodiscard]] AdjustmentMailbox& adjustments() noexcept { return logic_.adjustments(); }
  [[nodiscard]] const runtime::CyclicExecutive& executive() const noexcept { return executive_; }
  [[nodiscard]] const runtime::CommandGate& gate() const noexcept { return gate_; }
  [[nodiscard]] std::uint64_t record_drops() const noexcept { return ring_.drops(); }
  /// True once the run's thread has obtained real-time scheduling.
  [[nodiscard]] bool realtime() const noexcept { return realtime_.realtime(); }
  /// What the real-time set-up obtained. The slow thread may read it from its first poll on.
  [[nodiscard]] const runtime::RealtimeReport& realtime_report() const noexcept { return realtime_; }
  /// The outcome. Call it after the run: the real-time thread writes the same data.
  [[nodiscard]] RunOutcome outcome() const;
  [[nodiscard]] const rig::CycleRecord& latest() const noexcept { return pump_.latest(); }

 private:
  bool make_safe_now() noexcept override;
  bool have_made_safe() noexcept override;
  [[nodiscard]] bool step() noexcept;

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
  bool watch_slow_cycles_{false};
  std::optional<runtime::SlowCycleWatch> slow_cycles_{};
  std::atomic<bool> made_safe_{false};  ///< `safe_state_` is that of the run's end
  driver::IoResult safe_state_{};
  bool ran_{false};
};

}  // namespace abs_hil::experiment
