#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "driver/factory.hpp"
#include "experiment/options.hpp"

namespace abs_hil::experiment {

/// What the commissioning has measured of a board's outputs.
struct OutputTimes {
  bool reported{false};                 ///< the board reports its outputs; otherwise nothing was measured
  std::optional<double> watchdog_ms{};  ///< the board ended its outputs by itself so long after the last command
  double watched_ms{0.0};               ///< if it did not: how long it held them
  std::optional<double> release_ms{};   ///< from the order of the safe state until it was verified
};

/// Counts that the wheels have moved by.
struct WheelCounts {
  std::int32_t upper{0};
  std::int32_t lower{0};
};

/// The record of a board that has gone through `abs_hil commission`. Without a matching record nothing drives hardware.
struct BoardRecord {
  std::string kind{};  ///< driver.kind
  driver::BoardIdentity board{};
  bool emulated{false};                          ///< the record of an emulator, which no hardware matches
  std::map<std::string, std::string> options{};  ///< "driver.pci.lower_sign" -> "1": those that a commissioning tests
  int encoder_counts_per_rev{0};
  /// "rig.theta_N" -> "23": the rig's identity.
  std::map<std::string, std::string> identity{};
  OutputTimes outputs{};
  WheelCounts one_turn{};  ///< of each wheel, by hand; 0: not measured
  std::string date{};
  std::string version{};  ///< of the program
};

/// The record that the present options and board would get, without measurements, date and version.
[[nodiscard]] BoardRecord describe_board(const driver::DriverOptions& options, const RigIdentity& identity,
                                         const driver::BoardIdentity& board, bool emulated);

/// Why a record does not hold for the present board and options, as text; empty if it holds. A record holds for lower
/// duty caps.
[[nodiscard]] std::string difference(const BoardRecord& record, const BoardRecord& present);

/// The user's folder for what outlives a run: $XDG_STATE_HOME/abs_hil, ~/.local/state/abs_hil, or without a home
/// /var/lib/abs_hil.
[[nodiscard]] std::filesystem::path state_folder();

/// The folders in which records are looked for, in this order: the configured one alone, otherwise
/// /var/lib/abs_hil/boards and the user's own ($XDG_STATE_HOME/abs_hil/boards).
[[nodiscard]] std::vector<std::filesystem::path> record_folders(const std::string& configured);

/// Writes the record into the first folder that takes it, in one step: a reader sees the whole record or none. Returns
/// its path. Throws driver::Unavailable.
std::filesystem::path write_record(const BoardRecord& record, const std::vector<std::filesystem::path>& folders);

/// Why no record holds; empty if one does. The first folder with a record of the board decides.
[[nodiscard]] std::string why_not_commissioned(const BoardRecord& present,
                                               const std::vector<std::filesystem::path>& folders);

/// Throws driver::Unavailable, with the command to type, unless a record holds.
void require_record(const driver::DriverOptions& options, const RigIdentity& identity,
                    const driver::BoardIdentity& board);

}  // namespace abs_hil::experiment
