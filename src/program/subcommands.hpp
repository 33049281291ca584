#pragma once

#include <optional>
#include <string>
#include <vector>

#include "experiment/commissioning.hpp"
#include "program/command_line.hpp"
#include "run/run.hpp"
#include "watch/watch_session.hpp"

namespace abs_hil::program {

/// Runs an experiment and returns the exit status. Throws what its parts throw: see program.cpp.
int run(const RunRequest& request);
/// Runs the series of runs that `base.script` describes; each run is merged anew from the options as typed. Returns the
/// exit status. Throws as `run`.
int run_series(const RunOptions& options, const RunRequest& base);
/// `abs_hil compare`: compares controllers in simulation, or records one run of the comparison. Throws
/// config::ConfigError and std::invalid_argument.
int compare(const CompareOptions& options, const std::vector<std::string>& command_line);
/// `abs_hil list`: lists controllers, plants, experiments and backends, or all configuration keys.
int list(bool keys, bool json);
/// `abs_hil list --quantities`: prints the table of rig/quantities.hpp, as text or JSON.
int list_quantities(bool json);
/// `abs_hil list --reasons`: prints the table of rig/reason.hpp, as text or JSON.
int list_reasons(bool json);
/// `abs_hil init-rig NAME`: writes NAME.toml, a plant's file to fill in. Throws config::ConfigError for a bad name and
/// a file that exists.
int init_rig(const RunRequest& request, const std::string& name);
/// `abs_hil validate`: describes an experiment and checks it against the limits of its backend.
int validate(const RunOptions& options);
/// `abs_hil validate --schema`: the JSON Schema of experiment files.
int print_schema();
/// `abs_hil doctor`: runs all checks of this computer or the named one, and prints a fix for each shortcoming.
int doctor(const RunRequest& request, const std::string& only, bool json);
/// Options of `abs_hil latency` besides a run's configuration.
struct LatencyOptions {
  double duration_s{10.0};
  std::optional<int> second_offset_us{};  ///< offset of the first cycle from a whole second, us
  bool json{false};
};
/// `abs_hil latency`: runs the real-time cycle on the simulated rig and judges this computer's timing.
int latency(const RunRequest& request, const LatencyOptions& options);
/// `abs_hil watch`: shows a running experiment in this terminal. Throws what watch::watch throws.
int watch(const watch::WatchOptions& options);
/// `abs_hil commission`: first steps with a rig; asks before each step. Throws driver::Unavailable.
int commission(const RunRequest& request, const experiment::CommissioningOptions& options);

/// Options of `abs_hil send`.
struct SendOptions {
  std::vector<std::string> order{};  ///< "stop", "start", "continue", "slip-ref X", "gain NAME X"
  double timeout_s{3.0};
};
/// `abs_hil send`: sends a command to a running abs_hil and waits for its answer. Throws config::ConfigError, LcmError.
int send(const RunRequest& request, const SendOptions& options);

/// The exit status for the outcome of a run.
[[nodiscard]] int status_of(const run::RunOutcome& outcome);
/// The message for a run that requires real time and did not start.
[[nodiscard]] std::string realtime_refusal(const runtime::RealtimeReport& report);

}  // namespace abs_hil::program
