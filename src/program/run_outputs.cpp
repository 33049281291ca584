// Opens a run's CSV, logs, summary and folder before it begins, and completes them at its end.
#include "program/run_outputs.hpp"

#include <fmt/chrono.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>

#include "config/config_error.hpp"
#include "config/merge.hpp"
#include "program/run_monitor.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil::program {

namespace {
/// Event times of runs in virtual time start here (1 January 2000), so that equal runs give equal logs.
constexpr std::int64_t virtual_epoch_us = 946'684'800'000'000;
/// Half of the 100 ms of data that a killed program may lose; the other half allows for a late slow thread.
constexpr std::int64_t write_period_ns = 50'000'000;
}  // namespace

RunOutputs::RunOutputs(const RunRequest& request, run::Run& run, std::vector<std::unique_ptr<RunPart>> parts)
    : run_(run), parts_(std::move(parts)) {
  // Check the network first: a failure then leaves the files unchanged. In virtual time 8,000 messages would flood the
  // network at once, so publish only if --lcm-url is given.
  if (!request.outputs.no_lcm && (!request.virtual_time || request.outputs.lcm_url)) {
    const std::string url = request.outputs.lcm_url.value_or(telemetry::default_lcm_url());
    static_cast<void>(telemetry::parse_lcm_url(url));  // a malformed URL is a usage error, not a missing network
    lcm_.emplace(url);
  }
  try {
    // Open named files first: a bad path then leaves no run folder behind.
    if (request.outputs.prior_file) prior_.emplace(*request.outputs.prior_file, "prior");
    open_files(request.outputs, request.virtual_time);
    open_folder(request);
  } catch (const std::runtime_error& error) {
    throw config::ConfigError(error.what());
  }
  if (!log_.empty() || lcm_) open_stream(request);
  if (run.real_time() && !request.in_series) status_line_.emplace([this] { return snapshot(); });
  run.record_into(sinks());
  for (const auto& part : parts_) part->listen();
}

void RunOutputs::open_files(const OutputOptions& outputs, bool virtual_time) {
  if (outputs.csv_file) csv_.emplace_back(*outputs.csv_file, virtual_time ? 0 : write_period_ns, run_.names());
  if (outputs.summary_file) summary_.emplace_back(*outputs.summary_file, "summary");
  if (outputs.histogram_file) histogram_.emplace_back(*outputs.histogram_file, "histogram");
  if (outputs.log_file) {
    log_.emplace_back(*outputs.log_file, virtual_time ? std::optional(virtual_epoch_us) : std::nullopt,
                      virtual_time ? 0.0 : static_cast<double>(write_period_ns) * 1e-9);
  }
}

void RunOutputs::open_folder(const RunRequest& request) {
  const OutputOptions& o = request.outputs;
  if (o.run_folder) {
    folder_.emplace(*o.run_folder);
  } else {
    // A run in virtual time can be repeated from its command line: it leaves a run folder only if asked.
    const std::filesystem::path runs = run_folder::default_runs_dir();
    if (request.virtual_time || o.no_run_folder || o.names_files() || runs.empty()) return;
    try {
      folder_.emplace(
          run_folder::unused_folder(runs, fmt::localtime(std::time(nullptr)), request.settings.experiment.name));
    } catch (const run_folder::FolderError& error) {
      // This folder was not asked for, so its failure must not prevent the run.
      spdlog::warn("this run leaves no run folder: {} (--no-out silences this)", error.what());
      return;
    }
  }
  folder_->write(run_folder::file::config, std::string_view(request.toml));
  folder_->write(run_folder::file::experiment, std::string_view(request.script->text));
  for (const auto& [name, text] : request.script->files) folder_->write(name, std::string_view(text));
  open_files(
      {.csv_file = folder_->of(run_folder::file::csv),
       .log_file = folder_->of(run_folder::file::log),
       .summary_file = folder_->of(run_folder::file::summary),
       .histogram_file =
           request.virtual_time ? std::nullopt : std::optional(folder_->of(run_folder::file::histogram).string())},
      request.virtual_time);
  events_.emplace(folder_->of(run_folder::file::events), run_.names());
}

