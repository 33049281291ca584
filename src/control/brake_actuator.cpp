#include "control/brake_actuator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "abs_hil/rig/brake_map.hpp"

namespace abs_hil::control {

BrakeActuator::BrakeActuator(const rig::BrakeParameters& brake, bool ideal, double max_duty) noexcept
    : brake_{brake},
      ideal_{ideal},
      max_duty_{max_duty},
      max_torque_Nm_{ideal ? std::numeric_limits<double>::infinity() : rig::brake_torque_at(brake, max_duty)} {}

void BrakeActuator::reset() noexcept {
  target_Nm_ = 0.0;
  torque_Nm_ = 0.0;
  mean_torque_Nm_ = 0.0;
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
  mean_torque_Nm_ = target_Nm_ - change_Nm / (brake_.c31_per_s * dt_s);
  torque_Nm_ += change_Nm;
}

void BrakeActuator::command(double duty, double torque_Nm) noexcept {
  if (ideal_) {
    target_Nm_ = std::max(0.0, torque_Nm);
    torque_Nm_ = target_Nm_;
  } else {
    target_Nm_ = rig::brake_torque_at(brake_, duty);
  }
}

double BrakeActuator::duty_for(double torque_Nm) const noexcept {
  return rig::brake_duty_for(brake_, torque_Nm, max_duty_);
}

double BrakeActuator::limited(double torque_Nm) const noexcept {
  if (ideal_) return std::max(0.0, torque_Nm);
  return rig::brake_torque_at(brake_, duty_for(torque_Nm));
}

}  // namespace abs_hil::control
