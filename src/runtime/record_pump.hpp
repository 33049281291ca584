#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

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

}  // namespace abs_hil::runtime
