#pragma once

#include "abs_hil/rig/cycle_record.hpp"

namespace abs_hil::rig {

/// Takes the records of a run, in order, outside the real-time thread: CSV, LCM, event log, metrics.
class RecordSink {
 public:
  RecordSink() = default;
  RecordSink(const RecordSink&) = delete;
  RecordSink& operator=(const RecordSink&) = delete;
  virtual ~RecordSink() = default;

  /// `distance_m` is the distance of the car since braking started (0 before).
  virtual void consume(const CycleRecord& record, double distance_m) = 0;
  /// Ends the records and writes buffered data. Throws std::runtime_error, naming the file, if data is lost.
  virtual void finish() {}
};

}  // namespace abs_hil::rig