void RunOutputs::open_stream(const RunRequest& request) {
  const config::Settings& s = request.settings;
  stream_.emplace(telemetry::StreamOptions{.channel_prefix = s.telemetry.channel_prefix,
                                           .telemetry_every_cycles = static_cast<std::uint32_t>(s.telemetry.decimation),
                                           .status_period_s = s.telemetry.status_period_s,
                                           .experiment_period_s = s.telemetry.experiment_period_s},
                  experiment_info(request, run_.names()), [this] { return snapshot(); });
  for (telemetry::LogOutlet& log : log_) stream_->add(log);
  if (lcm_) {
    stream_->add(*lcm_);
    for (const auto& part : parts_) part->open(*lcm_, *stream_);
  }
}

std::vector<rig::RecordSink*> RunOutputs::sinks() {
  std::vector<rig::RecordSink*> sinks;
  for (telemetry::CsvSink& csv : csv_) sinks.push_back(&csv);
  if (events_) sinks.push_back(&*events_);
  if (stream_) sinks.push_back(&*stream_);
  // Behind the stream, because their messages refer to the record that the stream has just received.
  for (const auto& part : parts_) {
    if (rig::RecordSink* sink = part->sink()) sinks.push_back(sink);
  }
  if (status_line_ && status_line_->active()) sinks.push_back(&*status_line_);
  return sinks;
}

void RunOutputs::poll() {
  for (const auto& part : parts_) part->poll();
}

bool RunOutputs::stop_requested() const {
  return std::ranges::any_of(parts_, [](const auto& part) { return part->stop_requested(); });
}

nlohmann::ordered_json RunOutputs::controller_facts() const {
  for (const auto& part : parts_) {
    if (nlohmann::ordered_json facts = part->controller_facts(); !facts.is_null()) return facts;
  }
  return nullptr;
}

std::uint64_t RunOutputs::csv_rows_lost() const {
  std::uint64_t lost = 0;
  for (const telemetry::CsvSink& csv : csv_) lost += csv.rows_lost();
  return lost;
}

telemetry::StatusSnapshot RunOutputs::snapshot() const {
  const runtime::CycleStatistics& statistics = run_.executive().statistics();
  return {.cycles = statistics.cycles(),
          .telemetry_drops = run_.record_drops(),
          .gate_interventions = rig::interventions(run_.gate().counts()),
          .checks_unjudged = run_.gate().unjudged_share(),
          .realtime = run_.realtime_report().realtime(),
          .timing = statistics.summary()};
}

std::vector<std::string> RunOutputs::write(const analysis::RunSummary& summary,
                                           const run_folder::RunEnvironment& environment, bool complete) {
  std::vector<std::string> problems;
  const auto attempt = [&problems](auto&& work) {
    try {
      work();
    } catch (const std::runtime_error& error) {
      problems.emplace_back(error.what());
    }
  };
  for (files::ResultFile& file : summary_) attempt([&] { file.write(analysis::to_json(summary).dump(2) + '\n'); });
  for (files::ResultFile& file : histogram_)
    attempt([&] { file.write(runtime::cyclictest_histogram(run_.executive().statistics())); });
  if (prior_ && !summary.learnt.is_null()) {
    attempt([&] {
      prior_->write(config::prior_text(summary.learnt, summary.model.empty() ? summary.plant : summary.model));
    });
  }
  if (!folder_) return problems;
  attempt([&] {
    if (const auto& curve = run_.friction_curve()) {
      folder_->write("friction_curve.csv", std::string_view(analysis::to_csv(curve->result())));
    }
    folder_->write(run_folder::file::environment, run_folder::environment_json(environment));
    if (problems.empty() && complete) folder_->seal();
  });
  return problems;
}

}  // namespace abs_hil::program
