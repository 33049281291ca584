#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "abs_hil/rig/option.hpp"
#include "runtime/cyclic_executive.hpp"

namespace abs_hil::runtime {

/// Of the calling thread and its process. Not real-time safe: it reads a file.
[[nodiscard]] Scheduling scheduling_of_this_thread();

/// Values of `--rt`.
enum class RealtimeMode { require, prefer, off };

/// Everything below `realtime.` in the configuration.
struct RealtimeOptions {
  ABS_HIL_OPTIONS(RealtimeOptions);
  RealtimeMode mode{RealtimeMode::prefer};
  /// 99 belongs to the kernel's own threads.
  ABS_HIL_OPTION(std::int32_t, priority, 80, .meaning = "SCHED_FIFO priority", .range = rig::between(1, 98),
                 .safety = rig::no_effect_on_safety);
  ABS_HIL_OPTION(std::int32_t, cpu, -1, .meaning = "CPU that the cycle is bound to; -1: any",
                 .range = rig::between(-1, 1023), .safety = rig::no_effect_on_safety);
  ABS_HIL_GROUP(OverrunOptions, overruns, "", {});
};

/// One step of the set-up, as observed afterwards (not as requested).
struct RealtimeStep {
  std::string what;  ///< for example "SCHED_FIFO priority 80"
  bool obtained{false};
  /// True if real time depends on this step. C-states and timer slack are only helpful: they are reported, not
  /// required.
  bool required{true};
  std::string detail{};  ///< what was observed
  std::string fix{};     ///< the commands that fix it, one per line; empty if obtained
};

/// Result of setting up this process and the calling thread for real time.
struct RealtimeReport {
  std::vector<RealtimeStep> steps;
  Scheduling scheduling{};  ///< what the thread has in the end, asked for or not
  /// True only if every required step was obtained.
  [[nodiscard]] bool realtime() const noexcept;
  /// The steps that were not obtained, then their fixes, each once. Empty if every step was obtained.
  [[nodiscard]] std::string shortcomings() const;
};

/// Blocks all signals for the calling thread, so that another thread runs their handlers.
void keep_signals_away() noexcept;

/// Sets up real time for the thread that constructs it. Construct it in the cycle's thread, before the first cycle. It
/// locks and prefaults the process' memory. It binds the thread to a CPU and sets its timer slack and SCHED_FIFO. It
/// keeps the CPUs out of deep C-states for its lifetime. Each step is read back. It does not throw if permissions are
/// missing; see the report. Scheduling and locked memory remain after its destruction.
class RealtimeScope {
 public:
  explicit RealtimeScope(const RealtimeOptions& options);
  RealtimeScope(const RealtimeScope&) = delete;
  RealtimeScope& operator=(const RealtimeScope&) = delete;
  ~RealtimeScope();

  [[nodiscard]] const RealtimeReport& report() const noexcept { return report_; }

 private:
  void hold_cpu_latency();

  RealtimeReport report_{};
  int cpu_latency_file_{-1};
};

}  // namespace abs_hil::runtime
