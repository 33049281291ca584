#pragma once

#include "abs_hil/rig/reason.hpp"

namespace abs_hil::runtime {

/// True for the faults after which the brake may hold `gate.fault_brake_duty`: brake, board, driver, guardian and the
/// cycle's time are sound. False for all others, also for those that a later version adds. Real-time safe.
[[nodiscard]] constexpr bool brake_may_hold_after(rig::Reason fault) noexcept {
  using rig::Reason;
  switch (fault) {
    case Reason::phase_time_limit:
    case Reason::run_time_limit:
    case Reason::run_distance_limit:
    case Reason::overspeed:
    case Reason::command_not_finite:
    case Reason::estimate_not_finite:
    case Reason::consecutive_overruns:
    case Reason::encoder_upper_stuck:
    case Reason::encoder_lower_stuck:
    case Reason::encoder_upper_jumped:
    case Reason::encoder_lower_jumped:
    case Reason::encoder_upper_reversed:
    case Reason::encoder_lower_reversed:
    case Reason::encoders_lost:
    case Reason::encoders_disagree:
    case Reason::slip_implausible:
    case Reason::speed_rises_with_motor_off:
    case Reason::motor_no_response: return true;
    default: return false;
  }
}

}  // namespace abs_hil::runtime
