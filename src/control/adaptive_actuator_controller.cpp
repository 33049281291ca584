#include "control/adaptive_actuator_controller.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "control/adaptive_gains.hpp"
#include "control/standing_wheel.hpp"

namespace abs_hil::control {
namespace {

/// Copies this controller's gains to the options of AdaptiveController, whose parts it shares.
ControlOptions with_own_gains(const ControlOptions& options) {
  const AdaptiveActuatorOptions& own = options.adaptive_actuator;
  rig::require_valid(own, &AdaptiveActuatorOptions::lag_gain_per_s, "control.adaptive_actuator.");
  rig::require_valid(own, &AdaptiveActuatorOptions::lag_weight_s2, "control.adaptive_actuator.");
  ControlOptions result = options;
  result.adaptive = own.law;
  return result;
}

}  // namespace

AdaptiveActuatorController::AdaptiveActuatorController(const ControllerContext& context)
    : wheels_{context.rig.wheels},
      tyre_{context.rig.tyre},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      lag_gain_{context.options.adaptive_actuator.lag_gain_per_s},
      lag_weight_{context.options.adaptive_actuator.lag_weight_s2},
      v_min_m_s_{context.options.v_min_m_s},
      period_s_{1.0 / context.options.rate_Hz},
      dynamics_{{with_own_gains(context.options), context.rig}},
      gains_{paper_gains(context.options.adaptive_actuator.law)},
      theta_{context.options.adaptive_actuator.law, context.rig.wheels},
      wheels_observer_{context.options.adaptive_actuator.observer, context.rig, context.options.rate_Hz} {}

void AdaptiveActuatorController::reset(const SlipInput& input) noexcept {
  integral_.reset(slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref), input.slip_ref);
  theta_.reset();
  wheels_observer_.reset(input.speeds);
  omega1_rad_s_ = input.speeds.omega1_rad_s;
  slip_ = input.slip;
  tuning_ = 0.0;
}

SlipInput AdaptiveActuatorController::observed(const SlipInput& input) const noexcept {
  SlipInput result = input;
  result.speeds = wheels_observer_.speeds();
  const double v_x = wheels_.r2_m * result.speeds.omega2_rad_s;
  result.slip = rig::wheel_slip(wheels_.r1_m * result.speeds.omega1_rad_s, v_x, v_min_m_s_);
  return result;
}

SlipOutput AdaptiveActuatorController::step(const SlipInput& raw) noexcept {
  const bool lags = std::isfinite(raw.max_brake_torque_Nm);
  limited_ = lags && raw.unsent_torque_Nm != 0.0;
  if (lags) wheels_observer_.update(raw);
  const SlipInput input = lags ? observed(raw) : raw;
  const double error_m_s = slip_velocity_error_m_s(wheels_, input.speeds, input.slip_ref);
  integral_.advance(input, error_m_s, input.slip_ref, wheels_.r2_m * input.speeds.omega2_rad_s);
  const double past_phi = rig::normalised_tyre_force(tyre_, 0.5 * (slip_ + input.slip));
  adapt(input, past_phi);

  double torque_Nm =
      dynamics_.feedback_linearising_torque_Nm(input, integral_.value_m(), error_m_s, theta_.theta_N(), past_phi);
  if (lags) torque_Nm = through_lag(input, torque_Nm, error_m_s);
  return {.brake_torque_Nm = torque_Nm, .slip_velocity_error_m_s = error_m_s, .theta_est_N = theta_.theta_N()};
}

/// zeta' = -gamma phi ( k B'P [I; e_v] + lag_weight a eta ); 0 while the command is limited.
double AdaptiveActuatorController::zeta_rate_N_s(double slip_ref, double phi, double BtP_x) const noexcept {
  return limited_ ? 0.0 : -gains_.gamma * phi * (slip_velocity_gain(wheels_, slip_ref) * BtP_x + tuning_);
}

