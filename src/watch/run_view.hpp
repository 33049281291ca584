#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "abs_hil/event_t.hpp"
#include "abs_hil/experiment_t.hpp"
#include "abs_hil/rig/phase.hpp"
#include "abs_hil/status_t.hpp"
#include "abs_hil/telemetry_t.hpp"

namespace abs_hil::watch {

/// The plotted values of one telemetry message. Speeds and slip are true values where known, else estimates. NaN: not
/// known.
struct Sample {
  std::int64_t received_ns{0};  ///< receiver's monotonic clock
  double time_s{0.0};           ///< run time
  double omega1_rad_s{0.0};
  double omega2_rad_s{0.0};
  double slip{0.0};
  double slip_ref{0.0};
  double theta_est_N{0.0};
  double theta_N{0.0};
  bool after_gap{false};  ///< messages just before this one were lost
};

/// A value of telemetry_t's `values`.
struct NamedValue {
  std::string name;
  double value{0.0};  ///< NaN: not known
};

/// The state of a run as far as received messages show it. Messages may be missing, and a new run may begin at any
/// time. `now_ns` is the receiver's monotonic clock at the arrival. Texts from the network are made printable.
class RunView {
 public:
  /// Keeps the samples of the last `window_s` seconds of run time, > 0.
  explicit RunView(double window_s) : window_s_(window_s) {}

  void take(const telemetry_t& message, std::int64_t now_ns);
  void take(const status_t& message, std::int64_t now_ns);
  void take(const event_t& message, std::int64_t now_ns);
  void take(const experiment_t& message, std::int64_t now_ns);
  /// Counts a packet that is no message of a known type.
  void note_malformed() noexcept { ++malformed_; }

  [[nodiscard]] double window_s() const noexcept { return window_s_; }
  [[nodiscard]] const std::deque<Sample>& samples() const noexcept { return samples_; }
  [[nodiscard]] const std::optional<telemetry_t>& telemetry() const noexcept { return telemetry_; }
  [[nodiscard]] const std::optional<status_t>& status() const noexcept { return status_; }
  [[nodiscard]] const std::optional<experiment_t>& experiment() const noexcept { return experiment_; }
  /// The latest values without a field of their own: mostly the controller's own signals.
  [[nodiscard]] std::vector<NamedValue> values() const;
  /// The experiment's own name of the phase, if it is of that kind; otherwise the kind's.
  [[nodiscard]] std::string name_of(rig::Phase kind) const;
  /// The newest first, at most `events_max`.
  [[nodiscard]] const std::deque<event_t>& events() const noexcept { return events_; }
  static constexpr std::size_t events_max = 20;

  /// Time since the last message of any kind, s; empty if none has arrived.
  [[nodiscard]] std::optional<double> silence_s(std::int64_t now_ns) const noexcept;
  /// Number of telemetry messages within the last second.
  [[nodiscard]] std::size_t messages_last_second(std::int64_t now_ns) const noexcept;
  /// Number of telemetry messages of this run that were sent but did not arrive.
  [[nodiscard]] std::int64_t lost() const noexcept { return lost_; }
  [[nodiscard]] std::int64_t malformed() const noexcept { return malformed_; }
  /// Number of runs seen, including the present one.
  [[nodiscard]] int runs() const noexcept { return runs_; }

 private:
  /// Returns false for a late message of this run. Begins a new run if the sequence has restarted.
  bool admit(std::int64_t sequence, std::int64_t& latest, std::int64_t now_ns);
  void begin_run() noexcept;

  double window_s_;
  std::deque<Sample> samples_;
  std::optional<telemetry_t> telemetry_;
  std::optional<status_t> status_;
  std::optional<experiment_t> experiment_;
  std::deque<event_t> events_;
  std::optional<std::int64_t> last_received_ns_;
  // Latest sequence number of each channel; -1: none in this run.
  std::int64_t telemetry_sequence_{-1};
  std::int64_t status_sequence_{-1};
  std::int64_t event_sequence_{-1};
  std::int64_t experiment_sequence_{-1};
  std::int64_t lost_{0};
  std::int64_t malformed_{0};
  int runs_{0};
};

}  // namespace abs_hil::watch
