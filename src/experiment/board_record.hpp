#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "driver/factory.hpp"

namespace abs_hil::experiment {

/// What the commissioning has measured of a board's outputs.
struct OutputTimes {
  bool reported{false};                 ///< the board reports its outputs; otherwise nothing was measured
  std::optional<double> watchdog_ms{};  ///< the board ended its outputs by itself so long after the last command
  double watched_ms{0.0};               ///< if it did not: how long it held them
  std::optional<double> release_ms{};   ///< from the order of the safe state until it was verified
};

/// The record of a board that has gone through `abs_hil commission`. Without a matching record nothing drives hardware.
struct BoardRecord {
  std::string kind{};  ///< driver.kind
  driver::BoardIdentity board{};
  bool emulated{false};                          ///< the record of an emulator, which no hardware matches
  std::map<std::string, std::string> options{};  ///< "driver.pci.lower_sign" -> "1": those that a commissioning tests
  int encoder_counts_per_rev{0};
  OutputTimes outputs{};
  std::string date{};
  std::string version{};  ///< of the program
};

/// The record that the present options and board would get, without measurements, date and version.
[[nodiscard]] BoardRecord describe_board(const driver::DriverOptions& options, const driver::BoardIdentity& board,
                                         bool emulated);

/// Why a record does not hold for the present board and options, as text; empty if it holds. A record holds for lower
/// duty caps.
[[nodiscard]] std::string difference(const BoardRecord& record, const BoardRecord& present);

/// The folders in which records are looked for, in this order: the configured one alone, otherwise
/// /var/lib/abs_hil/boards and the user's own ($XDG_STATE_HOME/abs_hil/boards).
[[nodiscard]] std::vector<std::filesystem::path> record_folders(const std::string& configured);

/// Writes the record into the first folder that takes it, in one step: a reader sees the whole record or none. Returns
/// its path. Throws driver::Unavailable.
std::filesystem::path write_record(const BoardRecord& record, const std::vector<std::filesystem::path>& folders);

/// Throws driver::Unavailable, with the command to type, unless there is a record that holds for this board.
void require_record(const driver::DriverOptions& options, const driver::BoardIdentity& board);

/// `abs_hil commission` with the options of `driver.` that differ from their defaults.
[[nodiscard]] std::string commission_command(const driver::DriverOptions& options);

}  // namespace abs_hil::experiment
