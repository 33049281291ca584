#include "control/brake_actuator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "abs_hil/rig/brake_map.hpp"

namespace abs_hil::control {

namespace {
/// Time between two decisions in the gap: a period of the boards' PWMs at their default of 160 Hz, and far below the
/// time constant of the brake.
constexpr double gap_hold_s = 1.0 / 160.0;
}  // namespace

BrakeActuator::BrakeActuator(const rig::BrakeParameters& brake, bool ideal, double max_duty,
                             std::uint32_t duty_steps) noexcept
    : brake_{brake},
      ideal_{ideal},
      max_duty_{max_duty},
      duty_steps_{ideal ? 0 : duty_steps},
      max_torque_Nm_{ideal ? std::numeric_limits<double>::infinity()
                           : rig::brake_torque_at(brake, rig::duty_at_most(max_duty, duty_steps))},
      least_{},
      half_step_Nm_{duty_steps_ == 0 ? 0.0 : 0.5 * brake.b1_Nm / static_cast<double>(duty_steps_)} {
  if (ideal) return;
  least_.duty = rig::duty_at_least(brake.u0, duty_steps);
  least_.torque_Nm = rig::brake_torque_at(brake, least_.duty);
}

void BrakeActuator::reset() noexcept {
  target_Nm_ = 0.0;
  torque_Nm_ = 0.0;
  mean_torque_Nm_ = 0.0;
  was_in_gap_ = false;
}

void BrakeActuator::advance(double dt_s) noexcept {
  if (!(dt_s > 0.0)) return;
  if (ideal_) {
    mean_torque_Nm_ = target_Nm_;
    return;
  }
  // (6) at a constant duty: the distance to b(u) shrinks by exp(-c31 dt). The integral of the distance is its loss /
  // c31.
  const double covered = -std::expm1(-brake_.c31_per_s * dt_s);
  const double change_Nm = (target_Nm_ - torque_Nm_) * covered;
  const bool moves = covered > 0.0;  // not by a lag so long that the share vanishes
  mean_torque_Nm_ = moves ? target_Nm_ - change_Nm / (brake_.c31_per_s * dt_s) : torque_Nm_;
  torque_Nm_ += change_Nm;
}

void BrakeActuator::command(double duty, double torque_Nm) noexcept {
  target_Nm_ = static_torque_Nm(duty, torque_Nm);
  if (ideal_) torque_Nm_ = target_Nm_;
}

double BrakeActuator::static_torque_Nm(double duty, double torque_Nm) const noexcept {
  return ideal_ ? std::max(0.0, torque_Nm) : rig::brake_torque_at(brake_, duty);
}

double BrakeActuator::duty_for(double torque_Nm) const noexcept {
  return rig::brake_duty_for(brake_, torque_Nm, max_duty_, duty_steps_);
}

double BrakeActuator::limited(double torque_Nm) const noexcept { return nearest(torque_Nm).torque_Nm; }

BrakeActuator::Target BrakeActuator::nearest(double torque_Nm) const noexcept {
  const double duty = duty_for(torque_Nm);
  if (std::isnan(duty)) return {duty, duty};
  return {ideal_ ? std::max(0.0, torque_Nm) : rig::brake_torque_at(brake_, duty), duty};
}

bool BrakeActuator::in_gap(double torque_Nm) const noexcept {
  return torque_Nm > 0.0 && torque_Nm < least_.torque_Nm && least_.torque_Nm <= max_torque_Nm_;
}

BrakeActuator::Target BrakeActuator::next(double torque_Nm, double dt_s) noexcept {
  if (!in_gap(torque_Nm)) {
    was_in_gap_ = false;
    return nearest(torque_Nm);
  }
  const double most_Nms = least_.torque_Nm * gap_hold_s;
  owed_Nms_ = was_in_gap_ ? std::clamp(owed_Nms_ + (torque_Nm - end_.torque_Nm) * dt_s, -most_Nms, most_Nms) : 0.0;
  held_s_ += dt_s;
  constexpr double rounding_s = 1e-9;
  if (!was_in_gap_ || held_s_ + rounding_s >= gap_hold_s) {
    const double owed_then_Nms = owed_Nms_ + torque_Nm * gap_hold_s;
    end_ = owed_then_Nms >= 0.5 * most_Nms ? least_ : Target{};
    held_s_ = 0.0;
  }
  was_in_gap_ = true;
  return end_;
}

double BrakeActuator::unsent_Nm(double reference_Nm, double target_Nm, double sent_Nm) const noexcept {
  constexpr double rounding_Nm = 1e-9;
  const bool in_reach = reference_Nm >= 0.0 && reference_Nm <= max_torque_Nm_;
  const bool as_wanted = std::abs(target_Nm - sent_Nm) <= half_step_Nm_ + rounding_Nm;
  return in_reach && as_wanted ? 0.0 : reference_Nm - sent_Nm;
}

}  // namespace abs_hil::control
