#pragma once

// The events of a run: found in the stream of records, and written as events.csv.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "abs_hil/rig/cycle_record.hpp"
#include "files/result_file.hpp"
#include "rig/record_sink.hpp"
#include "rig/run_names.hpp"

namespace abs_hil::telemetry {

/// Values of event_t.kind.
namespace event_kind {
inline constexpr std::string_view phase = "phase";
inline constexpr std::string_view fault = "fault";
inline constexpr std::string_view limit = "limit";
inline constexpr std::string_view command = "command";
}  // namespace event_kind

/// An event that a record caused.
struct DetectedEvent {
  std::string_view kind;
  std::string message;  ///< for people, one line
  std::string reason;   ///< the record's reason in words
};

/// Finds events in the stream of records, so that the real-time thread handles numbers only. Each change of phase and
/// each new reason gives one event, even if records repeat it or are missing.
class EventDetector {
 public:
  explicit EventDetector(rig::RunNames names = {}) : names_(std::move(names)) {}

  /// Takes every record, in order. The first always gives an event.
  [[nodiscard]] std::optional<DetectedEvent> observe(const rig::CycleRecord& record);

 private:
  struct Seen {
    std::uint64_t sequence;
    rig::Phase phase;
    std::uint16_t phase_index;
    rig::Reason reason;
  };
  rig::RunNames names_;
  std::optional<Seen> last_;
  std::string phase_name_;  ///< of the latest record
};

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
