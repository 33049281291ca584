// `abs_hil replay`: what was recorded, once more.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <memory>

#include "config/config_error.hpp"
#include "files/result_file.hpp"
#include "program/extra.hpp"
#include "replay/replay.hpp"
#include "run_folder/run_folder.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/event_log.hpp"

namespace abs_hil::program {

namespace {

/// The event log of a run folder that is as it was recorded; any other path as it is.
std::string log_in(const std::string& recording) try {
  const std::filesystem::path path(telemetry::NamedRecording(recording).path);
  std::error_code error;
  files::note_input(path);
  if (!std::filesystem::is_directory(path, error)) return recording;
  run_folder::check_seal(path);
  return (path / run_folder::file::log).string();
} catch (const run_folder::FolderError& error) {
  throw config::ConfigError(error.what());
}

/// Says that a recording is that of a killed run.
void note(const std::string& cut) {
  if (!cut.empty()) spdlog::warn("{}", cut);
}

struct ReplayCommand {
  std::string recording{};
  std::optional<std::string> controller{};
  std::vector<std::string> assignments{};
  bool check{false};
  std::optional<std::string> csv_file{};
};

int check_again(const replay::RecordedRun& run) {
  const replay::CheckResult result = replay::check(run);
  for (const std::string& line : result.lines) cli::print("{}\n", line);
  if (result.equal) return exit_completed;
  cli::print(
      stderr,
      "abs_hil: the replayed commands differ from the recorded ones: the version or the computer is another, or the "
      "recording is damaged\n");
  return exit_ended_early;
}

/// With --check 0 if all commands are bit-equal and 1 if not; 2 for a file that is no recording or is damaged.
int replay_run(const ReplayCommand& command) {
  const replay::RecordedRun run = replay::read_run(log_in(command.recording));
  note(run.cut);
  if (command.check) return check_again(run);
  const config::Settings settings = replay::settings_of(run, {command.controller, command.assignments});
  std::optional<telemetry::CsvSink> csv;
  try {
    if (command.csv_file) csv.emplace(*command.csv_file, 0, replay::names_of(run, settings));
  } catch (const files::FileError& error) {
    throw config::ConfigError(error.what());
  }
  const std::vector<replay::RerunCycle> rerun =
      replay::rerun_open_loop(run, settings, replay::WheelFaults::as_recorded);
  cli::print(files::for_people(), "{}", replay::report(run, settings, rerun));
  if (csv) {
    for (const replay::RerunCycle& cycle : rerun) csv->consume(cycle.record, cycle.distance_m);
    csv->finish();
  }
  return exit_completed;
}

Action add_replay(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<ReplayCommand>();
  parser.add("recording", &o->recording, "event log (--log) or run folder (--out); LOG#2: the second run of a log",
             {.type = "LOG", .required = true});
  parser.add("--check", &o->check, "run the recorded configuration again and check that all commands are bit-equal");
  parser.add("--controller,--controllers", &o->controller, "use another slip controller",
             {.type = "NAME", .excludes = {"--check"}});
  parser.add("--set", &o->assignments, "change a recorded configuration value",
             {.type = "key=value", .repeated = true, .excludes = {"--check"}});
  parser.add("--out,--csv", &o->csv_file, "write the replayed commands, with the columns of a run's CSV",
             {.type = "FILE.csv", .excludes = {"--check"}});
  return [o] { return replay_run(*o); };
}

constexpr Subcommand row{"replay", "feed a recorded run to its own or another controller, open loop", &add_replay};

}  // namespace

extern const Extra replay_extra;
constinit const Extra replay_extra{.name = "replay", .subcommands = {&row, 1}};

}  // namespace abs_hil::program
