#pragma once

#include <cmath>
#include <cstdint>
#include <type_traits>

#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/overrun_cause.hpp"
#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/reason.hpp"
#include "abs_hil/rig/signals.hpp"

namespace abs_hil::rig {

/// True values that only a simulator knows, for logs and metrics. Controllers must not read them. NaN on hardware.
struct PlantTruth {
  WheelSpeeds speeds{unknown, unknown};
  double slip{unknown};
  double brake_torque_Nm{unknown};  ///< torque that acts on the upper wheel
  double theta_N{unknown};          ///< peak tyre force theta of (10)
};

/// Results of the estimators and the controller for one measurement. NaN if the phase does not compute them.
struct ControlState {
  WheelSpeeds speeds_est{};
  double slip_est{0.0};
  double slip_ref{0.0};
  double slip_velocity_error_m_s{unknown};  ///< e_v of (13), from the estimates
  double brake_torque_ref_Nm{0.0};          ///< torque reference, after limiting and on the PWM's steps
  double brake_torque_est_Nm{0.0};          ///< torque estimated to act now, through (6)-(7)
  double theta_est_N{unknown};
  SignalValues signals{no_signals};  ///< the controller's own, see control::SlipController::signals
};

/// Durations within one cycle, ns. `wakeup_latency_ns` is the lateness of the wake-up against its tick.
struct CycleTiming {
  std::int64_t wakeup_latency_ns{0};
  std::int64_t read_ns{0};
  std::int64_t control_ns{0};
  std::int64_t write_ns{0};
  std::int64_t cycle_ns{0};          ///< wake-up to end of write
  std::int64_t record_ns{0};         ///< recording of the previous cycle, because that of this cycle has not ended yet
  std::uint32_t periods_skipped{0};  ///< ticks missed before this one
  OverrunCause overrun_cause{OverrunCause::none};  ///< why they were missed
};

/// The complete record of one cycle: the measurement of tick n and the command computed from it. The real-time thread
/// pushes it into the ring. CSV, LCM and metrics are derived from it. Trivially copyable.
struct CycleRecord {
  std::uint64_t sequence{0};  ///< counts cycles from 0; a gap is a dropped record
  std::int64_t stamp_ns{0};   ///< monotonic clock at the wake-up
  double time_s{0.0};         ///< since the start of the run
  Phase phase{Phase::idle};
  std::uint16_t phase_index{0};  ///< counts the phases of the experiment from 0; an early end keeps the last number
  Reason reason{Reason::none};   ///< why the phase began or the command was refused; none if nothing happened
  bool sample_valid{true};       ///< `measurement` is of this cycle; false: it is the latest one that could be used
  bool wheels_apart{false};      ///< the experiment says that the upper wheel is lifted off the lower one
  double reason_value{0.0};      ///< the value that caused it, in the SI unit of its quantity
  Measurement measurement{};
  double sample_time_s{0.0};  ///< when its counters were read, since the start of the run
  ControlState control{};
  Command command{};  ///< the command as the driver sent it
  PlantTruth truth{};
  CycleTiming timing{};
};
static_assert(std::is_trivially_copyable_v<CycleRecord>);

/// Speeds for metrics: the true speeds if the backend knows them, otherwise the estimates.
[[nodiscard]] inline WheelSpeeds best_speeds(const CycleRecord& record) noexcept {
  return std::isnan(record.truth.speeds.omega2_rad_s) ? record.control.speeds_est : record.truth.speeds;
}

/// Slip for metrics, as `best_speeds`.
[[nodiscard]] inline double best_slip(const CycleRecord& record) noexcept {
  return std::isnan(record.truth.slip) ? record.control.slip_est : record.truth.slip;
}

}  // namespace abs_hil::rig
