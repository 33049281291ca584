// From a command line to what it asks for, and from errors to exit statuses.
#include "abs_hil/program/program.hpp"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "cli/command_line.hpp"
#include "config/config_error.hpp"
#include "config/key_table.hpp"
#include "program/extra.hpp"
#include "program/subcommands.hpp"
#include "rig/formatted_text.hpp"
#include "runtime/early_end.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/lcm_outlet.hpp"
#include "version/build_facts.hpp"

namespace abs_hil {

namespace {

/// `abs_hil` without a word starts nothing: who types it wants to know what there is. Nothing has moved.
int say_what_to_type() {
  fputs(
      "abs_hil: say what to run. These three first:\n"
      "  abs_hil --fast --no-lcm --out runs/a   the paper's braking on the simulated rig, in virtual time: 15 ms\n"
      "  abs_hil report runs/a                  a page with its figures: report.html\n"
      "  abs_hil --backend sim                  the same in real time; --backend rig drives a board\n"
      "`abs_hil list` has controllers, rigs and experiments, `abs_hil --help` every option and subcommand.\n",
      stderr);
  return program::exit_usage;
}

int dispatch(int argc, char** argv) {
  if (argc < 2) return say_what_to_type();
  const program::Words words(argv, argv + argc);
  cli::Parser parser("abs_hil", "Driver, adaptive slip controller and simulator of the Inteco ABS laboratory rig");
  parser.set_version(version::version_line("abs_hil"));
  for (const char* word : {"run", "simulate", "sim"}) {
    parser.explain(word, fmt::format("{} is no subcommand: `abs_hil` alone is a run. `abs_hil --fast` simulates one at "
                                     "once, `abs_hil --backend sim` in real time; `--backend rig` drives a board",
                                     word));
  }
  parser.explain("version", "version is no subcommand: abs_hil --version");
  program::RunOptions options;
  program::add_run_options(parser, options);
  struct Command {
    std::string_view name;
    cli::Parser parser;
    program::Action act;
  };
  std::vector<Command> commands;
  for (const program::Subcommand& row : program::subcommands()) {
    Command& command =
        commands.emplace_back(row.name, parser.add_subcommand(std::string(row.name), std::string(row.help)));
    // Building options takes time: only a subcommand that the line may name gets its own.
    const bool named = std::ranges::find(words, row.name) != words.end();
    if (row.add != nullptr && named) command.act = row.add(command.parser, words);
  }
  parser.set_footer("`abs_hil help SUBCOMMAND` shows a subcommand's options.");
  if (const std::optional<int> status = parser.parse(argc, argv)) return *status;
  for (const Command& command : commands) {
    if (!command.parser.parsed()) continue;
    for (const std::string& option : parser.given()) {
      throw config::ConfigError(
          fmt::format("{}: give the options of `abs_hil {}` after the word {}", option, command.name, command.name));
    }
    if (command.act) return command.act();
    return parser.refuse("give the name of a program in Python first, its options after it");
  }
  program::RunRequest request = program::merge(options);
  request.command_line = words;
  return request.script->series.given ? program::run_series(options, request) : program::run(request);
}

int fail(int status, const std::exception& error) {
  fprintf(stderr, "abs_hil: %s\n", error.what());
  return status;
}

/// The command line is part of a run's record. A path that is no text would fail there, after the run.
void refuse_odd_bytes(int argc, char** argv) {
  for (int n = 1; n < argc; ++n) {
    if (rig::is_utf8(argv[n])) continue;
    throw config::ConfigError(fmt::format("argument {} (\"{}\") is not UTF-8 text; give names and paths in UTF-8", n,
                                          rig::clean_text(argv[n])));
  }
}

/// The program with its errors as exit statuses.
int checked(int argc, char** argv, std::span<const control::ControllerEntry> own) {
  try {
    refuse_odd_bytes(argc, argv);
    for (const control::ControllerEntry& entry : own) control::register_controller(entry);
    for (const program::Extra* extra : program::extras()) {
      if (extra->begin != nullptr) extra->begin();
    }
    return dispatch(argc, argv);
  } catch (const config::ConfigError& error) {
    return fail(program::exit_usage, error);
  } catch (const std::invalid_argument& error) {
    return fail(program::exit_usage, error);
  } catch (const telemetry::RecordingError& error) {
    return fail(program::exit_usage, config::ConfigError(error.what()));  // on one line, whatever its file holds
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
  std::string help = "--help";
  std::vector<char*> asked(argv, argv + argc);
  if (argc > 1 && asked[1] == std::string_view("help")) {  // `abs_hil help X` is `abs_hil X --help`
    asked.erase(asked.begin() + 1);
    asked.insert(asked.end(), {help.data(), nullptr});
    argv = asked.data();
  }
  try {
    for (const driver::Backend& board : boards) driver::register_backend(board);
    if (const std::optional<int> status = program::safe_at_once(argc, argv))
      return cli::with_stdout("abs_hil", *status);
  } catch (const std::exception& error) {
    return fail(program::exit_ended_early, error);
  }
  if (const std::optional<int> status = program::start_python_program(argc, argv)) return *status;
  const runtime::EarlyEndWatch end_by_own_decision;
  // Messages go to stderr; stdout carries results.
  spdlog::set_default_logger(spdlog::stderr_color_mt("abs_hil"));
  // On a terminal a message takes the place of a line that shows progress; that is drawn again below it.
  spdlog::set_pattern(isatty(STDERR_FILENO) == 1 ? "\r\x1b[K%n: %^%l%$: %v" : "%n: %^%l%$: %v");
  return cli::with_stdout("abs_hil", checked(argc, argv, own));
}

}  // namespace abs_hil
