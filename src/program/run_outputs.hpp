#pragma once

#include <list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "analysis/friction_curve.hpp"
#include "analysis/run_metrics.hpp"
#include "analysis/run_summary.hpp"
#include "commands/command_desk.hpp"
#include "commands/command_listener.hpp"
#include "experiment/run_session.hpp"
#include "program/command_line.hpp"
#include "rig/record_sink.hpp"
#include "run_folder/environment.hpp"
#include "run_folder/run_folder.hpp"
#include "runtime/histogram_file.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_csv.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "telemetry/log_outlet.hpp"
#include "telemetry/message_stream.hpp"
#include "telemetry/status_line.hpp"

namespace abs_hil::program {

/// Everything a run's records go to, opened before anything moves: metrics, CSV, LCM, event log, summary, status line,
/// a folder with all of them.
class RunOutputs {
 public:
  /// Throws telemetry::FileError or std::runtime_error as config::ConfigError for files and folders that cannot be
  /// written, and telemetry::LcmError without a network.
  explicit RunOutputs(const RunRequest& request);

  [[nodiscard]] std::vector<rig::RecordSink*> sinks();
  /// Lets ABS_STATUS and the status line look at the run, which must outlive the outputs' use.
  /// From here on commands are taken as well.
  void watch(experiment::RunSession& session);
  /// Takes in commands from LCM.
  void poll();
  [[nodiscard]] bool stop_requested() const { return commands_ && commands_->stop_requested(); }
  [[nodiscard]] analysis::Metrics metrics() const { return metrics_.metrics(); }
  [[nodiscard]] std::uint64_t publish_failures() const { return stream_ ? stream_->failures() : 0; }
  [[nodiscard]] std::uint64_t csv_rows_lost() const;
  /// Writes summary and histogram where they were asked for, and completes the run folder: each is tried whatever
  /// became of the others. Returns what could not be written, in words.
  [[nodiscard]] std::vector<std::string> write(const analysis::RunSummary& summary,
                                               const runtime::CycleStatistics& statistics,
                                               const run_folder::RunEnvironment& environment);
  /// What the script's analysis found; null without one.
  [[nodiscard]] nlohmann::ordered_json friction_curve_json() const;
  /// The run folder, if there is one.
  [[nodiscard]] const std::optional<run_folder::RunFolder>& folder() const noexcept { return folder_; }

 private:
  [[nodiscard]] telemetry::StatusSnapshot snapshot() const;
  void open_folder(const RunRequest& request);
  void open_files(const OutputOptions& outputs);
  void open_stream(const RunRequest& request);

  experiment::RunSession* session_{nullptr};
  analysis::RunMetrics metrics_;
  std::optional<analysis::FrictionCurve> friction_curve_;
  std::optional<run_folder::RunFolder> folder_;
  // Of each as many as there are places: the run folder and the file named.
  std::list<telemetry::CsvSink> csv_;
  std::list<analysis::SummaryFile> summary_;
  std::list<runtime::HistogramFile> histogram_;
  std::list<telemetry::LogOutlet> log_;
  std::optional<telemetry::EventCsv> events_;
  std::optional<telemetry::LcmOutlet> lcm_;
  std::optional<telemetry::MessageStream> stream_;
  std::optional<commands::CommandDesk> steering_;
  std::optional<telemetry::CommandListener> commands_;
  std::optional<telemetry::StatusLine> status_line_;
};

}  // namespace abs_hil::program
