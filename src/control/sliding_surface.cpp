#include "control/sliding_surface.hpp"

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

namespace abs_hil::control {

SlidingSurface::SlidingSurface(const ControllerContext& context, const SwitchingAdaptationOptions& adaptation)
    : wheels_{context.rig.wheels}, tyre_{context.rig.tyre}, equivalent_{context}, theta_{adaptation} {}

void SlidingSurface::reset(const SlipInput& input) noexcept {
  theta_.reset();
  slip_ = input.slip;
  switching_ = 0.0;
  excess_ = 0.0;
}

void SlidingSurface::take_over(const SlidingSurface& before) noexcept {
  theta_.take_over(before.theta_);
  slip_ = before.slip_;
  past_phi_ = before.past_phi_;
  switching_ = before.switching_;
  excess_ = before.excess_;
}

double SlidingSurface::observe(const SlipInput& input) noexcept {
  past_phi_ = rig::normalised_tyre_force(tyre_, 0.5 * (slip_ + input.slip));
  slip_ = input.slip;
  excess_ = input.unsent_torque_Nm;
  // theta_hat changes by -phi s, and the torque by phi times this change.
  if (!winds_up(-switching_)) {
    theta_.update(input.dt_s, slip_velocity_gain(wheels_, input.slip_ref) * past_phi_, switching_);
  }
  return slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref);
}

SlipOutput SlidingSurface::drive(const SlipInput& input, double error_m_s, const WantedMotion& wanted,
                                 double switching) noexcept {
  const double torque_Nm = equivalent_.brake_torque_Nm(input, error_m_s, wanted, theta_.theta_N(), past_phi_);
  switching_ = switching;
  // A torque outside the actuator's range will not be sent, and a limit that held in the past cycle may still hold.
  if (torque_Nm > input.max_brake_torque_Nm || torque_Nm < 0.0) excess_ = torque_Nm;
  return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = theta_.theta_N()};
}

}  // namespace abs_hil::control
