#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "experiment/run_session.hpp"
#include "guardian/guardian_process.hpp"
#include "guardian/shared_region.hpp"
#include "program/command_line.hpp"

namespace abs_hil::program {

/// Whether a run needs a guardian: in real time on a board. In simulation and in virtual time nothing real moves.
[[nodiscard]] bool wants_guardian(const RunRequest& request);

/// What the guardian of a run is told, as JSON.
[[nodiscard]] std::string guardian_brief(const RunRequest& request, const std::filesystem::path& record_prefix);

/// Who watches over a run: the flight recorder always, the guardian beside a run in real time on a board.
class RunMonitor {
 public:
  /// @param record_prefix  path and beginning of the names of what is written after a fault; empty: nothing is
  /// Throws config::ConfigError if no shared memory can be had.
  RunMonitor(const RunRequest& request, std::filesystem::path record_prefix);

  /// Lets the session be watched. It must not run after this object is gone.
  void watch(experiment::RunSession& session);
  [[nodiscard]] bool has_guardian() const noexcept { return guardian_.has_value(); }
  /// Called every few milliseconds: the stop that is due because the guardian died, `none` otherwise.
  [[nodiscard]] rig::Reason poll();
  /// After a fault: writes the flight record and says where.
  void write_record(const RunRequest& request, rig::Reason reason, double value, const std::string& account);
  /// The run is over and its files are written: dismisses the guardian, and says so if that was not in order.
  void end();

 private:
  std::filesystem::path record_prefix_;
  guardian::SharedRegion region_;
  std::optional<guardian::GuardianProcess> guardian_;
  runtime::Heartbeat cycle_watch_;
  bool told_notes_{false};
};

/// Where a run's flight record goes: --recorder, else the run's folder, else beside the files named, else (for a board)
/// here. Makes the folder of --recorder. Throws config::ConfigError.
/// @param run_folder  empty: none
[[nodiscard]] std::filesystem::path flight_record_prefix(const RunRequest& request,
                                                         const std::filesystem::path& run_folder);

}  // namespace abs_hil::program
