// Makes the adaptive laws from their options and refuses options out of range; the signals of the first.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"
#include "control/adaptive_actuator_controller.hpp"
#include "control/adaptive_controller.hpp"
#include "control/adaptive_gains.hpp"
#include "control/seeking_controllers.hpp"

namespace abs_hil::control {

namespace {

/// Copies this law's gains to the options of AdaptiveLaw, whose parts it shares.
ControlOptions with_own_gains(const ControlOptions& options) {
  const AdaptiveActuatorOptions& own = options.adaptive_actuator;
  rig::require_valid(own, &AdaptiveActuatorOptions::lag_gain_per_s, "control.adaptive_actuator.");
  rig::require_valid(own, &AdaptiveActuatorOptions::lag_weight_s2, "control.adaptive_actuator.");
  ControlOptions result = options;
  result.adaptive = own.law;
  return result;
}

/// Gains that follow from the dead time.
ControlOptions with_predicted_gains(ControlOptions options, const rig::BrakeParameters& brake) {
  constexpr double observed_s = 0.016;
  const PredictedGains most = predicted_gains(std::max(observed_s, brake.brake_dead_time_s));
  options.adaptive_actuator.law.ks1 = most.slip_most_per_s;
  options.adaptive_actuator.law.ks0 = 0.25 * most.slip_most_per_s * most.slip_most_per_s;
  options.adaptive_actuator.lag_gain_per_s = most.torque_most_per_s;
  return options;
}

const BrakingStiffnessOptions<>& checked(const BrakingStiffnessOptions<>& o) {
  rig::require_valid(o, "control.braking_stiffness.");
  if (!(o.slip_min <= o.slip_start && o.slip_start <= o.slip_max)) {
    throw std::invalid_argument("control.braking_stiffness.slip_start must be in [slip_min, slip_max]");
  }
  return o;
}

}  // namespace

template <class S>
AdaptiveLaw<S>::AdaptiveLaw(const ControllerContext& context)
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      theta_model_N_{context.rig.tyre.theta_N},
      dynamics_{context},
      gains_{paper_gains(context.options.adaptive)},
      weights_{paper_weights(context.options.adaptive)},
      theta_{context.options.adaptive, context.rig.wheels} {}

template <class S>
void AdaptiveLaw<S>::show(SlipOutput& output) const noexcept {
  using Laws = paper::Laws<double>;
  const double I = integral_.value_m();
  const double error_m_s = output.slip_velocity_error_m_s;
  const double theta_err_N = theta_model_N_ - theta_.theta_N();
  output.signals = {I, theta_.omega1_hat_rad_s(omega1_rad_s_), theta_.zeta_N(),
                    Laws::V(gains_, weights_, I, error_m_s, theta_err_N),
                    Laws::V_dot(gains_, weights_, I, error_m_s, past_phi_, theta_err_N)};
}

template class AdaptiveLaw<double>;

template <class S>
AdaptiveActuatorLaw<S>::AdaptiveActuatorLaw(const ControllerContext& context)
    : laws_{paper::laws(context.rig.wheels)},
      tyre_{context.rig.tyre},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      predictor_{context.rig, context.options.v_min_m_s},
      lag_decay_per_s_{std::expm1(-context.options.adaptive_actuator.lag_gain_per_s / context.options.rate_Hz) *
                       context.options.rate_Hz},
      lag_weight_{context.options.adaptive_actuator.lag_weight_s2},
      v_min_m_s_{context.options.v_min_m_s},
      period_s_{1.0 / context.options.rate_Hz},
      dynamics_{{with_own_gains(context.options), context.rig}},
      gains_{paper_gains(context.options.adaptive_actuator.law)},
      theta_{context.options.adaptive_actuator.law, context.rig.wheels},
      wheels_observer_{context.options.adaptive_actuator.observer, context.rig, context.options.rate_Hz} {}

template class AdaptiveActuatorLaw<double>;

template <class S>
AdaptivePredictorLaw<S>::AdaptivePredictorLaw(const ControllerContext& context)
    : AdaptiveActuatorLaw<S>{{with_predicted_gains(context.options, context.rig.brake), context.rig}} {}

template class AdaptivePredictorLaw<double>;

template <class S>
AdaptivePeakLaw<S>::AdaptivePeakLaw(const ControllerContext& context)
    : laws_{paper::laws(context.rig.wheels)},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s},
      period_s_{1.0 / context.options.rate_Hz},
      options_{with_sound_slips(context.options.adaptive_peak, "control.adaptive_peak.")} {
  const auto& o = options_;
  gains_.ks0 = o.ks0;
  gains_.ks1 = o.ks1;
  lag_decay_ = rig::exponential_less_one(-o.lag_gain_per_s * period_s_);
  observer_ = {o.observer, context.rig, context.options.rate_Hz};
  peak_ = {o.peak, o.slip_min, o.slip_max, context.options.rate_Hz};
}

template class AdaptivePeakLaw<double>;

template <class S>
BrakingStiffnessLaw<S>::BrakingStiffnessLaw(const ControllerContext& context)
    : laws_{paper::laws(context.rig.wheels)},
      brake_{context.rig.brake},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s},
      options_{checked(context.options.braking_stiffness)} {
  const auto& o = options_;
  torque_decay_ = rig::exponential_less_one(-o.lag_gain_per_s * (1.0 / context.options.rate_Hz));
  observer_ = {o.observer, context.rig, context.options.rate_Hz};
  stiffness_ = {o.memory_s, o.slip_noise};
}

template class BrakingStiffnessLaw<double>;

}  // namespace abs_hil::control
