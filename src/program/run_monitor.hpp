#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "guardian/guard.hpp"
#include "guardian/guardian_lease.hpp"
#include "guardian/shared_region.hpp"
#include "program/subcommands.hpp"
#include "run/run.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::program {

/// What messages and flight record say of the run.
[[nodiscard]] telemetry::ExperimentInfo experiment_info(const config::Configuration& configuration,
                                                        rig::RunNames names);
/// The launch configuration of the run's guardian, as JSON.
[[nodiscard]] std::string guardian_launch_json(const config::Configuration& configuration,
                                               const std::filesystem::path& record_prefix,
                                               const std::vector<std::string>& signals = {});

/// The guardian of the recorder's owner: the lease's if there is one, else a new one in `own`.
[[nodiscard]] guardian::Guard& started_guardian(guardian::GuardianLease* lease,
                                                std::optional<guardian::GuardianProcess>& own,
                                                guardian::SharedRecorder& recorder, const std::string& launch_json);

/// Monitors a run: it keeps the flight record of every run, and starts the guardian for a run in real time on a board.
class RunMonitor {
 public:
  /// @param lease  guards the run if there is one, and must outlive this object; null: a guardian of the run's own does
  /// @param record_prefix  path and first part of the names of files that are written after a fault; empty: none
  /// `request` must outlive this object. Throws config::ConfigError if no shared memory can be had.
  RunMonitor(const RunRequest& request, guardian::GuardianLease* lease, std::filesystem::path record_prefix,
             rig::RunNames names = {});

  /// Ends the guardian unless `end` did: it uses this object's memory.
  ~RunMonitor();

  /// Attaches the monitor to the run, which must be over before this object is destroyed.
  void attach(run::Run& run);
  [[nodiscard]] bool has_guardian() const noexcept { return guardian_ != nullptr; }
  /// Called every few milliseconds. Returns the stop reason if the guardian died, else `none`.
  [[nodiscard]] rig::Reason poll();
  /// After a fault: writes the flight record and logs its path.
  void write_record(const RunRequest& request, rig::Reason reason, double value, const std::string& account);
  /// Ends the guardian after the run's files are written, and logs an error if it did not end cleanly.
  void end();

 private:
  rig::RunNames names_;
  std::filesystem::path record_prefix_;
  guardian::SharedRecorder recorder_;
  std::optional<guardian::GuardianProcess> own_guardian_;
  guardian::Guard* guardian_{nullptr};
  std::optional<guardian::Pages> pages_;  ///< of a run without a guardian
  std::optional<runtime::Heartbeat> heartbeat_;
  bool resident_;
  const RunRequest& request_;
  bool told_notes_{false};
};

/// The place of a run's flight record: the folder of --recorder, else the run folder, else that which a named file's
/// path has, else (for a board, or with a named file) the state folder, or the one for temporary files where that
/// cannot be written. Creates it. Throws config::ConfigError for --recorder.
/// @param run_folder  empty: none
[[nodiscard]] std::filesystem::path flight_record_prefix(const RunRequest& request,
                                                         const std::filesystem::path& run_folder);

}  // namespace abs_hil::program
