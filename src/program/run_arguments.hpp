#pragma once

#include "cli/command_line.hpp"
#include "program/command_line.hpp"

namespace abs_hil::program {

// The command line's options of a run, as rows. Subcommands take those that they understand.

/// --backend
void add_backend_option(cli::Parser& parser, config::Sources& o);
/// --config
void add_config_file(cli::Parser& parser, config::Sources& o);
/// --set
void add_assignments(cli::Parser& parser, config::Sources& o);
/// Those that belong to the configuration, not to a single run: --config, --plant, --model, --controller, --set.
void add_configuration_options(cli::Parser& parser, config::Sources& o);
/// --rate, --rt, --histogram
void add_timing_options(cli::Parser& parser, config::Sources& o, std::optional<std::string>& histogram_file);
/// All of a run's.
void add_run_options(cli::Parser& parser, RunOptions& o);

}  // namespace abs_hil::program
