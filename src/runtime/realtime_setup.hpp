#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "abs_hil/rig/option.hpp"
#include "runtime/cyclic_executive.hpp"

namespace abs_hil::runtime {

/// What `--rt` asks for.
enum class RealtimeMode { require, prefer, off };

/// Everything below `realtime.` in the configuration.
struct RealtimeOptions {
  ABS_HIL_OPTIONS(RealtimeOptions);
  RealtimeMode mode{RealtimeMode::prefer};
  /// 99 belongs to the kernel's own threads.
  ABS_HIL_OPTION(std::int32_t, priority, 80, .meaning = "SCHED_FIFO priority", .range = rig::between(1, 98));
  ABS_HIL_OPTION(std::int32_t, cpu, -1, .meaning = "CPU that the cycle is bound to; -1: any",
                 .range = rig::between(-1, 1023));
  ABS_HIL_GROUP(OverrunOptions, overruns, "", {});
};

/// One step of the set-up, as it was observed and not as it was asked for.
struct RealtimeStep {
  std::string what;  ///< "SCHED_FIFO priority 80", say
  bool obtained{false};
  /// Whether real time depends on it. What is merely helpful (C-states, timer slack) is reported, not required.
  bool required{true};
  std::string detail{};  ///< what was observed
  std::string fix{};     ///< the commands that mend it, one a line; empty if obtained
};

/// Result of setting up this process and the calling thread for real time.
struct RealtimeReport {
  std::vector<RealtimeStep> steps;
  /// True only if every required step was obtained.
  [[nodiscard]] bool realtime() const noexcept;
  /// The steps that were not obtained and, once each, their fixes; empty if there are none.
  [[nodiscard]] std::string shortcomings() const;
};

/// Blocks all signals for the calling thread, so that another one runs their handlers.
void keep_signals_away() noexcept;

/// Real time for the thread that makes it, which is the one that will run the cycle; before its first one. Locks and
/// prefaults memory (process), binds to a CPU, sets timer slack, SCHED_FIFO (thread) and keeps the CPUs out of deep
/// C-states for as long as it lives; each step is read back. Never throws because of missing permissions: the report
/// tells. Scheduling and locked memory stay when it is gone.
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
