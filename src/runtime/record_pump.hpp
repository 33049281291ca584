#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "rig/record_sink.hpp"
#include "runtime/cyclic_executive.hpp"

namespace abs_hil::runtime {

/// Takes the records out of the ring, outside the real-time thread, and hands them to the sinks in order; adds the
/// car's way since braking started (trapezoid of v_x over ticks).
class RecordPump {
 public:
  /// @param r2_m lower wheel's radius
  RecordPump(RecordRing& ring, double r2_m, std::vector<rig::RecordSink*> sinks);

  /// Hands on what is there, at most so many records. Returns their number.
  std::size_t drain(std::size_t at_most = std::numeric_limits<std::size_t>::max());
  /// Drains and finishes every sink, also when one of them throws; the first exception is thrown on.
  void finish();

  /// The last record handed on, for a status line.
  [[nodiscard]] const rig::CycleRecord& latest() const noexcept { return latest_; }

 private:
  void add_distance(const rig::CycleRecord& record) noexcept;

  RecordRing& ring_;
  double r2_m_;
  std::vector<rig::RecordSink*> sinks_;
  rig::CycleRecord latest_{};
  bool braking_{false};
  double distance_m_{0.0};
};

}  // namespace abs_hil::runtime
