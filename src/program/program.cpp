#include "abs_hil/program/program.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <exception>
#include <stdexcept>
#include <string>

#include "abs_hil/driver/io_result.hpp"
#include "config/config_error.hpp"
#include "diagnosis/doctor.hpp"
#include "program/exit_status.hpp"
#include "program/recording_commands.hpp"
#include "program/signals.hpp"
#include "program/subcommands.hpp"
#include "telemetry/file_error.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil {

namespace {

void add_backend_option(CLI::App& cli, program::RunOptions& o) {
  cli.add_option("--backend", o.backend, "sim or rig")->check(CLI::IsMember({"sim", "rig"}))->capture_default_str();
}

/// Adds options that belong to the configuration, not to a single run.
void add_configuration_options(CLI::App& cli, program::RunOptions& o) {
  cli.add_option("--config", o.config_file, "TOML file with any configuration values")->type_name("FILE");
  cli.add_option("--plant", o.plant, "simulated plant by name or TOML file")->type_name("NAME|FILE");
  cli.add_option("--model", o.model, "the controllers' model of the rig, by name or TOML file (default: the plant)")
      ->type_name("NAME|FILE");
  cli.add_option("--controller", o.controller, "slip controller")->type_name("NAME");
  cli.add_option("--set", o.assignments, "set any configuration value (abs_hil list --keys)")
      ->type_name("key=value")
      ->take_all()
      ->allow_extra_args(false);
}

void add_timing_options(CLI::App& cli, program::RunOptions& o) {
  cli.add_option("--rate", o.rate_Hz, "control cycles per second, 100 to 10000")->type_name("HZ");
  cli.add_option(
         "--rt", o.realtime,
         "real-time scheduling: required, preferred or off (default: require on a real board, otherwise prefer)")
      ->check(CLI::IsMember({"require", "prefer", "off"}));
  cli.add_option("--histogram", o.outputs.histogram_file, "write latency histograms in cyclictest's format")
      ->type_name("FILE");
}

void add_run_options(CLI::App& cli, program::RunOptions& o) {
  add_backend_option(cli, o);
  add_configuration_options(cli, o);
  cli.add_option("--experiment", o.experiment, "experiment by name or TOML file")->type_name("NAME|FILE");
  cli.add_option("--slip-ref", o.slip_ref, "slip reference, in (0, 1)")->type_name("X");
  add_timing_options(cli, o);
  cli.add_flag("--wait-for-start", o.wait_for_start,
               "wait for `abs_hil send start` before the first phase (needs commands.enabled)");
  cli.add_flag("--fast", o.outputs.fast, "run in virtual time, as fast as the computer can");
  cli.add_option("--seed", o.seed, "seed of all random numbers in the simulator")->type_name("N");
  cli.add_option("--inject", o.injections,
                 "inject a fault, given as PHASE@SIGNAL:KIND[=PARAMETER][+DELAY][~DURATION], for example "
                 "brake@encoder_upper:stuck+0.2s; simulator and emulators only")
      ->type_name("FAULT")
      ->take_all()
      ->allow_extra_args(false);
  cli.add_option("--csv", o.outputs.csv_file, "write every cycle to a CSV file")->type_name("FILE");
  cli.add_option("--log", o.outputs.log_file, "write an LCM event log (.lcmlog)")->type_name("FILE");
  cli.add_option("--summary", o.outputs.summary_file, "write the summary as JSON")->type_name("FILE");
  cli.add_option("--recorder", o.outputs.recorder_dir,
                 "folder for the flight record: the last 2 s of a run that ended by a fault")
      ->type_name("DIR");
  auto* out = cli.add_option("--out", o.outputs.run_folder,
                             "run folder for all of the run's files, new or empty (default: a new one below runs/)")
                  ->type_name("DIR");
  cli.add_flag("--no-out", o.outputs.no_run_folder, "write no run folder")->excludes(out);
  auto* url =
      cli.add_option("--lcm-url", o.outputs.lcm_url, "LCM network (default: LCM_DEFAULT_URL, else UDP multicast)");
  cli.add_flag("--no-lcm", o.outputs.no_lcm, "do not publish on LCM")->excludes(url);
}

/// Options of `abs_hil doctor` as typed.
struct DoctorCommand {
  program::RunOptions options{};
  std::string only{};
  bool json{false};
  CLI::App* parser{nullptr};
};

void add_doctor(CLI::App& cli, DoctorCommand& command) {
  command.parser = cli.add_subcommand("doctor", "check this computer and give a fix for each shortcoming");
  add_backend_option(*command.parser, command.options);
  add_configuration_options(*command.parser, command.options);
  command.parser->add_option("--only", command.only, "run only this check")
      ->check(CLI::IsMember(diagnosis::check_names()));
  command.parser->add_flag("--json", command.json, "print JSON instead of text");
}

/// Options of `abs_hil latency` as typed.
struct LatencyCommand {
  program::RunOptions options{};
  program::LatencyOptions latency{};
  CLI::App* parser{nullptr};
};

void add_latency(CLI::App& cli, LatencyCommand& command) {
  command.parser =
      cli.add_subcommand("latency", "run the real-time cycle on the simulated rig and judge this computer's timing");
  add_configuration_options(*command.parser, command.options);
  add_timing_options(*command.parser, command.options);
  command.parser->add_option("--duration", command.latency.duration_s, "duration of the test, s")
      ->type_name("S")
      ->capture_default_str();
  command.parser
      ->add_option("--secaligned", command.latency.second_offset_us,
                   "begin at a whole second plus this many us, like cyclictest's option of the same name")
      ->type_name("US")
      ->check(CLI::Range(0, 999'999));
  command.parser->add_flag("--json", command.latency.json, "print JSON instead of text");
}

CLI::App* add_compare(CLI::App& cli, program::CompareOptions& o) {
  auto* compare = cli.add_subcommand("compare", "compare controllers in simulation on the same varied plants");
  compare->add_option("--plant", o.run.plant, "plant by name or TOML file")->type_name("NAME|FILE");
  compare->add_option("--model", o.run.model, "every controller's model (default: the plant, before it varies)")
      ->type_name("NAME|FILE");
  compare->add_option("--controllers", o.controllers, "controllers; the first one is the baseline")
      ->type_name("A,B,...")
      ->delimiter(',')
      ->capture_default_str();
  compare->add_option("--repeat", o.repeat, "runs of each controller")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  compare->add_option("--seed", o.seed, "seed of the varied plants")->type_name("N")->capture_default_str();
  compare->add_option("--vary", o.vary, "what varies: parameters (wheels, brake, tyre), theta, radii, phase, or none")
      ->type_name("SPEC")
      ->default_str("parameters=0.1,theta=0.1,phase");
  compare->add_option("--config", o.run.config_file, "TOML file with any configuration values")->type_name("FILE");
  compare->add_option("--set", o.run.assignments, "set any configuration value (abs_hil list --keys)")
      ->type_name("key=value")
      ->take_all()
      ->allow_extra_args(false);
  compare
      ->add_option("--threads", o.threads, "number of threads, 0: one for each processor; does not change the results")
      ->type_name("N")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  compare->add_option("--json", o.json_file, "write the table as JSON")->type_name("FILE");
  compare->add_option("--csv", o.csv_file, "write the table as CSV")->type_name("FILE");
  compare->add_option("--markdown", o.markdown_file, "write the table as Markdown")->type_name("FILE");
  compare->add_option("--runs", o.runs_file, "write each run's results as CSV")->type_name("FILE");
  compare->footer("To compare runs that are already recorded, use abs_report RUN RUN.");
  return compare;
}

/// Refuses run options before a subcommand that would ignore them.
void refuse_run_options(const CLI::App& cli, const std::string& command) {
  for (const CLI::Option* option : cli.get_options()) {
    if (option->count() > 0) {
      throw config::ConfigError(
          fmt::format("{}: give the options of `abs_hil {}` after the word {}", option->get_name(), command, command));
    }
  }
}

/// Options of `abs_hil commission` as typed.
struct CommissionCommand {
  program::RunOptions options{.backend = "rig"};
  experiment::CommissioningOptions pulses{};
  CLI::App* parser{nullptr};
};

void add_commission(CLI::App& cli, CommissionCommand& command) {
  command.parser = cli.add_subcommand("commission", "first steps with a real rig; asks before each step");
  add_configuration_options(*command.parser, command.options);
  command.parser->add_option("--drive-duty", command.pulses.drive_duty, "duty of the drive pulse, in (0, 0.3]")
      ->capture_default_str();
  command.parser->add_option("--brake-duty", command.pulses.brake_duty, "duty of the brake pulse, in (0, 0.7]")
      ->capture_default_str();
}

CLI::App* add_watch(CLI::App& cli, watch::WatchOptions& o) {
  auto* watch = cli.add_subcommand("watch", "show a running experiment in this terminal, over LCM; q quits");
  watch->add_option("--lcm-url", o.url, "LCM network (default: LCM_DEFAULT_URL, else UDP multicast)");
  watch->add_option("--prefix", o.prefix, "prefix of the channel names: the run's telemetry.channel_prefix")
      ->capture_default_str();
  watch->add_option("--window", o.window_s, "width of the plots, 1 to 60 s")->type_name("S")->capture_default_str();
  watch->add_flag("--ascii", o.ascii, "use ASCII only, for a terminal that shows braille badly");
  auto* plain = watch->add_flag("--plain", o.plain,
                                "print one line per second instead of a screen; always so without a terminal");
  auto* once = watch->add_flag("--once", o.once, "print one screen as text; exit status 3 if no message arrives")
                   ->excludes(plain);
  watch->add_option("--timeout", o.once_timeout_s, "longest wait of --once for messages, s")
      ->type_name("S")
      ->capture_default_str()
      ->needs(once);
  return watch;
}

/// Options of `abs_hil send` as typed.
struct SendCommand {
  program::RunOptions options{};
  program::SendOptions send{};
  CLI::App* parser{nullptr};
};

void add_send(CLI::App& cli, SendCommand& command) {
  command.parser = cli.add_subcommand("send", "send a command to a running abs_hil over LCM");
  command.parser->add_option("order", command.send.order, "stop | start | slip-ref X | gain NAME X")
      ->required()
      ->expected(1, 3);
  command.parser->add_option("--config", command.options.config_file, "TOML file with commands.key_file")
      ->type_name("FILE");
  command.parser->add_option("--set", command.options.assignments, "set any configuration value")
      ->type_name("key=value")
      ->take_all()
      ->allow_extra_args(false);
  command.parser->add_option("--lcm-url", command.options.outputs.lcm_url, "LCM network");
  command.parser->add_option("--timeout", command.send.timeout_s, "longest wait for the answer, s")
      ->type_name("S")
      ->check(CLI::Range(0.1, 60.0))
      ->capture_default_str();
}

/// Options of `abs_hil validate` as typed.
struct ValidateCommand {
  program::RunOptions options{};
  bool schema{false};
  CLI::App* parser{nullptr};
};

void add_validate(CLI::App& cli, ValidateCommand& command) {
  command.parser = cli.add_subcommand("validate", "describe an experiment and check it against the limits");
  command.parser->add_option("EXPERIMENT", command.options.experiment, "experiment by name or TOML file")
      ->type_name("NAME|FILE");
  command.parser->add_flag("--schema", command.schema, "print the JSON Schema of experiment files instead");
  add_backend_option(*command.parser, command.options);
  add_configuration_options(*command.parser, command.options);
}

int dispatch(int argc, char** argv) {
  CLI::App cli{"Driver, adaptive slip controller and simulator of the Inteco ABS laboratory rig"};
  cli.name("abs_hil");
  cli.set_version_flag("--version", ABS_HIL_VERSION);
  program::RunOptions options;
  add_run_options(cli, options);
  cli.require_subcommand(0, 1);
  auto* list = cli.add_subcommand("list", "list controllers, plants, experiments and backends");
  bool keys = false, quantities = false, reasons = false, list_json = false;
  auto* list_keys = list->add_flag("--keys", keys, "list all configuration values with unit and range");
  auto* list_quantities =
      list->add_flag("--quantities", quantities, "list the quantities of a CSV row and of ABS_TELEMETRY");
  list->add_flag("--reasons", reasons, "list the reasons of phase changes, ends of runs and refused commands")
      ->excludes(list_keys)
      ->excludes(list_quantities);
  list_quantities->excludes(list_keys);
  list->add_flag("--json", list_json, "print quantities or reasons as JSON")->excludes(list_keys);
  DoctorCommand doctor;
  add_doctor(cli, doctor);
  LatencyCommand latency;
  add_latency(cli, latency);
  program::CompareOptions compare_options;
  const auto* compare = add_compare(cli, compare_options);
  ValidateCommand validate;
  add_validate(cli, validate);
  CommissionCommand commission;
  add_commission(cli, commission);
  program::ReplayCommand replay_command;
  program::add_replay(cli, replay_command);
  program::ConvertCommand convert_command;
  program::add_convert(cli, convert_command);
  watch::WatchOptions watch_options;
  const auto* watch = add_watch(cli, watch_options);
  SendCommand send;
  add_send(cli, send);
  try {
    cli.parse(argc, argv);
    if (list_json && !quantities && !reasons) throw CLI::RequiresError("--json", "--quantities or --reasons");
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return cli.exit(error);  // --help, --version
    const auto asked = cli.get_subcommands();
    const std::string command = asked.empty() ? "abs_hil" : "abs_hil " + asked.front()->get_name();
    fprintf(stderr, "abs_hil: %s (%s --help shows all options)\n", error.what(), command.c_str());
    return program::exit_usage;
  }
  if (quantities) return program::list_quantities(list_json);
  if (reasons) return program::list_reasons(list_json);
  if (list->parsed()) return program::list(keys);
  if (doctor.parser->parsed()) return program::doctor(program::merge(doctor.options), doctor.only, doctor.json);
  if (latency.parser->parsed()) return program::latency(program::merge(latency.options), latency.latency);
  if (validate.parser->parsed()) {
    return validate.schema ? program::print_schema() : program::validate(program::merge(validate.options));
  }
  if (compare->parsed()) {
    refuse_run_options(cli, "compare");
    return program::compare(compare_options);
  }
  if (watch->parsed()) {
    refuse_run_options(cli, "watch");
    return program::watch(watch_options);
  }
  if (commission.parser->parsed()) return program::commission(program::merge(commission.options), commission.pulses);
  if (send.parser->parsed()) return program::send(program::merge(send.options), send.send);
  if (replay_command.parser->parsed()) return program::replay_run(replay_command);
  if (convert_command.parser->parsed()) return program::convert(convert_command);
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
