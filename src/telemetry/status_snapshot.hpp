#pragma once

#include <cstdint>
#include <functional>

#include "abs_hil/rig/measurement.hpp"
#include "rig/timing_summary.hpp"

namespace abs_hil::telemetry {

/// Data from the owner of the run for ABS_STATUS and the status line. All counts are since the start.
struct StatusSnapshot {
  std::uint64_t cycles{0};
  std::uint64_t telemetry_drops{0};     ///< records that found the ring full
  std::uint64_t gate_interventions{0};  ///< commands that the gate limited, blocked or refused
  double checks_unjudged{
      rig::unknown};     ///< share of the time in which the gate's checks could not judge; NaN: not known
  bool realtime{false};  ///< real-time scheduling and locked memory are in force
  rig::TimingSummary timing{};
};

/// Called from the telemetry thread, at most ten times a second. Empty: counts are 0 and durations NaN.
using StatusSource = std::function<StatusSnapshot()>;

}  // namespace abs_hil::telemetry
