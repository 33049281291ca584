#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "replay/recorded_run.hpp"

namespace abs_hil::program {

/// Options of `abs_hil replay` as typed.
struct ReplayCommand {
  std::string recording{};
  replay::Changes changes{};
  bool check{false};
  std::optional<std::string> csv_file{};
  CLI::App* parser{nullptr};
};
void add_replay(CLI::App& cli, ReplayCommand& command);
/// Returns the exit status: with --check 0 if all commands are bit-equal and 1 if not; 2 for a file that is no
/// recording, is damaged, or is incomplete.
int replay_run(const ReplayCommand& command);

/// Options of `abs_hil convert` as typed.
struct ConvertCommand {
  std::string from{};
  std::string to{};
  CLI::App* parser{nullptr};
};
void add_convert(CLI::App& cli, ConvertCommand& command);
int convert(const ConvertCommand& command);

}  // namespace abs_hil::program
