#include "program/recording_commands.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <utility>

#include "config/config_error.hpp"
#include "program/exit_status.hpp"
#include "replay/check.hpp"
#include "replay/recorded_run.hpp"
#include "replay/report.hpp"
#include "replay/rerun.hpp"
#include "run_folder/run_folder.hpp"
#include "telemetry/csv_sink.hpp"
#include "telemetry/log_to_csv.hpp"

namespace abs_hil::program {

namespace {

/// The event log of a run folder that is as it was recorded; any other path as it is.
std::string log_in(const std::string& recording) try {
  const std::filesystem::path path(recording);
  std::error_code error;
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

}  // namespace

void add_replay(cli::Parser& parser, ReplayCommand& command) {
  command.parser = parser.add_subcommand("replay", "feed a recorded run to its own or another controller, open loop");
  command.parser.add({.names = "recording",
                      .to = &command.recording,
                      .help = "event log (--log), or a run folder (--out)",
                      .type = "LOG",
                      .required = true});
  command.parser.add({.names = "--check",
                      .to = &command.check,
                      .help = "run the recorded configuration again and check that all commands are bit-equal"});
  command.parser.add({.names = "--controller",
                      .to = &command.controller,
                      .help = "use another slip controller",
                      .type = "NAME",
                      .excludes = {"--check"}});
  command.parser.add({.names = "--set",
                      .to = &command.assignments,
                      .help = "change a recorded configuration value",
                      .type = "key=value",
                      .repeated = true,
                      .excludes = {"--check"}});
  command.parser.add({.names = "--csv",
                      .to = &command.csv_file,
                      .help = "write the replayed commands, with the columns of a run's CSV",
                      .type = "FILE",
                      .excludes = {"--check"}});
}

namespace {

int check_again(const replay::RecordedRun& run) {
  const replay::CheckResult result = replay::check(run);
  for (const std::string& line : result.lines) fmt::print("{}\n", line);
  if (result.equal) return exit_completed;
  fmt::print(
      stderr,
      "abs_hil: the replayed commands differ from the recorded ones: the version or the computer is another, or the "
      "recording is damaged\n");
  return exit_ended_early;
}

}  // namespace

int replay_run(const ReplayCommand& command) {
  try {
    const replay::RecordedRun run = replay::read_run(log_in(command.recording));
    note(run.cut);
    if (command.check) return check_again(run);
    const config::Settings settings = replay::settings_of(run, {command.controller, command.assignments});
    const std::vector<replay::RerunCycle> rerun =
        replay::rerun_open_loop(run, settings, replay::WheelFaults::as_recorded);
    fmt::print("{}", replay::report(run, settings, rerun));
    if (command.csv_file) {
      telemetry::CsvSink csv(*command.csv_file, 0, replay::names_of(run, settings));
      for (const replay::RerunCycle& cycle : rerun) csv.consume(cycle.record, cycle.distance_m);
      csv.finish();
    }
    return exit_completed;
  } catch (const telemetry::RecordingError& error) {
    throw config::ConfigError(error.what());
  }
}

void add_convert(cli::Parser& parser, ConvertCommand& command) {
  command.parser = parser.add_subcommand(
      "convert", "convert an event log (.lcmlog) to CSV; a run to .mcap or .parquet (abs_convert --help)");
  command.parser.add(
      {.names = "from", .to = &command.from, .help = "event log or run folder", .type = "IN", .required = true});
  command.parser.add({.names = "to",
                      .to = &command.to,
                      .help = "FILE.csv, FILE.mcap or FILE.parquet",
                      .type = "OUT",
                      .required = true});
}

int convert(const ConvertCommand& command) {
  const std::string from = log_in(command.from);
  if (std::filesystem::path(command.to).extension() != ".csv") {
    throw config::ConfigError("convert: OUT = " + command.to + ": give a name that ends in .csv, .mcap or .parquet");
  }
  try {
    const telemetry::ConversionCounts counts = telemetry::log_to_csv(from, command.to);
    note(counts.cut);
    if (!counts.lacks.empty()) spdlog::warn("'{}' lacks {}: another version wrote it", from, counts.lacks);
    fmt::print("{} events", counts.events);
    if (counts.raw > 0) fmt::print(", {} of them of unknown type, kept as hexadecimal digits", counts.raw);
    fmt::print("\n");
    return exit_completed;
  } catch (const telemetry::RecordingError& error) {
    throw config::ConfigError(error.what());
  }
}

}  // namespace abs_hil::program
