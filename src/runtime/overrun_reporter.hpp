#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "abs_hil/rig/overrun_cause.hpp"
#include "rig/record_sink.hpp"

namespace abs_hil::runtime {

/// Writes messages about late cycles, outside the real-time thread. It gives at most one message per second, for any
/// number of late cycles; the counters of CycleStatistics are not limited.
class OverrunReporter final : public rig::RecordSink {
 public:
  /// @param period_ns period of the cycle, > 0
  explicit OverrunReporter(std::int64_t period_ns) : period_ns_(period_ns) {}

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// The message due now, if any: totals by cause, and the parts of the latest late cycle.
  /// @param counts current counts
  [[nodiscard]] std::optional<std::string> message(const rig::OverrunCounts& counts);

 private:
  struct LateCycle {
    rig::CycleTiming timing{};  ///< of the late cycle itself
    std::int64_t record_ns{0};
    std::uint32_t ticks_missed{0};
    rig::OverrunCause cause{rig::OverrunCause::none};
    double time_s{0.0};
  };

  std::int64_t period_ns_;
  rig::CycleRecord latest_{};
  std::optional<LateCycle> late_{};
  std::uint64_t told_{0};
  std::optional<std::int64_t> next_message_ns_{};
};

}  // namespace abs_hil::runtime
