#pragma once

#include <cstddef>
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
#include "telemetry/record_file.hpp"

namespace abs_hil::telemetry {

/// The CSV's first line, without the line end, made from rig/quantities.hpp. Names and order are a contract; columns
/// may be added at the end. In a file `phase_name` and the columns of the controller's own signals follow it.
extern const std::string csv_header;

/// Upper limit of a row's length.
inline constexpr std::size_t csv_row_max_bytes = 1024;

/// The column after the fixed ones, a text: the experiment's own name of the phase. Only a run with such names has it,
/// so that a reader of numbers alone can read all others.
inline constexpr std::string_view phase_name_column = "phase_name";

/// Writes a row with its line end to `out` and returns its length: the fixed columns, `phase_name` if the experiment
/// has names of its own, and the controller's own signals. A double has the shortest text that reads back bit-exactly;
/// NaN is `NaN`. The text does not depend on the locale.
std::size_t format_csv_row(const rig::CycleRecord& record, double distance_m, char (&out)[csv_row_max_bytes],
                           const rig::RunNames& names = {}) noexcept;

/// A number as in these rows.
[[nodiscard]] std::string csv_number(double value);

/// Writes one row per cycle to a file (RecordFile).
class CsvSink : public rig::RecordSink {
 public:
  /// Throws files::FileError when the file cannot be opened.
  /// @param write_period_ns  longest time, by the records' stamps, until a row is written, so that a killed program
  ///                         loses no older rows; the first of these writes replaces an older file. 0: rows are written
  ///                         when a block is full, and the file appears when it is whole
  explicit CsvSink(std::filesystem::path path, std::int64_t write_period_ns = 0, rig::RunNames names = {});

  void consume(const rig::CycleRecord& record, double distance_m) override;
  void finish() override { file_.finish(); }
  [[nodiscard]] std::uint64_t rows_lost() const noexcept { return file_.lost(); }

 private:
  RecordFile file_;
  std::int64_t write_period_ns_;
  rig::RunNames names_;
  std::int64_t last_write_ns_{0};  ///< stamp of the record of the last write
};

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
