#include "abs_hil/program/program.hpp"

#include <poll.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "cli/command_line.hpp"
#include "config/config_error.hpp"
#include "config/config_json.hpp"
#include "interchange/foreign_controller.hpp"
#include "program/compare_command.hpp"
#include "program/exit_status.hpp"
#include "program/export_fmu.hpp"
#include "program/inspection_commands.hpp"
#include "program/live_commands.hpp"
#include "program/python_programs.hpp"
#include "program/recording_commands.hpp"
#include "program/run_arguments.hpp"
#include "program/safe.hpp"
#include "program/signals.hpp"
#include "program/study_command.hpp"
#include "program/subcommands.hpp"
#include "run_folder/clean_text.hpp"
#include "runtime/early_end.hpp"
#include "telemetry/lcm_outlet.hpp"

namespace abs_hil {

namespace {

/// Refuses run options before a subcommand that would ignore them.
void refuse_run_options(const cli::Parser& parser, const std::string& command) {
  for (const std::string& option : parser.given()) {
    throw config::ConfigError(
        fmt::format("{}: give the options of `abs_hil {}` after the word {}", option, command, command));
  }
}

int dispatch(int argc, char** argv) {
  cli::Parser parser("abs_hil", "Driver, adaptive slip controller and simulator of the Inteco ABS laboratory rig");
  parser.set_version(ABS_HIL_VERSION);
  program::RunOptions options;
  program::add_run_options(parser, options);
  program::ListCommand list;
  program::add_list(parser, list);
  program::DoctorCommand doctor;
  program::add_doctor(parser, doctor);
  program::LatencyCommand latency;
  program::add_latency(parser, latency);
  program::CompareOptions compare_options;
  const cli::Parser compare = program::add_compare(parser, compare_options);
  program::StudyCommand study;
  program::add_study(parser, study);
  program::ValidateCommand validate;
  program::add_validate(parser, validate);
  program::CommissionCommand commission;
  program::add_commission(parser, commission);
  program::InitRigCommand init_rig;
  program::add_init_rig(parser, init_rig);
  program::SafeCommand safe;
  program::add_safe(parser, safe);
  program::ReplayCommand replay_command;
  program::add_replay(parser, replay_command);
  program::ConvertCommand convert_command;
  program::add_convert(parser, convert_command);
  program::ExportFmuCommand export_command;
  program::add_export_fmu(parser, export_command);
  watch::WatchOptions watch_options;
  const cli::Parser watch = program::add_watch(parser, watch_options);
  program::SendCommand send;
  program::add_send(parser, send);
  // Only for the help: these words are looked for before the command line is read.
  std::vector<cli::Parser> python_programs;
  for (const program::PythonProgram& python : program::python_programs) {
    python_programs.push_back(parser.add_subcommand(std::string(python.name), std::string(python.help)));
  }
  if (const std::optional<int> status = parser.parse(argc, argv)) return *status;
  if (list.json && !list.quantities && !list.reasons && !list.keys) {
    return parser.refuse("--json requires --keys, --quantities or --reasons");
  }
  if (list.quantities) return program::list_quantities(list.json);
  if (list.reasons) return program::list_reasons(list.json);
  if (list.parser.parsed()) return program::list(list.keys, list.json);
  if (doctor.parser.parsed()) return program::doctor(program::merge(doctor.options), doctor.only, doctor.json);
  if (latency.parser.parsed()) return program::latency(program::merge(latency.options), latency.latency);
  if (validate.parser.parsed()) {
    return validate.schema ? program::print_schema() : program::validate(validate.options);
  }
  if (compare.parsed()) {
    refuse_run_options(parser, "compare");
    return program::compare(compare_options, {argv, argv + argc});
  }
  if (study.parser.parsed()) {
    refuse_run_options(parser, "study");
    return program::study(study, {argv, argv + argc});
  }
  if (watch.parsed()) {
    refuse_run_options(parser, "watch");
    return program::watch(watch_options);
  }
  if (commission.parser.parsed()) return program::commission(program::merge(commission.options), commission.pulses);
  if (safe.parser.parsed()) return program::make_boards_safe(safe);
  if (send.parser.parsed()) return program::send(program::merge(send.options), send.send);
  if (init_rig.parser.parsed()) return program::init_rig(program::merge(init_rig.options), init_rig.name);
  for (const cli::Parser& python : python_programs) {
    if (python.parsed()) return parser.refuse("give the name of a program in Python first, its options after it");
  }
  if (replay_command.parser.parsed()) return program::replay_run(replay_command);
  if (convert_command.parser.parsed()) return program::convert(convert_command);
  if (export_command.parser.parsed()) return program::export_fmu(export_command);
  program::RunRequest request = program::merge(options);
  request.command_line.assign(argv, argv + argc);
  return request.script->series.given ? program::run_series(options, request) : program::run(request);
}

int fail(int status, const std::exception& error) {
  fprintf(stderr, "abs_hil: %s\n", error.what());
  return status;
}

/// Results that did not reach standard output are lost data. A reader or a terminal that has gone wanted no more.
int with_stdout(int status) {
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return status;
  const int why = errno;
  pollfd output{STDOUT_FILENO, POLLOUT, 0};
  if (::poll(&output, 1, 0) > 0 && (output.revents & (POLLERR | POLLHUP)) != 0) return status;
  fprintf(stderr, "abs_hil: cannot write to standard output%s%s\n", why != 0 ? ": " : "",
          why != 0 ? std::strerror(why) : "");
  return status == program::exit_completed ? program::exit_ended_early : status;
}

/// The command line is part of a run's record. A path that is no text would fail there, after the run.
void refuse_odd_bytes(int argc, char** argv) {
  for (int n = 1; n < argc; ++n) {
    if (config::is_utf8(argv[n])) continue;
    throw config::ConfigError(fmt::format("argument {} (\"{}\") is not UTF-8 text; give names and paths in UTF-8", n,
                                          run_folder::clean_text(argv[n])));
  }
}

/// The program with its errors as exit statuses.
int checked(int argc, char** argv, std::span<const control::ControllerEntry> own) {
  try {
    refuse_odd_bytes(argc, argv);
    for (const control::ControllerEntry& entry : own) control::register_controller(entry);
    interchange::register_foreign_controllers();
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

}  // namespace

int program::run_program(int argc, char** argv, std::span<const control::ControllerEntry> own,
                         std::span<const driver::Backend> boards) {
  program::survive_closed_terminals();
  try {
    for (const driver::Backend& board : boards) driver::register_backend(board);
    if (const std::optional<int> status = program::safe_at_once(argc, argv)) return with_stdout(*status);
  } catch (const std::exception& error) {
    return fail(program::exit_ended_early, error);
  }
  if (const std::optional<int> status = program::start_python_program(argc, argv)) return *status;
  const runtime::EarlyEndWatch end_by_own_decision;
  // Messages go to stderr; stdout carries results.
  spdlog::set_default_logger(spdlog::stderr_color_mt("abs_hil"));
  spdlog::set_pattern("%n: %^%l%$: %v");
  return with_stdout(checked(argc, argv, own));
}

}  // namespace abs_hil
