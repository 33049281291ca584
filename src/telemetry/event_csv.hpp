#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "rig/record_sink.hpp"
#include "telemetry/event_detector.hpp"

namespace abs_hil::telemetry {

/// First line of events.csv. Names and order are a contract; columns may be added at the end.
inline constexpr std::string_view event_csv_header = "time_s,event,phase,reason,value";

/// The events of a run as on ABS_EVENT, in a CSV file: phase changes, faults, limits. `phase` is the phase entered or
/// in force, `reason` the text of rig::description, `value` the value that caused the event, in SI units.
class EventCsv : public rig::RecordSink {
 public:
  /// Creates or empties the file. Throws FileError when it cannot be opened.
  /// @param own_signals  names of the controller's own signals
  explicit EventCsv(std::filesystem::path path, std::vector<std::string> own_signals = {});

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// Writes the file. Throws FileError when it cannot be written.
  void finish() override;

 private:
  std::filesystem::path path_;
  std::string text_;
  EventDetector detector_;
};

}  // namespace abs_hil::telemetry
