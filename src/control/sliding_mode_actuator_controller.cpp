#include "control/sliding_mode_actuator_controller.hpp"

#include <cmath>

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "control/smooth_sliding_mode_controller.hpp"

namespace abs_hil::control {

SlidingModeActuatorController::SlidingModeActuatorController(const ControllerContext& context)
    : wheels_{context.rig.wheels},
      tyre_{context.rig.tyre},
      options_{context.options.sliding_mode_actuator},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      surface_{context, context.options.sliding_mode_actuator.adaptation},
      wheels_observer_{context.options.sliding_mode_actuator.observer, context.rig, context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s} {
  rig::require_valid(options_, "control.sliding_mode_actuator.");
}

void SlidingModeActuatorController::reset(const SlipInput& input) noexcept {
  surface_.reset(input);
  wheels_observer_.reset(input.speeds);
}

SlipInput SlidingModeActuatorController::observed(const SlipInput& input) const noexcept {
  SlipInput result = input;
  result.speeds = wheels_observer_.speeds();
  result.slip =
      rig::wheel_slip(wheels_.r1_m * result.speeds.omega1_rad_s, wheels_.r2_m * result.speeds.omega2_rad_s, v_min_m_s_);
  return result;
}

SlipOutput SlidingModeActuatorController::step(const SlipInput& raw) noexcept {
  const bool lags = std::isfinite(raw.max_brake_torque_Nm);
  if (lags) wheels_observer_.update(raw);
  const SlipInput input = lags ? observed(raw) : raw;
  const double error_m_s = surface_.observe(input);
  const WantedMotion wanted =
      boundary_layer_reference(error_m_s, options_.gain_m_s2, options_.boundary_m_s, surface_.period_s());
  const double switching = -wanted.mean_rate_m_s2 / options_.gain_m_s2;
  SlipOutput output = surface_.drive(input, error_m_s, wanted, switching);
  if (!lags) return output;

  const double period_s = surface_.period_s();
  const double arm = wheels_.J1_kg_m2 / wheels_.r1_m;
  const double eta = (input.brake_torque_Nm - output.brake_torque_Nm) / arm;
  // eta decays by exp(-lag_gain h) over the period; for h -> 0 the quotient becomes the gain.
  const double eta_rate = std::expm1(-options_.lag_gain_per_s * period_s) / period_s * eta;
  const double rate = reference_rate_m_s3(input, error_m_s, output.theta_est_N, switching) + eta_rate;
  output.brake_torque_Nm = lag_.command_Nm(input.brake_torque_Nm, period_s * arm * rate);
  return output;
}

/// (r1/J1) alpha' by the model at theta_hat.
double SlidingModeActuatorController::reference_rate_m_s3(const SlipInput& input, double error_m_s, double theta_N,
                                                          double switching) const noexcept {
  const double phi = rig::normalised_tyre_force(tyre_, input.slip);
  const double k = slip_velocity_gain(wheels_, input.slip_ref);
  const WheelMotion<double> motion =
      wheel_motion(paper::laws(wheels_), input.speeds, input.slip, input.slip_ref,
                   {.tyre_force_N = theta_N * phi, .brake_torque_Nm = input.brake_torque_Nm}, v_min_m_s_);
  const bool inside = std::abs(error_m_s) < options_.boundary_m_s;
  const double wanted_rate = inside ? -options_.gain_m_s2 / options_.boundary_m_s * motion.error_rate_m_s2 : 0.0;
  const double theta_rate_N_s = -options_.adaptation.gamma * k * phi * switching;
  return wanted_rate + k * phi * theta_rate_N_s +
         k * theta_N * rig::normalised_tyre_force_slope(tyre_, input.slip) * motion.slip_rate_per_s +
         motion.drift_rate_m_s3;
}

bool SlidingModeActuatorController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const SlidingModeActuatorController*>(&before);
  if (other == nullptr) return false;
  surface_.take_over(other->surface_);
  wheels_observer_.take_over(other->wheels_observer_);
  return true;
}

}  // namespace abs_hil::control
