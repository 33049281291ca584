// Keeps the flight record of a run, and its guardian if it drives a board.
#include "program/run_monitor.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cmath>
#include <ctime>

#include "config/config_error.hpp"
#include "experiment/board_record.hpp"
#include "rig/formatted_text.hpp"
#include "telemetry/flight_record.hpp"
#include "version/build_facts.hpp"

namespace abs_hil::program {

namespace {

constexpr double recorded_s = 2.0;

/// The guardian's timeout in cycles; the cycle waits as long for heartbeats from the guardian.
std::uint64_t silent_cycles_max(const config::Settings& s) {
  constexpr double s_per_ms = 1e-3;
  constexpr std::int64_t least = 3;
  const std::int64_t cycles = std::llround(std::ceil(s.guardian.timeout_ms * s_per_ms * s.control.rate_Hz));
  return static_cast<std::uint64_t>(std::max(least, cycles));
}

}  // namespace

telemetry::ExperimentInfo experiment_info(const config::Configuration& configuration, rig::RunNames names) {
  const config::Settings& s = configuration.settings;
  telemetry::ExperimentInfo info{};
  info.experiment = s.experiment.name;
  info.controller = s.control.controller;
  info.plant = s.plant_name;
  info.backend = s.backend;
  info.config_json = configuration.json;
  info.version = version::build_facts().version;
  info.names = std::move(names);
  return info;
}

std::string guardian_launch_json(const config::Configuration& configuration, const std::filesystem::path& record_prefix,
                                 const std::vector<std::string>& signals) {
  return to_json(guardian::LaunchConfig{.run = experiment_info(configuration, {.signals = signals}),
                                        .realtime = configuration.settings.realtime.mode,
                                        .record_prefix = record_prefix.string()});
}

guardian::Guard& started_guardian(guardian::GuardianLease* lease, std::optional<guardian::GuardianProcess>& own,
                                  guardian::SharedRecorder& recorder, const std::string& launch_json) {
  if (lease == nullptr) return own.emplace(recorder, guardian::guardian_program(), launch_json);
  lease->cover(recorder, launch_json);
  return *lease;
}

RunMonitor::RunMonitor(const RunRequest& request, guardian::GuardianLease* lease, std::filesystem::path record_prefix,
                       rig::RunNames names)
    : names_(std::move(names)),
      record_prefix_(std::move(record_prefix)),
      recorder_(runtime::FlightRing::slots_for(recorded_s, request.settings.control.rate_Hz)),
      resident_(lease != nullptr),
      request_(request) {
  if (!guardian::needs_guardian(request.settings, request.virtual_time)) {
    pages_.emplace();
    heartbeat_.emplace(pages_->run(), pages_->guard(), recorder_.ring());
    return;
  }
  guardian_ =
      &started_guardian(lease, own_guardian_, recorder_, guardian_launch_json(request, record_prefix_, names_.signals));
  const guardian::Pages& pages = guardian_->pages();
  heartbeat_.emplace(pages.run(), pages.guard(), recorder_.ring(), silent_cycles_max(request.settings));
}

RunMonitor::~RunMonitor() {
  if (guardian_ != nullptr) static_cast<void>(guardian_->end());
}

void RunMonitor::attach(run::Run& run) {
  run.set_watch(*heartbeat_);
  if (guardian_ != nullptr) run.guard_with(*guardian_);
}

rig::Reason RunMonitor::poll() {
  if (guardian_ == nullptr || !guardian_->armed()) return rig::Reason::none;
  if (!std::exchange(told_notes_, true)) {
    const std::string who = guardian::who_guards(*guardian_, resident_, request_.settings);
    if (guardian_->notes().empty()) {
      spdlog::info("guardian: {}", who);
    } else {
      spdlog::warn("guardian: {}. It has no real-time scheduling and may act late\n{}", who, guardian_->notes());
    }
  }
  // A guardian that has already taken over the outputs has not died.
  const guardian::Stage stage = guardian_->pages().run().stage.load(std::memory_order_relaxed);
  const bool on_duty = stage == guardian::Stage::guarded || stage == guardian::Stage::making_safe;
  return on_duty && !guardian_->alive() ? rig::Reason::guardian_died : rig::Reason::none;
}

void RunMonitor::write_record(const RunRequest& request, rig::Reason reason, double value, const std::string& account) {
  if (record_prefix_.empty()) return;
  const auto records = recorder_.ring().contents();
  std::vector<std::string> problems;
  const auto files = telemetry::write_flight_record(
      record_prefix_, {.records = records, .reason = reason, .reason_value = value, .account = account + '\n'},
      experiment_info(request, names_), request.settings.telemetry.channel_prefix, problems);
  if (!files.empty()) spdlog::info("flight record: {}", files.front().string());
  for (const std::string& problem : problems) spdlog::error("flight record: {}", problem);
}

void RunMonitor::end() {
  if (guardian_ == nullptr) return;
  const pid_t pid = guardian_->pid();
  switch (guardian_->end()) {
    case guardian::GuardEnd::none:
    case guardian::GuardEnd::ended: return;
    case guardian::GuardEnd::failed:
      spdlog::error("guardian: process {} ended with an error: see its messages above", pid);
      return;
    case guardian::GuardEnd::insisting:
      spdlog::error(
          "guardian: process {0} still tries to make the outputs safe and will report the result. Press the E-stop. "
          "Once the rig's power is off, kill -USR1 {0} ends its tries",
          pid);
  }
}

std::filesystem::path flight_record_prefix(const RunRequest& request, const std::filesystem::path& run_folder) {
  namespace fs = std::filesystem;
  const OutputOptions& o = request.outputs;
  if (!o.recorder_dir && !run_folder.empty()) return run_folder / "recorder";
  fs::path folder = o.recorder_dir.value_or("");
  std::error_code error;
  for (const auto* file : {&o.log_file, &o.csv_file, &o.summary_file}) {
    if (folder.empty() && file->has_value() && !fs::is_other(**file, error)) folder = fs::path(**file).parent_path();
  }
  if (folder.empty()) {
    if (!o.log_file && !o.csv_file && !o.summary_file && request.settings.backend != "rig") return {};
    folder = experiment::state_folder() / "recorder";
  }
  fs::create_directories(folder, error);
  if (error || ::access(folder.c_str(), W_OK | X_OK) != 0) {
    const int why = error ? error.value() : errno;
    if (o.recorder_dir)
      throw config::ConfigError("--recorder " + *o.recorder_dir + ": " + rig::refusal(why, folder, rig::writing));
    folder = fs::temp_directory_path(error);
  }
  const std::string name = fmt::format("recorder-{:%Y%m%d-%H%M%S}-{}", fmt::localtime(std::time(nullptr)), ::getpid());
  return fs::absolute(folder) / name;
}

}  // namespace abs_hil::program
