// `abs_hil compare` as typed.
#pragma once

#include "cli/command_line.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

// Subcommand `compare`.

cli::Parser add_compare(cli::Parser& parser, CompareOptions& o);

}  // namespace abs_hil::program
