#pragma once

#include "cli/command_line.hpp"
#include "program/command_line.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

// Subcommands beside a rig or a running experiment: `commission`, `watch`, `send`.

/// Options of `abs_hil commission` as typed.
struct CommissionCommand {
  RunOptions options{.backend = "rig"};
  experiment::CommissioningOptions pulses{};
  cli::Parser parser{};
};

/// Options of `abs_hil send` as typed.
struct SendCommand {
  RunOptions options{};
  SendOptions send{};
  cli::Parser parser{};
};

void add_commission(cli::Parser& parser, CommissionCommand& command);
cli::Parser add_watch(cli::Parser& parser, watch::WatchOptions& o);
void add_send(cli::Parser& parser, SendCommand& command);

}  // namespace abs_hil::program
