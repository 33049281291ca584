// The options of a run, each one row, and from the options as typed to the run: what the merge of the configuration
// does not know.
#include "program/command_line.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <system_error>

#include "config/config_error.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

namespace {

/// Checks that a run that waits for a start command can receive one.
void check_start(const RunRequest& request) {
  const config::Settings& s = request.settings;
  const auto refuse = [](const char* why) { throw config::ConfigError(std::string("--wait-for-start: ") + why); };
  if (!s.commands.enabled)
    refuse("the start command needs remote commands; add --set commands.enabled=true --set commands.key_file=FILE");
  if (request.outputs.no_lcm) refuse("the start command comes over LCM; leave out --no-lcm");
  if (request.virtual_time) refuse("a run in virtual time cannot wait for a command; leave out --fast");
  if (s.experiment.start_speed_rad_s > 0.0) {
    refuse(
        "wheels that turn from the beginning would slow down during the wait; leave out experiment.start_speed_rad_s");
  }
}

void add_output_options(cli::Parser& parser, OutputOptions& o) {
  parser.add("--csv", &o.csv_file, "write every cycle to a CSV file", {.type = "FILE.csv"});
  parser.add("--log", &o.log_file, "write an LCM event log (.lcmlog)", {.type = "FILE.lcmlog"});
  parser.add("--summary", &o.summary_file, "write the summary as JSON", {.type = "FILE.json"});
  parser.add("--prior", &o.prior_file,
             "what the controller learns for the next braking on this rig: read if the file is there, renewed "
             "after each braking that stops",
             {.type = "FILE"});
  parser.add("--recorder", &o.recorder_dir, "folder for the flight record: the last 2 s of a run that ended by a fault",
             {.type = "DIR"});
  parser.add("--out", &o.run_folder,
             "run folder for all of the run's files, new or empty (default: a new one below runs/)", {.type = "DIR"});
  parser.add("--no-out", &o.no_run_folder, "write no run folder", {.excludes = {"--out"}});
  parser.add("--lcm-url", &o.lcm_url, "LCM network (default: LCM_DEFAULT_URL, else UDP multicast)");
  parser.add("--no-lcm", &o.no_lcm, "do not publish on LCM", {.excludes = {"--lcm-url"}});
}

}  // namespace

bool hears_commands(const RunRequest& request) {
  return request.settings.commands.enabled && !request.outputs.no_lcm && !request.virtual_time;
}

bool at_terminal() noexcept { return ::isatty(STDIN_FILENO) == 1; }

void check_questions(const RunRequest& request) {
  const config::Settings& s = request.settings;
  if (!config::asks(*request.script)) return;
  if (s.experiment.answers == experiment::answers_person && !at_terminal() && !hears_commands(request)) {
    throw config::ConfigError(
        fmt::format("experiment {} asks a person, but stdin is no terminal and remote commands are not enabled: start "
                    "it in a terminal, or with --set commands.enabled=true --set commands.key_file=FILE and without "
                    "--no-lcm, and answer with abs_hil send continue",
                    request.script->name));
  }
  if (s.experiment.answers == experiment::answers_itself && s.on_rig() && !s.driver.emulated) {
    throw config::ConfigError(fmt::format(
        "experiment {}: experiment.answers = itself: on a rig only a person can say that it is done; leave it out",
        request.script->name));
  }
}

std::unique_ptr<files::ResultFile> open_result(const std::optional<std::string>& path, const std::string& kind) try {
  return path ? std::make_unique<files::ResultFile>(*path, kind) : nullptr;
} catch (const std::runtime_error& error) {
  throw config::ConfigError(error.what());
}

void keep_inputs(const config::Sources& sources) {
  for (const auto* file : {&sources.config_file, &sources.plant, &sources.model, &sources.experiment}) {
    std::error_code error;
    if (file->has_value() && std::filesystem::is_regular_file(**file, error)) files::note_input(**file);
  }
}

RunRequest merge(const RunOptions& options) {
  if (options.virtual_time && options.outputs.histogram_file) {
    throw config::ConfigError(
        "--histogram: a run in virtual time (--fast) has no latencies to measure; leave out one of the two");
  }
  config::Sources sources = options;
  sources.prior_file = options.outputs.prior_file;
  const bool by_itself = options.backend != "rig" && (options.virtual_time || !at_terminal());
  sources.answered_by = by_itself ? experiment::answers_itself : experiment::answers_person;
  keep_inputs(sources);
  RunRequest request{config::merge(sources), options.outputs, options.virtual_time};
  if (request.settings.experiment.wait_for_start) check_start(request);
  return request;
}

void add_backend_option(cli::Parser& parser, config::Sources& o) {
  parser.add("--backend", &o.backend, "sim or rig", {.one_of = {"sim", "rig"}, .show_default = true});
}

void add_config_file(cli::Parser& parser, config::Sources& o) {
  parser.add("--config", &o.config_file, "TOML file with any configuration values", {.type = "FILE"});
}

void add_assignments(cli::Parser& parser, config::Sources& o) {
  parser.add("--set", &o.assignments, "set any configuration value (abs_hil list --keys)",
             {.type = "key=value", .repeated = true});
}

void add_configuration_options(cli::Parser& parser, config::Sources& o) {
  add_config_file(parser, o);
  parser.add("--plant", &o.plant, "simulated plant by name or TOML file", {.type = "NAME|FILE"});
  parser.add("--model", &o.model, "the controllers' model of the rig, by name or TOML file (default: the plant)",
             {.type = "NAME|FILE"});
  parser.add("--controller,--controllers", &o.controller, "slip controller, by name or FILE.so, FILE.fmu or FILE.agent",
             {.type = "NAME|FILE"});
  add_assignments(parser, o);
}

void add_threads(cli::Parser& parser, std::size_t& threads) {
  parser.add("--threads", &threads, "number of threads, 0: one for each processor; does not change the results",
             {.type = "N", .range = {0, 1024}, .show_default = true});
}

void add_timing_options(cli::Parser& parser, config::Sources& o, std::optional<std::string>& histogram_file) {
  parser.add("--rate", &o.rate_Hz, "control cycles per second, 100 to 10000", {.type = "HZ"});
  parser.add("--rt", &o.realtime,
             "real-time scheduling: required, preferred or off (default: require on a real board, otherwise "
             "prefer)",
             {.one_of = {"require", "prefer", "off"}});
  parser.add("--histogram", &histogram_file, "write latency histograms in cyclictest's format", {.type = "FILE"});
}

void add_run_options(cli::Parser& parser, RunOptions& o) {
  add_backend_option(parser, o);
  add_configuration_options(parser, o);
  parser.add("--experiment", &o.experiment, "experiment by name or TOML file", {.type = "NAME|FILE"});
  parser.add("--slip-ref", &o.slip_ref, "slip reference, in (0, 1)", {.type = "X"});
  add_timing_options(parser, o, o.outputs.histogram_file);
  parser.add("--wait-for-start", &o.wait_for_start,
             "wait for `abs_hil send start` before the first phase (needs commands.enabled)");
  parser.add("--fast", &o.virtual_time, "run in virtual time, as fast as the computer can");
  parser.add("--seed", &o.seed, "seed of all random numbers in the simulator", {.type = "N"});
  parser.add("--inject", &o.injections,
             "inject a fault, given as PHASE@SIGNAL:KIND[=PARAMETER][+DELAY][~DURATION], for example "
             "brake@encoder_upper:stuck+0.2s; simulator and emulators only",
             {.type = "FAULT", .repeated = true});
  add_output_options(parser, o.outputs);
}

}  // namespace abs_hil::program