void AdaptiveActuatorController::adapt(const SlipInput& input, double past_phi) noexcept {
  const double BtP_x = paper::Laws<double>::BtP_x(gains_, integral_.mean_value_m(), integral_.mean_error_m_s());
  if (std::isfinite(input.max_brake_torque_Nm)) {
    if (turns(omega1_rad_s_) && turns(input.speeds.omega1_rad_s))
      theta_.update(ForceInterval{.dt_s = input.dt_s,
                                  .tyre_force_N = wheels_observer_.force_N(),
                                  .phi = past_phi,
                                  .zeta_rate_N_s = zeta_rate_N_s(input.slip_ref, past_phi, BtP_x)});
  } else {
    theta_.update(AdaptationInterval{.dt_s = input.dt_s,
                                     .omega1_before_rad_s = omega1_rad_s_,
                                     .omega1_after_rad_s = input.speeds.omega1_rad_s,
                                     .brake_torque_Nm = input.mean_brake_torque_Nm,
                                     .phi = past_phi,
                                     .zeta_rate_N_s = zeta_rate_N_s(input.slip_ref, past_phi, BtP_x)});
  }
  omega1_rad_s_ = input.speeds.omega1_rad_s;
  slip_ = input.slip;
}

/// (r1/J1) alpha' of (17) by the model at theta_hat. `zeta_rate` is the part of theta_hat' that is known now.
double AdaptiveActuatorController::wanted_rate_m_s3(const SlipInput& input, double error_m_s,
                                                    double zeta_rate) const noexcept {
  const double phi = rig::normalised_tyre_force(tyre_, input.slip);
  const double k = slip_velocity_gain(wheels_, input.slip_ref);
  const WheelMotion motion =
      wheel_motion(wheels_, input.speeds, input.slip, input.slip_ref,
                   {.tyre_force_N = theta_.theta_N() * phi, .brake_torque_Nm = input.brake_torque_Nm}, v_min_m_s_);
  return paper::Laws<double>::nu(gains_, error_m_s, motion.error_rate_m_s2) + k * phi * zeta_rate +
         k * theta_.theta_N() * rig::normalised_tyre_force_slope(tyre_, input.slip) * motion.slip_rate_per_s +
         motion.drift_rate_m_s3;
}

/// Effect on it of each newton of phi (theta - theta_hat), which the model does not know: the factor a of the header.
double AdaptiveActuatorController::wanted_rate_per_theta(const SlipInput& input) const noexcept {
  const auto& w = wheels_;
  const double k = slip_velocity_gain(w, input.slip_ref);
  const double phi = std::max(0.0, rig::normalised_tyre_force(tyre_, input.slip));
  const double v_x = std::max(w.r2_m * input.speeds.omega2_rad_s, v_min_m_s_);
  const double slip_rate = -slip_velocity_gain(w, input.slip) / v_x;
  const double upper = w.r1_m / w.J1_kg_m2;
  const double lower = w.r2_m / w.J2_kg_m2;
  const double drift_rate = -upper * upper * w.d1_Nms_rad - (1.0 - input.slip_ref) * lower * lower * w.d2_Nms_rad;
  return gains_.ks1 * k + k * phi * gains_.gamma * gains_.ka1 +
         k * theta_.theta_N() * rig::normalised_tyre_force_slope(tyre_, input.slip) * slip_rate + drift_rate;
}

double AdaptiveActuatorController::through_lag(const SlipInput& input, double wanted_Nm, double error_m_s) noexcept {
  const double arm = wheels_.J1_kg_m2 / wheels_.r1_m;
  const double eta = (input.brake_torque_Nm - wanted_Nm) / arm;
  const double BtP_x = paper::Laws<double>::BtP_x(gains_, integral_.value_m(), error_m_s);
  const double phi = std::max(0.0, rig::normalised_tyre_force(tyre_, input.slip));

  tuning_ = lag_weight_ * wanted_rate_per_theta(input) * eta;
  const double zeta_rate = zeta_rate_N_s(input.slip_ref, phi, BtP_x);
  // eta decays by exp(-lag_gain h) over the period; for h -> 0 the quotient becomes the gain.
  const double eta_rate = std::expm1(-lag_gain_ * period_s_) / period_s_ * eta - BtP_x / lag_weight_;
  const double torque_rate_Nm_s = arm * (wanted_rate_m_s3(input, error_m_s, zeta_rate) + eta_rate);
  return lag_.command_Nm(input.brake_torque_Nm, period_s_ * torque_rate_Nm_s);
}

bool AdaptiveActuatorController::take_over(const SlipController& before) noexcept {
  const auto* other = dynamic_cast<const AdaptiveActuatorController*>(&before);
  if (other == nullptr) return false;
  integral_ = other->integral_;
  theta_.take_over(other->theta_);
  wheels_observer_.take_over(other->wheels_observer_);
  omega1_rad_s_ = other->omega1_rad_s_;
  slip_ = other->slip_;
  tuning_ = other->tuning_;
  return true;
}

}  // namespace abs_hil::control
