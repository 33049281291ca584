#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "files/result_file.hpp"
#include "rig/record_sink.hpp"
#include "telemetry/event_detector.hpp"

namespace abs_hil::telemetry {

/// First line of events.csv. Names and order are a contract; columns may be added at the end.
inline constexpr std::string_view event_csv_header = "time_s,event,phase,reason,value,phase_name";

/// The events of a run as on ABS_EVENT, in a CSV file: phase changes, faults, limits. `phase` is the phase entered or
/// in force, `reason` the text of rig::description, `value` the value that caused the event, in SI units,
/// `phase_name` the experiment's own name of the phase.
class EventCsv : public rig::RecordSink {
 public:
  /// Throws files::FileError when the file cannot be opened.
  explicit EventCsv(std::filesystem::path path, rig::RunNames names = {});

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// Writes the file. Throws files::FileError when it cannot be written.
  void finish() override { file_.write(text_); }

 private:
  files::ResultFile file_;
  std::string text_;
  rig::RunNames names_;
  EventDetector detector_{names_};
};

}  // namespace abs_hil::telemetry
