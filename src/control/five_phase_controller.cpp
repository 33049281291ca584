#include "control/five_phase_controller.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "control/full_torque.hpp"
#include "control/standing_wheel.hpp"

namespace abs_hil::control {
namespace {

const FivePhaseOptions& checked(const FivePhaseOptions& o) {
  rig::require_valid(o, "control.five_phase.");
  if (!(o.release_below_m_s2 <= o.hold_below_m_s2)) {
    throw std::invalid_argument("control.five_phase.release_below_m_s2 must not be above hold_below_m_s2");
  }
  if (!(o.recover_above_m_s2 > o.release_below_m_s2)) {
    throw std::invalid_argument("control.five_phase.recover_above_m_s2 must be above release_below_m_s2");
  }
  if (!(o.reapply_below_m_s2 > o.hold_below_m_s2)) {
    throw std::invalid_argument("control.five_phase.reapply_below_m_s2 must be above hold_below_m_s2");
  }
  return o;
}

}  // namespace

FivePhaseController::FivePhaseController(const ControllerContext& context)
    : wheels_{context.rig.wheels},
      brake_{context.rig.brake},
      options_{checked(context.options.five_phase)},
      period_s_{1.0 / context.options.rate_Hz} {
  if (!(context.options.rate_Hz > 0.0)) throw std::invalid_argument("control.rate_Hz must be > 0 Hz");
}

void FivePhaseController::reset(const SlipInput&) noexcept {
  phase_ = BrakePhase::apply;
  in_phase_s_ = 0.0;
  at_zero_s_ = 0.0;
  accelerated_ = false;
  torque_Nm_ = 0.0;
}

BrakePhase FivePhaseController::next_phase(double acceleration_m_s2) const noexcept {
  const double a = acceleration_m_s2;
  const auto& o = options_;
  switch (phase_) {
    case BrakePhase::apply:
    case BrakePhase::reapply: return a < o.hold_below_m_s2 ? BrakePhase::hold : phase_;
    case BrakePhase::hold:
      if (a < o.release_below_m_s2) return BrakePhase::release;
      return a >= o.hold_below_m_s2 || in_phase_s_ >= o.hold_limit_s ? BrakePhase::reapply : phase_;
    case BrakePhase::release:
      return a > o.recover_above_m_s2 || at_zero_s_ >= o.recover_limit_s ? BrakePhase::recover : phase_;
    case BrakePhase::recover:
      if (a < o.hold_below_m_s2) return BrakePhase::hold;
      return (accelerated_ && a < o.reapply_below_m_s2) || in_phase_s_ >= o.recover_limit_s ? BrakePhase::reapply
                                                                                            : phase_;
  }
  return phase_;
}

double FivePhaseController::ramp_Nm_s() const noexcept {
  switch (phase_) {
    case BrakePhase::apply: return options_.apply_Nm_s;
    case BrakePhase::release: return -options_.release_Nm_s;
    case BrakePhase::reapply: return options_.reapply_Nm_s;
    case BrakePhase::hold:
    case BrakePhase::recover: return 0.0;
  }
  return 0.0;
}

SlipOutput FivePhaseController::step(const SlipInput& input) noexcept {
  const bool stands = input.speeds.omega1_rad_s < standing_rad_s;
  const double acceleration_m_s2 =
      stands ? -std::numeric_limits<double>::infinity() : wheels_.r1_m * input.alpha1_rad_s2;
  in_phase_s_ += input.dt_s;
  at_zero_s_ = torque_Nm_ > 0.0 ? 0.0 : at_zero_s_ + input.dt_s;
  accelerated_ = accelerated_ || acceleration_m_s2 > options_.reapply_below_m_s2;

  const BrakePhase next = next_phase(acceleration_m_s2);
  if (next != phase_) {
    phase_ = next;
    in_phase_s_ = 0.0;
    accelerated_ = acceleration_m_s2 > options_.reapply_below_m_s2;
  }
  // A ramp goes on from what was sent, not from what a limit held back.
  if (input.unsent_torque_Nm != 0.0) torque_Nm_ = input.sent_brake_torque_Nm;
  // The torque is held for the next period, so it gets the ramp's value at the period's end.
  const double step_s = input.dt_s > 0.0 ? input.dt_s : period_s_;
  torque_Nm_ = std::clamp(torque_Nm_ + ramp_Nm_s() * step_s, 0.0, full_torque_Nm(brake_, input.max_brake_torque_Nm));
  return {.brake_torque_Nm = torque_Nm_,
          .slip_velocity_error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref),
          .theta_est_N = rig::unknown};
}

bool FivePhaseController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const FivePhaseController*>(&before);
  if (other == nullptr) return false;
  phase_ = other->phase_;
  in_phase_s_ = other->in_phase_s_;
  at_zero_s_ = other->at_zero_s_;
  accelerated_ = other->accelerated_;
  torque_Nm_ = other->torque_Nm_;
  return true;
}

}  // namespace abs_hil::control
