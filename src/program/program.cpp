#include "abs_hil/program/program.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "cli/command_line.hpp"
#include "config/config_error.hpp"
#include "diagnosis/doctor.hpp"
#include "program/exit_status.hpp"
#include "program/python_programs.hpp"
#include "program/recording_commands.hpp"
#include "program/signals.hpp"
#include "program/subcommands.hpp"
#include "telemetry/file_error.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil {

namespace {

void add_backend_option(cli::Parser& parser, program::RunOptions& o) {
  parser.add(
      {.names = "--backend", .to = &o.backend, .help = "sim or rig", .one_of = {"sim", "rig"}, .show_default = true});
}

void add_config_file(cli::Parser& parser, program::RunOptions& o) {
  parser.add(
      {.names = "--config", .to = &o.config_file, .help = "TOML file with any configuration values", .type = "FILE"});
}

void add_assignments(cli::Parser& parser, program::RunOptions& o) {
  parser.add({.names = "--set",
              .to = &o.assignments,
              .help = "set any configuration value (abs_hil list --keys)",
              .type = "key=value",
              .repeated = true});
}

/// Adds options that belong to the configuration, not to a single run.
void add_configuration_options(cli::Parser& parser, program::RunOptions& o) {
  add_config_file(parser, o);
  parser.add({.names = "--plant", .to = &o.plant, .help = "simulated plant by name or TOML file", .type = "NAME|FILE"});
  parser.add({.names = "--model",
              .to = &o.model,
              .help = "the controllers' model of the rig, by name or TOML file (default: the plant)",
              .type = "NAME|FILE"});
  parser.add({.names = "--controller", .to = &o.controller, .help = "slip controller", .type = "NAME"});
  add_assignments(parser, o);
}

void add_timing_options(cli::Parser& parser, program::RunOptions& o) {
  parser.add({.names = "--rate", .to = &o.rate_Hz, .help = "control cycles per second, 100 to 10000", .type = "HZ"});
  parser.add({.names = "--rt",
              .to = &o.realtime,
              .help = "real-time scheduling: required, preferred or off (default: require on a real board, otherwise "
                      "prefer)",
              .one_of = {"require", "prefer", "off"}});
  parser.add({.names = "--histogram",
              .to = &o.outputs.histogram_file,
              .help = "write latency histograms in cyclictest's format",
              .type = "FILE"});
}

void add_output_options(cli::Parser& parser, program::OutputOptions& o) {
  parser.add({.names = "--csv", .to = &o.csv_file, .help = "write every cycle to a CSV file", .type = "FILE"});
  parser.add({.names = "--log", .to = &o.log_file, .help = "write an LCM event log (.lcmlog)", .type = "FILE"});
  parser.add({.names = "--summary", .to = &o.summary_file, .help = "write the summary as JSON", .type = "FILE"});
  parser.add({.names = "--recorder",
              .to = &o.recorder_dir,
              .help = "folder for the flight record: the last 2 s of a run that ended by a fault",
              .type = "DIR"});
  parser.add({.names = "--out",
              .to = &o.run_folder,
              .help = "run folder for all of the run's files, new or empty (default: a new one below runs/)",
              .type = "DIR"});
  parser.add({.names = "--no-out", .to = &o.no_run_folder, .help = "write no run folder", .excludes = {"--out"}});
  parser.add(
      {.names = "--lcm-url", .to = &o.lcm_url, .help = "LCM network (default: LCM_DEFAULT_URL, else UDP multicast)"});
  parser.add({.names = "--no-lcm", .to = &o.no_lcm, .help = "do not publish on LCM", .excludes = {"--lcm-url"}});
}

void add_run_options(cli::Parser& parser, program::RunOptions& o) {
  add_backend_option(parser, o);
  add_configuration_options(parser, o);
  parser.add(
      {.names = "--experiment", .to = &o.experiment, .help = "experiment by name or TOML file", .type = "NAME|FILE"});
  parser.add({.names = "--slip-ref", .to = &o.slip_ref, .help = "slip reference, in (0, 1)", .type = "X"});
  add_timing_options(parser, o);
  parser.add({.names = "--wait-for-start",
              .to = &o.wait_for_start,
              .help = "wait for `abs_hil send start` before the first phase (needs commands.enabled)"});
  parser.add({.names = "--fast", .to = &o.outputs.fast, .help = "run in virtual time, as fast as the computer can"});
  parser.add({.names = "--seed", .to = &o.seed, .help = "seed of all random numbers in the simulator", .type = "N"});
  parser.add({.names = "--inject",
              .to = &o.injections,
              .help = "inject a fault, given as PHASE@SIGNAL:KIND[=PARAMETER][+DELAY][~DURATION], for example "
                      "brake@encoder_upper:stuck+0.2s; simulator and emulators only",
              .type = "FAULT",
              .repeated = true});
  add_output_options(parser, o.outputs);
}

/// Options of `abs_hil list` as typed.
struct ListCommand {
  bool keys{false};
  bool quantities{false};
  bool reasons{false};
  bool json{false};
  cli::Parser parser{};
};

void add_list(cli::Parser& parser, ListCommand& command) {
  command.parser = parser.add_subcommand("list", "list controllers, plants, experiments and backends");
  command.parser.add(
      {.names = "--keys", .to = &command.keys, .help = "list all configuration values with unit and range"});
  command.parser.add({.names = "--quantities",
                      .to = &command.quantities,
                      .help = "list the quantities of a CSV row and of ABS_TELEMETRY",
                      .excludes = {"--keys"}});
  command.parser.add({.names = "--reasons",
                      .to = &command.reasons,
                      .help = "list the reasons of phase changes, ends of runs and refused commands",
                      .excludes = {"--keys", "--quantities"}});
  command.parser.add(
      {.names = "--json", .to = &command.json, .help = "print quantities or reasons as JSON", .excludes = {"--keys"}});
}

/// Options of `abs_hil doctor` as typed.
struct DoctorCommand {
  program::RunOptions options{};
  std::string only{};
  bool json{false};
  cli::Parser parser{};
};

void add_doctor(cli::Parser& parser, DoctorCommand& command) {
  command.parser = parser.add_subcommand("doctor", "check this computer and give a fix for each shortcoming");
  add_backend_option(command.parser, command.options);
  add_configuration_options(command.parser, command.options);
  command.parser.add(
      {.names = "--only", .to = &command.only, .help = "run only this check", .one_of = diagnosis::check_names()});
  command.parser.add({.names = "--json", .to = &command.json, .help = "print JSON instead of text"});
}

/// Options of `abs_hil latency` as typed.
struct LatencyCommand {
  program::RunOptions options{};
  program::LatencyOptions latency{};
  cli::Parser parser{};
};

void add_latency(cli::Parser& parser, LatencyCommand& command) {
  command.parser =
      parser.add_subcommand("latency", "run the real-time cycle on the simulated rig and judge this computer's timing");
  add_configuration_options(command.parser, command.options);
  add_timing_options(command.parser, command.options);
  command.parser.add({.names = "--duration",
                      .to = &command.latency.duration_s,
                      .help = "duration of the test, s",
                      .type = "S",
                      .show_default = true});
  command.parser.add({.names = "--secaligned",
                      .to = &command.latency.second_offset_us,
                      .help = "begin at a whole second plus this many us, like cyclictest's option of the same name",
                      .type = "US",
                      .range = {0, 999'999}});
  command.parser.add({.names = "--json", .to = &command.latency.json, .help = "print JSON instead of text"});
}

cli::Parser add_compare(cli::Parser& parser, program::CompareOptions& o) {
  cli::Parser compare = parser.add_subcommand("compare", "compare controllers in simulation on the same varied plants");
  compare.add({.names = "--plant", .to = &o.run.plant, .help = "plant by name or TOML file", .type = "NAME|FILE"});
  compare.add({.names = "--model",
               .to = &o.run.model,
               .help = "every controller's model (default: the plant, before it varies)",
               .type = "NAME|FILE"});
  compare.add({.names = "--controllers",
               .to = &o.controllers,
               .help = "controllers; the first one is the baseline",
               .type = "A,B,...",
               .delimiter = ',',
               .show_default = true});
  compare.add({.names = "--repeat",
               .to = &o.repeat,
               .help = "runs of each controller",
               .type = "N",
               .range = {1, 1'000'000},
               .show_default = true});
  compare.add(
      {.names = "--seed", .to = &o.seed, .help = "seed of the varied plants", .type = "N", .show_default = true});
  compare.add({.names = "--vary",
               .to = &o.vary,
               .help = "what varies: parameters (wheels, brake, tyre), theta, radii, phase, or none",
               .type = "SPEC",
               .default_text = "parameters=0.1,theta=0.1,phase"});
  add_config_file(compare, o.run);
  add_assignments(compare, o.run);
  compare.add({.names = "--threads",
               .to = &o.threads,
               .help = "number of threads, 0: one for each processor; does not change the results",
               .type = "N",
               .range = {0, 1024},
               .show_default = true});
  compare.add({.names = "--json", .to = &o.json_file, .help = "write the table as JSON", .type = "FILE"});
  compare.add({.names = "--csv", .to = &o.csv_file, .help = "write the table as CSV", .type = "FILE"});
  compare.add({.names = "--markdown", .to = &o.markdown_file, .help = "write the table as Markdown", .type = "FILE"});
  compare.add({.names = "--runs", .to = &o.runs_file, .help = "write each run's results as CSV", .type = "FILE"});
  compare.set_footer("To compare runs that are already recorded, use abs_hil report RUN RUN.");
  return compare;
}

/// Refuses run options before a subcommand that would ignore them.
void refuse_run_options(const cli::Parser& parser, const std::string& command) {
  for (const std::string& option : parser.given()) {
    throw config::ConfigError(
        fmt::format("{}: give the options of `abs_hil {}` after the word {}", option, command, command));
  }
}

/// Options of `abs_hil commission` as typed.
struct CommissionCommand {
  program::RunOptions options{.backend = "rig"};
  experiment::CommissioningOptions pulses{};
  cli::Parser parser{};
};

void add_commission(cli::Parser& parser, CommissionCommand& command) {
  command.parser = parser.add_subcommand("commission", "first steps with a real rig; asks before each step");
  add_configuration_options(command.parser, command.options);
  command.parser.add({.names = "--drive-duty",
                      .to = &command.pulses.drive_duty,
                      .help = "duty of the drive pulse, in (0, 0.3]",
                      .show_default = true});
  command.parser.add({.names = "--brake-duty",
                      .to = &command.pulses.brake_duty,
                      .help = "duty of the brake pulse, in (0, 0.7]",
                      .show_default = true});
}

cli::Parser add_watch(cli::Parser& parser, watch::WatchOptions& o) {
  cli::Parser watch = parser.add_subcommand("watch", "show a running experiment in this terminal, over LCM; q quits");
  watch.add({.names = "--lcm-url", .to = &o.url, .help = "LCM network (default: LCM_DEFAULT_URL, else UDP multicast)"});
  watch.add({.names = "--prefix",
             .to = &o.prefix,
             .help = "prefix of the channel names: the run's telemetry.channel_prefix",
             .show_default = true});
  watch.add({.names = "--window",
             .to = &o.window_s,
             .help = "width of the plots, 1 to 60 s",
             .type = "S",
             .show_default = true});
  watch.add({.names = "--ascii", .to = &o.ascii, .help = "use ASCII only, for a terminal that shows braille badly"});
  watch.add({.names = "--plain",
             .to = &o.plain,
             .help = "print one line per second instead of a screen; always so without a terminal"});
  watch.add({.names = "--once",
             .to = &o.once,
             .help = "print one screen as text; exit status 3 if no message arrives",
             .excludes = {"--plain"}});
  watch.add({.names = "--timeout",
             .to = &o.once_timeout_s,
             .help = "longest wait of --once for messages, s",
             .type = "S",
             .show_default = true,
             .needs = {"--once"}});
  return watch;
}

/// Options of `abs_hil send` as typed.
struct SendCommand {
  program::RunOptions options{};
  program::SendOptions send{};
  cli::Parser parser{};
};

void add_send(cli::Parser& parser, SendCommand& command) {
  command.parser = parser.add_subcommand("send", "send a command to a running abs_hil over LCM");
  command.parser.add({.names = "order",
                      .to = &command.send.order,
                      .help = "stop | start | slip-ref X | gain NAME X",
                      .count = {1, 3},
                      .required = true});
  command.parser.add({.names = "--config",
                      .to = &command.options.config_file,
                      .help = "TOML file with commands.key_file",
                      .type = "FILE"});
  command.parser.add({.names = "--set",
                      .to = &command.options.assignments,
                      .help = "set any configuration value",
                      .type = "key=value",
                      .repeated = true});
  command.parser.add({.names = "--lcm-url", .to = &command.options.outputs.lcm_url, .help = "LCM network"});
  command.parser.add({.names = "--timeout",
                      .to = &command.send.timeout_s,
                      .help = "longest wait for the answer, s",
                      .type = "S",
                      .range = {0.1, 60.0},
                      .show_default = true});
}

/// Options of `abs_hil validate` as typed.
struct ValidateCommand {
  program::RunOptions options{};
  bool schema{false};
  cli::Parser parser{};
};

void add_validate(cli::Parser& parser, ValidateCommand& command) {
  command.parser = parser.add_subcommand("validate", "describe an experiment and check it against the limits");
  command.parser.add({.names = "EXPERIMENT",
                      .to = &command.options.experiment,
                      .help = "experiment by name or TOML file",
                      .type = "NAME|FILE"});
  command.parser.add(
      {.names = "--schema", .to = &command.schema, .help = "print the JSON Schema of experiment files instead"});
  add_backend_option(command.parser, command.options);
  add_configuration_options(command.parser, command.options);
}

int dispatch(int argc, char** argv) {
  cli::Parser parser("abs_hil", "Driver, adaptive slip controller and simulator of the Inteco ABS laboratory rig");
  parser.set_version(ABS_HIL_VERSION);
  program::RunOptions options;
  add_run_options(parser, options);
  ListCommand list;
  add_list(parser, list);
  DoctorCommand doctor;
  add_doctor(parser, doctor);
  LatencyCommand latency;
  add_latency(parser, latency);
  program::CompareOptions compare_options;
  const cli::Parser compare = add_compare(parser, compare_options);
  ValidateCommand validate;
  add_validate(parser, validate);
  CommissionCommand commission;
  add_commission(parser, commission);
  program::ReplayCommand replay_command;
  program::add_replay(parser, replay_command);
  program::ConvertCommand convert_command;
  program::add_convert(parser, convert_command);
  watch::WatchOptions watch_options;
  const cli::Parser watch = add_watch(parser, watch_options);
  SendCommand send;
  add_send(parser, send);
  // Only for the help: these words are looked for before the command line is read.
  std::vector<cli::Parser> python_programs;
  for (const program::PythonProgram& python : program::python_programs) {
    python_programs.push_back(parser.add_subcommand(std::string(python.name), std::string(python.help)));
  }
  if (const std::optional<int> status = parser.parse(argc, argv)) return *status;
  if (list.json && !list.quantities && !list.reasons) {
    return parser.refuse("--json requires --quantities or --reasons");
  }
  if (list.quantities) return program::list_quantities(list.json);
  if (list.reasons) return program::list_reasons(list.json);
  if (list.parser.parsed()) return program::list(list.keys);
  if (doctor.parser.parsed()) return program::doctor(program::merge(doctor.options), doctor.only, doctor.json);
  if (latency.parser.parsed()) return program::latency(program::merge(latency.options), latency.latency);
  if (validate.parser.parsed()) {
    return validate.schema ? program::print_schema() : program::validate(program::merge(validate.options));
  }
  if (compare.parsed()) {
    refuse_run_options(parser, "compare");
    return program::compare(compare_options);
  }
  if (watch.parsed()) {
    refuse_run_options(parser, "watch");
    return program::watch(watch_options);
  }
  if (commission.parser.parsed()) return program::commission(program::merge(commission.options), commission.pulses);
  if (send.parser.parsed()) return program::send(program::merge(send.options), send.send);
  for (const cli::Parser& python : python_programs) {
    if (python.parsed()) return parser.refuse("give the name of a program in Python first, its options after it");
  }
  if (replay_command.parser.parsed()) return program::replay_run(replay_command);
  if (convert_command.parser.parsed()) return program::convert(convert_command);
  program::RunRequest request = program::merge(options);
  request.command_line.assign(argv, argv + argc);
  return request.script->series.given ? program::run_series(options, request) : program::run(request);
}

int fail(int status, const std::exception& error) {
  fprintf(stderr, "abs_hil: %s\n", error.what());
  return status;
}

}  // namespace

int program::run_program(int argc, char** argv, std::span<const control::ControllerEntry> own) {
  if (const std::optional<int> status = program::start_python_program(argc, argv)) return *status;
  program::survive_closed_terminals();
  // Messages go to stderr; stdout carries results.
  spdlog::set_default_logger(spdlog::stderr_color_mt("abs_hil"));
  spdlog::set_pattern("%n: %^%l%$: %v");
  try {
    for (const control::ControllerEntry& entry : own) control::register_controller(entry);
    return dispatch(argc, argv);
  } catch (const config::ConfigError& error) {
    return fail(program::exit_usage, error);
  } catch (const std::invalid_argument& error) {
    return fail(program::exit_usage, error);
  } catch (const driver::Unavailable& error) {
    return fail(program::exit_unavailable, error);
  } catch (const telemetry::LcmError& error) {
    return fail(program::exit_unavailable, error);
  } catch (const std::exception& error) {
    return fail(program::exit_ended_early, error);
  }
}

}  // namespace abs_hil
