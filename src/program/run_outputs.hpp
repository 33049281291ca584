#pragma once

#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/run_summary.hpp"
#include "files/result_file.hpp"
#include "program/extra.hpp"
#include "run/run.hpp"
#include "run_folder/run_folder.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/status_line.hpp"

namespace abs_hil::program {

/// All destinations of a run's records, opened before anything moves: CSV, LCM, event log, summary, status line, and a
/// run folder with all of them.
class RunOutputs {
 public:
  /// The outputs of the run, which must outlive them: the run hands them its records, ABS_STATUS and the status line
  /// show its state, and the extras' parts act on it from here on. Throws config::ConfigError for files and folders
  /// that cannot be written, and telemetry::LcmError without a network.
  RunOutputs(const RunRequest& request, run::Run& run, std::vector<std::unique_ptr<RunPart>> parts);

  /// Lets the extras' parts work.
  void poll();
  [[nodiscard]] bool stop_requested() const;
  /// What an extra knows of the run's controller; null: it brought none.
  [[nodiscard]] nlohmann::ordered_json controller_facts() const;
  [[nodiscard]] std::uint64_t publish_failures() const { return stream_ ? stream_->failures() : 0; }
  [[nodiscard]] std::uint64_t csv_rows_lost() const;
  /// Writes summary and histogram if requested, and completes the run folder. Tries each, even after a failure. Returns
  /// what could not be written, as text. A folder that lacks something gets no seal.
  /// @param complete  nothing of the recorded data was lost
  [[nodiscard]] std::vector<std::string> write(const analysis::RunSummary& summary,
                                               const run_folder::RunEnvironment& environment, bool complete);
  /// The run folder, if there is one.
  [[nodiscard]] const std::optional<run_folder::RunFolder>& folder() const noexcept { return folder_; }

 private:
  [[nodiscard]] std::vector<rig::RecordSink*> sinks();
  [[nodiscard]] telemetry::StatusSnapshot snapshot() const;
  void open_folder(const RunRequest& request);
  void open_files(const OutputOptions& outputs, bool virtual_time);
  void open_stream(const RunRequest& request);

  run::Run& run_;
  std::optional<run_folder::RunFolder> folder_;
  // Each list holds up to two: one in the run folder and one for the named file.
  std::list<telemetry::CsvSink> csv_;
  std::list<files::ResultFile> summary_;
  std::list<files::ResultFile> histogram_;
  std::optional<files::ResultFile> prior_;
  std::list<telemetry::LogOutlet> log_;
  std::optional<telemetry::EventCsv> events_;
  std::optional<telemetry::LcmOutlet> lcm_;
  std::optional<telemetry::MessageStream> stream_;
  std::vector<std::unique_ptr<RunPart>> parts_;  // they use network and messages to their end
  std::optional<telemetry::StatusLine> status_line_;
};

}  // namespace abs_hil::program
