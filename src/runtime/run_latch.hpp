#pragma once

// Why a run ends early: the one latch of a run. It is the command gate's; driver errors, the cycle's time, sequence and
// controller latch here, and sequence and gate ask here.

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

/// The first fault of a run, which stays, and the first request to stop. A fault counts more than a request, also one
/// that came before it. For the cycle's thread; real-time safe.
class RunLatch {
 public:
  /// Notes a fault or a request to stop; `none` changes nothing.
  void latch(rig::Reason reason, double value) noexcept {
    if (reason != rig::Reason::none) keep(reason, value);
  }
  [[nodiscard]] rig::Reason fault() const noexcept { return fault_; }
  [[nodiscard]] double fault_value() const noexcept { return fault_value_; }
  /// The first fault after which the brake must not hold `gate.fault_brake_duty`, also if another fault latched before.
  [[nodiscard]] rig::Reason brake_barred_by() const noexcept { return barring_; }
  [[nodiscard]] rig::Reason stop_request() const noexcept { return stop_; }

 private:
  void keep(rig::Reason reason, double value) noexcept;

  rig::Reason fault_{rig::Reason::none};
  double fault_value_{0.0};
  rig::Reason barring_{rig::Reason::none};
  rig::Reason stop_{rig::Reason::none};
};

}  // namespace abs_hil::runtime
