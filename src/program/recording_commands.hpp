#pragma once

#include <optional>
#include <string>
#include <vector>

#include "cli/command_line.hpp"

namespace abs_hil::program {

/// Options of `abs_hil replay` as typed.
struct ReplayCommand {
  std::string recording{};
  std::optional<std::string> controller{};
  std::vector<std::string> assignments{};
  bool check{false};
  std::optional<std::string> csv_file{};
  cli::Parser parser{};
};
void add_replay(cli::Parser& parser, ReplayCommand& command);
/// Returns the exit status: with --check 0 if all commands are bit-equal and 1 if not; 2 for a file that is no
/// recording, is damaged, or is incomplete.
int replay_run(const ReplayCommand& command);

/// Options of `abs_hil convert` as typed.
struct ConvertCommand {
  std::string from{};
  std::string to{};
  cli::Parser parser{};
};
void add_convert(cli::Parser& parser, ConvertCommand& command);
int convert(const ConvertCommand& command);

}  // namespace abs_hil::program
