#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cli/command_line.hpp"
#include "program/command_line.hpp"
#include "run/run.hpp"

namespace abs_hil::program {

/// A command line as typed.
using Words = std::vector<std::string>;
/// What a subcommand does after the command line is read. Returns the exit status. Throws what program.cpp catches.
using Action = std::function<int()>;

/// One row of the table of subcommands (subcommands.cpp). `abs_hil --help`, the shell's completion and the search for
/// the nearest name are made from it.
struct Subcommand {
  std::string_view name;
  std::string_view help;
  /// Adds the options to the subcommand's parser. Null: `abs_hil NAME` starts abs_NAME, a program in Python.
  Action (*add)(cli::Parser& parser, const Words& words){nullptr};
};
[[nodiscard]] std::span<const Subcommand> subcommands() noexcept;

/// If the first argument names a program in Python, it takes this process over with the other arguments. Returns the
/// exit status if that fails, after a message that says what to install; nothing for any other first argument.
[[nodiscard]] std::optional<int> start_python_program(int argc, char** argv);

Action add_list(cli::Parser& parser, const Words& words);
Action add_doctor(cli::Parser& parser, const Words& words);
Action add_latency(cli::Parser& parser, const Words& words);
Action add_compare(cli::Parser& parser, const Words& words);
Action add_study(cli::Parser& parser, const Words& words);
Action add_validate(cli::Parser& parser, const Words& words);
Action add_commission(cli::Parser& parser, const Words& words);
Action add_init_rig(cli::Parser& parser, const Words& words);
Action add_safe(cli::Parser& parser, const Words& words);
Action add_replay(cli::Parser& parser, const Words& words);
Action add_convert(cli::Parser& parser, const Words& words);
Action add_send(cli::Parser& parser, const Words& words);

/// Runs an experiment and returns the exit status. Throws what its parts throw: see program.cpp.
int run(const RunRequest& request);
/// Runs the series of runs that `base.script` describes; each run is merged anew from the options as typed. Returns the
/// exit status. Throws as `run`.
int run_series(const RunOptions& options, const RunRequest& base);

/// The exit status for the outcome of a run.
[[nodiscard]] int status_of(const run::RunOutcome& outcome);
/// The message for a run that requires real time and did not start.
[[nodiscard]] std::string realtime_refusal(const runtime::RealtimeReport& report);

}  // namespace abs_hil::program
