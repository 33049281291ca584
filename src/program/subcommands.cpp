// The table of subcommands, and the programs in Python among them. The options of a run, each one row, and from the
// options as typed to the run: what the merge of the configuration does not know.
#include "program/subcommands.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "config/config_error.hpp"
#include "program/extra.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::program {

namespace {

constexpr std::array table{
    Subcommand{"list", "list controllers, plants, experiments and backends", &add_list},
    Subcommand{"doctor", "check this computer and give a fix for each shortcoming", &add_doctor},
    Subcommand{"latency", "run the real-time cycle on the simulated rig and judge this computer's timing",
               &add_latency},
    Subcommand{"validate", "describe an experiment and check it against the limits", &add_validate},
    Subcommand{"commission", "first steps with a real rig; asks before each step", &add_commission},
    Subcommand{"init-rig", "write NAME.toml, the parameters of a rig of your own to fill in", &add_init_rig},
    Subcommand{"safe",
               "make the configured board, or every board found, safe and verify it; ends the run that drives it",
               &add_safe},
    Subcommand{"log", "say what recordings hold: log info FILE"},
    Subcommand{"convert", "convert a recorded run to .csv, .mcap or .parquet, or record a running one"},
    Subcommand{"export-fmu",
               "write the simulated rig, or with --controller a slip controller, as an FMU for other tools"},
    Subcommand{"watch", "show a running experiment in this terminal, over LCM; q quits"},
    Subcommand{"serve", "show a running experiment, or a recorded one, as a scope in the browser"},
    Subcommand{"lab", "make a page that simulates the rig and its controllers in the browser, without a server"},
    Subcommand{"report", "make a page with figures and tables of recorded runs, or export their rows"},
    Subcommand{"tune", "search for a controller's gains in simulation"},
    Subcommand{"identify", "estimate the rig's parameters from its own logs, with intervals"},
    Subcommand{"benchmark", "score controllers against the shortest braking, over a fixed set of cases"},
    Subcommand{"rig", "write a simulated rig that a class does not know, steady or wandering"},
    Subcommand{"learn", "train a small controller in simulation, from nothing but trial and error"},
};

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

const std::vector<Subcommand>& subcommands() {
  static const std::vector<Subcommand> all = [] {
    std::vector<Subcommand> rows(table.begin(), table.end());
    for (const Extra* extra : extras()) rows.insert(rows.end(), extra->subcommands.begin(), extra->subcommands.end());
    return rows;
  }();
  return all;
}

std::optional<int> start_python_program(int argc, char** argv) {
  if (argc < 2) return std::nullopt;
  const std::string_view name = argv[1];
  const bool listed =
      std::ranges::any_of(table, [&](const Subcommand& row) { return row.add == nullptr && row.name == name; });
  if (!listed) return std::nullopt;

  const std::string file = fmt::format("abs_{}", name);
  std::vector<char*> arguments{const_cast<char*>(file.c_str())};  // exec changes none of them
  arguments.insert(arguments.end(), argv + 2, argv + argc);
  arguments.push_back(nullptr);
  ::execvp(python_program(name).c_str(), arguments.data());
  cli::print(stderr, "abs_hil: {}\n", no_python_program(name, errno));
  return exit_unavailable;
}

std::string python_program(std::string_view name) {
  std::error_code error;
  const std::filesystem::path beside = std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
  std::string file = fmt::format("abs_{}", name);
  const std::filesystem::path path = beside / file;
  return std::filesystem::exists(path, error) ? path.string() : file;
}

std::string no_python_program(std::string_view name, int error) {
  const std::string cause = error == ENOENT ? "No such file or directory; install the package python3-abs-hil, or `pip "
                                              "install .` in the source folder"
                                            : rig::refusal(error, python_program(name), rig::starting);
  return fmt::format("{}: {} (it is a program in Python)", python_program(name), cause);
}

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
