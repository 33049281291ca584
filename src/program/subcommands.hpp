#pragma once

#include <optional>
#include <string>
#include <vector>

#include "experiment/commissioning.hpp"
#include "experiment/run_session.hpp"
#include "program/command_line.hpp"
#include "watch/watch_session.hpp"

namespace abs_hil::program {

/// Runs an experiment and returns the exit status. Throws what the parts throw: see main.cpp.
int run(const RunRequest& request);
/// Runs the series of `base.script`, each run merged anew from the options as typed, and returns the exit status.
/// Throws as `run`.
int run_series(const RunOptions& options, const RunRequest& base);
/// `abs_hil compare`: controllers side by side in simulation. Throws config::ConfigError and std::invalid_argument.
int compare(const CompareOptions& options);
/// `abs_hil list`: controllers, plants, experiments and backends, or all configuration keys.
int list(bool keys);
/// `abs_hil list --quantities`: the table of rig/quantities.hpp, as text or JSON.
int list_quantities(bool json);
/// `abs_hil list --reasons`: the table of rig/reason.hpp, as text or JSON.
int list_reasons(bool json);
/// `abs_hil validate`: says in words what an experiment does and whether it stays within the limits of its backend.
int validate(const RunRequest& request);
/// `abs_hil validate --schema`: the JSON Schema of experiment files.
int print_schema();
/// `abs_hil doctor`: examines this computer, all of it or the one check named, and says how to mend what falls short.
int doctor(const RunRequest& request, const std::string& only, bool json);
/// What `abs_hil latency` takes beside a run's configuration.
struct LatencyOptions {
  double duration_s{10.0};
  std::optional<int> second_offset_us{};  ///< begin at a whole second plus this
  bool json{false};
};
/// `abs_hil latency`: runs the real cycle on the simulated rig for a while and judges how well this computer keeps
/// time.
int latency(const RunRequest& request, const LatencyOptions& options);
/// `abs_hil watch`: a running experiment in this terminal. Throws what watch::watch throws.
int watch(const watch::WatchOptions& options);
/// `abs_hil commission`: first steps with a rig, each asked for. Throws driver::Unavailable.
int commission(const RunRequest& request, const experiment::CommissioningOptions& options);

/// What `abs_hil send` takes.
struct SendOptions {
  std::vector<std::string> order{};  ///< "stop", "start", "slip-ref X", "gain NAME X"
  double timeout_s{3.0};
};
/// `abs_hil send`: a command to a running abs_hil; waits for its answer. Throws config::ConfigError, LcmError.
int send(const RunRequest& request, const SendOptions& options);

/// The exit status of a run that has ended so.
[[nodiscard]] int status_of(const experiment::RunOutcome& outcome);
/// Why a run that requires real time did not start.
[[nodiscard]] std::string realtime_refusal(const runtime::RealtimeReport& report);

}  // namespace abs_hil::program
