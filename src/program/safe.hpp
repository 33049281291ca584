// `abs_hil safe` as typed.
#pragma once

#include <optional>

#include "program/command_line.hpp"

namespace abs_hil::program {

constexpr double most_insist_s = 3600.0;

/// Options of `abs_hil safe` as typed.
struct SafeCommand {
  config::Sources sources{.backend = "rig"};  ///< only the configuration file and the assignments are used
  double insist_s{3.0};                       ///< how long it tries to verify
};

/// `abs_hil safe`: writes zeros to the configured board, or to every board found, before anything else; then ends the
/// runs that drive them, asks the resident service, verifies, and says what it saw and what to pull. Zeros go out all
/// the while. Nothing in it waits without a bound. Returns the exit status; if something hangs it ends the process.
int make_boards_safe(const SafeCommand& command);

/// The same for a command line that begins with `safe`, without the time that it takes to build the command lines of
/// all subcommands. Nothing for any other, for its help, and for a wrong one, after the boards have their zeros.
[[nodiscard]] std::optional<int> safe_at_once(int argc, char** argv);

}  // namespace abs_hil::program
