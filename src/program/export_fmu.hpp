#pragma once

#include <string>

#include "cli/command_line.hpp"
#include "program/command_line.hpp"

namespace abs_hil::program {

/// Options of `abs_hil export-fmu` as typed.
struct ExportFmuCommand {
  RunOptions options{};  ///< plant, model, controller, configuration file and assignments
  int fmi{2};
  std::string out{};
  cli::Parser parser{};
};
void add_export_fmu(cli::Parser& parser, ExportFmuCommand& command);
/// Writes the simulated rig as an FMU, or, with --controller, that controller. Returns the exit status. Throws
/// config::ConfigError.
int export_fmu(const ExportFmuCommand& command);

}  // namespace abs_hil::program
