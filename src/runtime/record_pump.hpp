#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/rig/overrun_cause.hpp"
#include "rig/braking_distance.hpp"
#include "rig/record_sink.hpp"
#include "runtime/cyclic_executive.hpp"

namespace abs_hil::runtime {

/// Moves records from the ring to the sinks, in order, outside the real-time thread. It adds the distance that the car
/// has covered since braking started (trapezoidal rule on v_x).
class RecordPump {
 public:
  /// @param r2_m lower wheel's radius, m
  RecordPump(RecordRing& ring, double r2_m, std::vector<rig::RecordSink*> sinks);
  /// One more sink, behind the others. Before the first record.
  void add(rig::RecordSink& sink) { sinks_.push_back(&sink); }

  /// Moves the records in the ring, at most `at_most`. Returns their number.
  std::size_t drain(std::size_t at_most = std::numeric_limits<std::size_t>::max());
  /// Drains the ring and finishes every sink, even if one throws; then rethrows the first exception.
  void finish();

  /// The last record moved, for a status line.
  [[nodiscard]] const rig::CycleRecord& latest() const noexcept { return latest_; }

 private:
  RecordRing& ring_;
  double r2_m_;
  std::vector<rig::RecordSink*> sinks_;
  rig::CycleRecord latest_{};
  rig::BrakingDistance<double> distance_{};
};

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
  std::int64_t period_ns_;
  rig::CycleRecord latest_{};
  std::optional<rig::CycleRecord> late_{};  ///< the latest late cycle, with what the next record told of it
  std::uint64_t told_{0};
  std::optional<std::int64_t> next_message_ns_{};
};

}  // namespace abs_hil::runtime
