#pragma once

#include <string>

#include "cli/command_line.hpp"
#include "program/command_line.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

// Subcommands that look and tell: `list`, `doctor`, `latency`, `validate`, and `init-rig`.

/// Options of `abs_hil list` as typed.
struct ListCommand {
  bool keys{false};
  bool quantities{false};
  bool reasons{false};
  bool json{false};
  cli::Parser parser{};
};

/// Options of `abs_hil doctor` as typed.
struct DoctorCommand {
  RunOptions options{};
  std::string only{};
  bool json{false};
  cli::Parser parser{};
};

/// Options of `abs_hil latency` as typed.
struct LatencyCommand {
  RunOptions options{};
  LatencyOptions latency{};
  cli::Parser parser{};
};

/// Options of `abs_hil validate` as typed.
struct ValidateCommand {
  RunOptions options{};
  bool schema{false};
  cli::Parser parser{};
};

/// Options of `abs_hil init-rig` as typed.
struct InitRigCommand {
  RunOptions options{};
  std::string name{};
  cli::Parser parser{};
};

void add_list(cli::Parser& parser, ListCommand& command);
void add_doctor(cli::Parser& parser, DoctorCommand& command);
void add_latency(cli::Parser& parser, LatencyCommand& command);
void add_validate(cli::Parser& parser, ValidateCommand& command);
void add_init_rig(cli::Parser& parser, InitRigCommand& command);

}  // namespace abs_hil::program
