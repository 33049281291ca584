#pragma once

#include <string>
#include <vector>

namespace abs_hil::runtime {

/// What `--rt` asks for.
enum class RealtimeMode { require, prefer, off };

struct RealtimeOptions {
  RealtimeMode mode{RealtimeMode::prefer};
  int priority{80};  ///< SCHED_FIFO, 1 ... 98: 99 belongs to the kernel's own threads
};

/// One step of the set-up, as it was observed and not as it was asked for.
struct RealtimeStep {
  std::string what;  ///< "SCHED_FIFO priority 80", say
  bool obtained{false};
  std::string detail;  ///< why not
  std::string fix;     ///< the command that mends it
};

/// Result of setting up this process and the calling thread for real time.
struct RealtimeReport {
  std::vector<RealtimeStep> steps;
  /// True only if every step was obtained.
  [[nodiscard]] bool realtime() const noexcept;
  /// The failed steps with their fixes, one line each; empty if there are none.
  [[nodiscard]] std::string failures() const;
};

/// Locks the process's memory and gives the calling thread SCHED_FIFO, reading each back. To be called by the thread
/// that will run the cycle, before its first one. Never throws because of missing permissions: the report tells.
[[nodiscard]] RealtimeReport set_up_realtime(const RealtimeOptions& options);

}  // namespace abs_hil::runtime
