// The tyre force from the lower wheel. lower_wheel_force.hpp has the equations.
#include "control/lower_wheel_force.hpp"

#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {

LowerWheelForce::LowerWheelForce(const rig::WheelParameters& wheels, double bandwidth_rad_s) noexcept
    : wheels_{wheels}, bandwidth_rad_s_{bandwidth_rad_s} {}

void LowerWheelForce::reset(double omega2_rad_s) noexcept {
  lags_ = {};
  last_rad_s_ = omega2_rad_s;
  last_dt_s_ = covered_ = force_N_ = 0.0;
}

void LowerWheelForce::update(double dt_s, double travel_rad, double omega2_rad_s) noexcept {
  if (dt_s != last_dt_s_) covered_ = -rig::exponential_less_one(-bandwidth_rad_s_ * dt_s);
  const double friction_Nm = wheels_.d2_Nms_rad * omega2_rad_s + wheels_.M20_Nm;
  const bool first = !(last_dt_s_ > 0.0);
  // Before the first interval the wheel ran out without tyre force.
  if (first) last_rad_s_ += 0.5 * dt_s * friction_Nm / wheels_.J2_kg_m2;
  // Mean speeds are those of the middle of their intervals.
  const double apart_s = first ? dt_s : 0.5 * (last_dt_s_ + dt_s);
  const double rad_s = travel_rad / dt_s;
  const double alpha_rad_s2 = (rad_s - last_rad_s_) / apart_s;
  force_N_ = lags_(covered_, -(wheels_.J2_kg_m2 * alpha_rad_s2 + friction_Nm) / wheels_.r2_m);
  last_rad_s_ = rad_s;
  last_dt_s_ = dt_s;
}

void DelayedSpeeds::Delay::reset(double speed) noexcept {
  lags.lag.fill(speed);
  last = speed;
}

double DelayedSpeeds::Delay::operator()(double covered, double speed) noexcept {
  // The mean speed of an interval is the mean of its ends, so two intervals make the 1, 2, 1 of ForceDelay.
  const double mean = 0.5 * (speed + last);
  last = speed;
  return lags(covered, mean);
}

void DelayedSpeeds::reset(const rig::WheelSpeeds& speeds) noexcept {
  upper_.reset(speeds.omega1_rad_s);
  lower_.reset(speeds.omega2_rad_s);
  speeds_ = speeds;
}

void DelayedSpeeds::update(double covered, double dt_s, double upper_travel_rad, double lower_travel_rad) noexcept {
  speeds_ = {.omega1_rad_s = upper_(covered, upper_travel_rad / dt_s),
             .omega2_rad_s = lower_(covered, lower_travel_rad / dt_s)};
}

}  // namespace abs_hil::control
