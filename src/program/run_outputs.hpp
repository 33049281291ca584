#pragma once

#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/friction_curve.hpp"
#include "analysis/run_metrics.hpp"
#include "analysis/run_summary.hpp"
#include "commands/command_listener.hpp"
#include "commands/remote_commands.hpp"
#include "experiment/run_session.hpp"
#include "files/result_file.hpp"
#include "program/command_line.hpp"
#include "rig/record_sink.hpp"
#include "run_folder/environment.hpp"
#include "run_folder/run_folder.hpp"
#include "runtime/cycle_statistics.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/events.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/log_outlet.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/status_line.hpp"

namespace abs_hil::program {

/// All destinations of a run's records, opened before anything moves: metrics, CSV, LCM, event log, summary, status
/// line, and a run folder with all of them.
class RunOutputs {
 public:
  /// Throws config::ConfigError for files and folders that cannot be written, and telemetry::LcmError without a
  /// network.
  RunOutputs(const RunRequest& request, rig::RunNames names);

  [[nodiscard]] std::vector<rig::RecordSink*> sinks();
  /// Attaches the session, whose state ABS_STATUS and the status line then show; it must outlive the use of the
  /// outputs. Remote commands are accepted from here on.
  void attach(experiment::RunSession& session);
  /// Handles remote commands from LCM.
  void poll();
  [[nodiscard]] bool stop_requested() const { return command_listener_ && command_listener_->stop_requested(); }
  [[nodiscard]] analysis::Metrics metrics() const { return metrics_.metrics(); }
  /// True if the car has braked but not stopped.
  [[nodiscard]] bool moves_on() const noexcept { return metrics_.moves_on(); }
  [[nodiscard]] std::uint64_t publish_failures() const { return stream_ ? stream_->failures() : 0; }
  [[nodiscard]] std::uint64_t csv_rows_lost() const;
  /// Writes summary and histogram if requested, and completes the run folder. Tries each, even after a failure. Returns
  /// what could not be written, as text.
  [[nodiscard]] std::vector<std::string> write(const analysis::RunSummary& summary,
                                               const runtime::CycleStatistics& statistics,
                                               const run_folder::RunEnvironment& environment);
  /// Result of the script's analysis; null without one.
  [[nodiscard]] nlohmann::ordered_json friction_curve_json() const;
  [[nodiscard]] const rig::RunNames& names() const noexcept { return names_; }
  /// The run folder, if there is one.
  [[nodiscard]] const std::optional<run_folder::RunFolder>& folder() const noexcept { return folder_; }

 private:
  [[nodiscard]] telemetry::StatusSnapshot snapshot() const;
  void open_folder(const RunRequest& request);
  void open_files(const OutputOptions& outputs);
  void open_stream(const RunRequest& request);

  rig::RunNames names_;
  experiment::RunSession* session_{nullptr};
  analysis::RunMetrics metrics_;
  std::optional<analysis::FrictionCurve> friction_curve_;
  std::optional<run_folder::RunFolder> folder_;
  // Each list holds up to two: one in the run folder and one for the named file.
  std::list<telemetry::CsvSink> csv_;
  std::list<files::ResultFile> summary_;
  std::list<files::ResultFile> histogram_;
  std::list<telemetry::LogOutlet> log_;
  std::optional<telemetry::EventCsv> events_;
  std::optional<telemetry::LcmOutlet> lcm_;
  std::optional<telemetry::MessageStream> stream_;
  std::optional<commands::RemoteCommands> remote_commands_;
  std::optional<telemetry::CommandListener> command_listener_;
  std::optional<telemetry::StatusLine> status_line_;
};

}  // namespace abs_hil::program
