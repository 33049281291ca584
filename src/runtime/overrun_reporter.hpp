#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "abs_hil/rig/overrun_cause.hpp"
#include "rig/record_sink.hpp"

namespace abs_hil::runtime {

/// Puts late cycles into words, outside the real-time thread: at most one message a second, however many there are,
/// while the counters of CycleStatistics go on unthrottled.
class OverrunReporter final : public rig::RecordSink {
 public:
  /// @param period_ns of the cycle, > 0
  explicit OverrunReporter(std::int64_t period_ns) : period_ns_(period_ns) {}

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// What there is to say now, if anything: total by cause, and the latest late cycle part by part.
  /// @param counts as of now
  [[nodiscard]] std::optional<std::string> message(const rig::OverrunCounts& counts);

 private:
  struct LateCycle {
    rig::CycleTiming timing{};  ///< its own
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
