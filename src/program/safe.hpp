#pragma once

#include "cli/command_line.hpp"
#include "program/command_line.hpp"

namespace abs_hil::program {

/// Options of `abs_hil safe` as typed.
struct SafeCommand {
  RunOptions options{.backend = "rig"};  ///< only the configuration file and the assignments are used
  double insist_s{3.0};                  ///< how long it tries to verify
  cli::Parser parser{};
};

void add_safe(cli::Parser& parser, SafeCommand& command);

/// `abs_hil safe`: ends the runs that drive the configured board, or every board found, and writes and verifies zeros.
/// Prints what to pull if that fails. Returns the exit status. Throws config::ConfigError, driver::Unavailable.
int make_boards_safe(const SafeCommand& command);

}  // namespace abs_hil::program
