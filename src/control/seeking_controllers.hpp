// Laws that seek the slip of the peak of friction with a small sine on the slip reference: by an estimate of the tyre's
// curve, and by the growth of the measured tyre force with the slip.
#pragma once

#include <array>

#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/control/slip_error_dynamics.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "control/classic_controllers.hpp"
#include "control/law_controller.hpp"
#include "control/slip_error_integral.hpp"
#include "control/slip_peak_estimator.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// Brakes at the slip of the largest tyre force. It needs neither theta, B and C nor a slip reference
/// (docs/theory-beyond.md). WheelForceObserver estimates speeds and tyre force from encoders and brake.
/// SlipPeakEstimator estimates the peak from slip and force. The slip loop follows this peak plus a small sinusoidal
/// search. The loop is (16) with the observed force in place of theta phi. It compensates the brake's lag as
/// AdaptiveActuatorLaw does. It does not use `rig.tyre`. theta_est_N is the estimated peak force, and slip_ref is the
/// controller's own reference.
template <class S>
class AdaptivePeakLaw {
 public:
  static constexpr bool estimates_theta = true;

  AdaptivePeakLaw() = default;
  explicit AdaptivePeakLaw(const ControllerContext& context);

  void reset(const BasicSlipInput<S>& input) noexcept;
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept;

 private:
  /// The slip reference now, and its rate.
  struct Reference {
    S slip;
    S rate_per_s;
  };

  void learn(const S& dt_s, const S& slip) noexcept;
  [[nodiscard]] Reference next_reference(const S& dt_s) noexcept;
  [[nodiscard]] S command_Nm(const BasicSlipInput<S>& input, const S& slip, const Reference& reference,
                             const S& error_m_s) const noexcept;

  paper::Laws<S> laws_{};
  paper::Gains<S> gains_{};
  BasicBrakeLag<S> lag_{};
  S v_min_m_s_{0.0};
  S period_s_{0.0};
  S lag_decay_{0.0};  ///< part of the torque error that decays in a period, negative
  AdaptivePeakOptions<S> options_{};
  BasicWheelForceObserver<S> observer_{};
  BasicSlipPeakEstimator<S> peak_{};
  BasicSlipErrorIntegral<S> integral_{};
  S centre_{0.0};            ///< of the search
  S search_angle_rad_{0.0};  ///< within [-pi, pi]
  /// Slip after two equal lags. Together they delay it as long as the force estimate is delayed.
  S half_late_slip_{0.0};
  S late_slip_{0.0};
};

template <class S>
void AdaptivePeakLaw<S>::reset(const BasicSlipInput<S>& input) noexcept {
  observer_.reset(input.speeds);
  peak_.reset();
  centre_ = options_.slip_start;
  integral_.reset(slip_velocity_error_m_s(laws_, input.speeds, centre_), centre_);
  search_angle_rad_ = S(0.0);
  half_late_slip_ = late_slip_ = S(0.0);
}

template <class S>
void AdaptivePeakLaw<S>::learn(const S& dt_s, const S& slip) noexcept {
  if (!rig::any(dt_s > 0.0)) return;
  const S covered = -rig::exponential_less_one(S(-2.0 * dt_s / observer_.force_delay_s()));
  half_late_slip_ += covered * (slip - half_late_slip_);
  late_slip_ += covered * (half_late_slip_ - late_slip_);
  peak_.update(dt_s, late_slip_, observer_.force_N());
}

template <class S>
typename AdaptivePeakLaw<S>::Reference AdaptivePeakLaw<S>::next_reference(const S& dt_s) noexcept {
  const S target = rig::clamped(peak_.peak_slip(), options_.slip_min, options_.slip_max);
  const S most = options_.slip_rate_per_s * dt_s;
  const S step = rig::clamped(S(target - centre_), S(-most), most);
  centre_ += step;
  search_angle_rad_ = within_half_turn_rad(S(search_angle_rad_ + options_.search_rad_s * dt_s));
  const S swing = rig::larger(S(options_.search_part * centre_), options_.search_min);
  return {.slip = centre_ + swing * rig::sine(search_angle_rad_),
          .rate_per_s = rig::select(dt_s > 0.0, S(step / dt_s), S(0.0)) +
                        swing * options_.search_rad_s * rig::cosine(search_angle_rad_)};
}

template <class S>
BasicSlipOutput<S> AdaptivePeakLaw<S>::step(const BasicSlipInput<S>& input) noexcept {
  observer_.update(input);
  const rig::BasicWheelSpeeds<S> speeds = observer_.speeds();
  const S v_x = laws_.r2 * speeds.omega2_rad_s;
  const S slip = rig::wheel_slip(S(laws_.r1 * speeds.omega1_rad_s), v_x, v_min_m_s_);
  learn(input.dt_s, slip);
  const Reference reference = next_reference(input.dt_s);

  const S error_m_s = slip_velocity_error_m_s(laws_, speeds, reference.slip);
  integral_.advance(input, error_m_s, reference.slip, v_x);
  return {.brake_torque_Nm = command_Nm(input, slip, reference, error_m_s),
          .slip_velocity_error_m_s = error_m_s,
          .theta_est_N = peak_.peak_force_N(),
          .slip_ref = reference.slip};
}

template <class S>
S AdaptivePeakLaw<S>::command_Nm(const BasicSlipInput<S>& input, const S& slip, const Reference& reference,
                                 const S& error_m_s) const noexcept {
  const rig::BasicWheelSpeeds<S> speeds = observer_.speeds();
  const S v_x = rig::larger(S(laws_.r2 * speeds.omega2_rad_s), v_min_m_s_);
  // The observed force replaces theta phi: theta is the force, and phi is 1.
  const paper::Reading<S> reading{
      .omega1 = speeds.omega1_rad_s, .omega2 = speeds.omega2_rad_s, .lambda_ref = reference.slip, .phi = S(1.0)};
  // The observed force is delayed. The curve gives its change with the slip since then.
  const S force_N = observer_.force_N() + peak_.force_N(slip) - peak_.force_N(late_slip_);
  const S reference_m_s2 = reference.rate_per_s * v_x;

  // e_v' = -ks0 I - ks1 e_v, as in (16), with a reference that moves and a brake that is off by the observed error.
  const S nu = paper::Laws<S>::nu(gains_, integral_.value_m(), error_m_s);
  const S wanted_Nm = laws_.T_b(laws_.xi_1(reading, nu, force_N) + reference_m_s2) - observer_.brake_error_Nm();
  const auto lags = rig::is_finite(input.max_brake_torque_Nm);
  if (!rig::any(lags)) return wanted_Nm;

  const WheelMotion<S> motion = wheel_motion(
      laws_, speeds, slip, reference.slip,
      {.tyre_force_N = force_N, .brake_torque_Nm = input.brake_torque_Nm + observer_.brake_error_Nm()}, v_min_m_s_);
  const S wanted_rate_Nm_s = laws_.T_b(paper::Laws<S>::nu(gains_, error_m_s, motion.error_rate_m_s2 - reference_m_s2) +
                                       laws_.k(reading) * peak_.force_slope_N(slip) * motion.slip_rate_per_s);
  const S catch_up_Nm = lag_decay_ * (input.brake_torque_Nm - wanted_Nm);
  return rig::select(lags, lag_.command_Nm(input.brake_torque_Nm, S(period_s_ * wanted_rate_Nm_s + catch_up_Nm)),
                     wanted_Nm);
}

/// Slope of the tyre force over the slip by least squares with fading memory: the extended braking stiffness. Where the
/// slip has hardly moved, the slope is that of a force proportional to the slip. Real-time safe.
template <class S>
class BasicBrakingStiffness {
 public:
  BasicBrakingStiffness() = default;
  /// @param memory_s  time constant of forgetting, > 0
  /// @param slip_noise  standard deviation of the slip that tells nothing
  BasicBrakingStiffness(const S& memory_s, const S& slip_noise) noexcept
      : memory_s_{memory_s}, slip_noise_{slip_noise} {}

  void reset() noexcept { slip_ = force_N_ = variance_ = covariance_N_ = S(0.0); }
  void learn(const S& dt_s, const S& slip, const S& force_N) noexcept;
  /// d ln F / d ln slip at the mean of late, in [-1, 1]: 1 far below the peak, 0 at it, negative past it.
  [[nodiscard]] S elasticity() const noexcept;

 private:
  S memory_s_{1.0};
  S slip_noise_{0.0};
  S slip_{0.0}, force_N_{0.0};  ///< means
  S variance_{0.0}, covariance_N_{0.0};
};
using BrakingStiffness = BasicBrakingStiffness<double>;

template <class S>
void BasicBrakingStiffness<S>::learn(const S& dt_s, const S& slip, const S& force_N) noexcept {
  const S share = -rig::exponential_less_one(S(-dt_s / memory_s_));
  const S slip_off = slip - slip_, force_off_N = force_N - force_N_;
  slip_ += share * slip_off;
  force_N_ += share * force_off_N;
  variance_ = (1.0 - share) * (variance_ + share * slip_off * slip_off);
  covariance_N_ = (1.0 - share) * (covariance_N_ + share * slip_off * force_off_N);
}

template <class S>
S BasicBrakingStiffness<S>::elasticity() const noexcept {
  constexpr double least_force_N = 1.0;
  constexpr double least_slip = 1e-3;
  const S slip = rig::larger(S(least_slip), slip_), force_N = rig::larger(S(least_force_N), force_N_);
  const S unknown = slip_noise_ * slip_noise_;
  const S slope_N = (covariance_N_ + unknown * force_N / slip) / (variance_ + unknown);
  return rig::clamped(S(slope_N * slip / force_N), S(-1.0), S(1.0));
}

/// Seeks the peak of the tyre force by the extended braking stiffness (Umeno, 2002; Hoang et al., 2014): the logarithm
/// of the wanted slip moves in proportion to the elasticity of the force less a small wanted one, with a small sine on
/// it. The loop feeds the observed force forward and steps back through the brake's lag. It knows nothing of the tyre.
/// theta_est_N is NaN, slip_ref its own reference.
template <class S>
class BrakingStiffnessLaw {
 public:
  static constexpr bool estimates_theta = false;

  BrakingStiffnessLaw() = default;
  explicit BrakingStiffnessLaw(const ControllerContext& context);

  void reset(const BasicSlipInput<S>& input) noexcept;
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept;
  static constexpr std::array<rig::Signal, 1> signals{
      {{"elasticity", "estimated relative growth of the tyre force per relative growth of the slip"}}};
  void show(BasicSlipOutput<S>& output) const noexcept { output.signals[0] = stiffness_.elasticity(); }

 private:
  void move_reference(const S& dt_s, const S& slip) noexcept;

  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
  BasicBrakeLag<S> lag_{};
  S torque_decay_{0.0};  ///< part of the torque error that decays in a period, negative
  S v_min_m_s_{0.0};
  BrakingStiffnessOptions<S> options_{};
  BasicWheelForceObserver<S> observer_{};
  BasicBrakingStiffness<S> stiffness_{};
  S late_slip_{0.0};  ///< as late as the observed force
  S reference_{0.0};  ///< without the sine
  S search_rad_{0.0};
};

template <class S>
void BrakingStiffnessLaw<S>::reset(const BasicSlipInput<S>& input) noexcept {
  observer_.reset(input.speeds);
  stiffness_.reset();
  late_slip_ = search_rad_ = S(0.0);
  reference_ = options_.slip_start;
}

template <class S>
void BrakingStiffnessLaw<S>::move_reference(const S& dt_s, const S& slip) noexcept {
  if (!rig::any(dt_s > 0.0)) return;
  late_slip_ += -rig::exponential_less_one(S(-dt_s / observer_.force_delay_s())) * (slip - late_slip_);
  stiffness_.learn(dt_s, late_slip_, observer_.force_N());
  const S rise = options_.rate_per_s * (stiffness_.elasticity() - options_.target) * dt_s;
  reference_ = rig::clamped(S(reference_ * rig::exponential(rise)), options_.slip_min, options_.slip_max);
  search_rad_ = within_half_turn_rad(S(search_rad_ + options_.search_rad_s * dt_s));
}

template <class S>
BasicSlipOutput<S> BrakingStiffnessLaw<S>::step(const BasicSlipInput<S>& input) noexcept {
  observer_.update(input);
  const rig::BasicWheelSpeeds<S> speeds = observer_.speeds();
  move_reference(input.dt_s,
                 rig::wheel_slip(S(laws_.r1 * speeds.omega1_rad_s), S(laws_.r2 * speeds.omega2_rad_s), v_min_m_s_));
  const S reference = reference_ * (1.0 + options_.search_part * rig::sine(search_rad_));
  const paper::Reading<S> now{
      .omega1 = speeds.omega1_rad_s, .omega2 = speeds.omega2_rad_s, .lambda_ref = reference, .phi = S(1.0)};
  const S error_m_s = laws_.e_v(now);
  const S force_N = rig::larger(S(0.0), observer_.force_N());
  const S wanted_Nm = rig::clamped(
      S(laws_.T_b(laws_.xi_1(now, S(-options_.slip_gain_per_s * error_m_s), force_N)) - observer_.brake_error_Nm()),
      S(0.0), full_torque_Nm(brake_, input.max_brake_torque_Nm));
  const S step_Nm = torque_decay_ * (input.brake_torque_Nm - wanted_Nm);
  const auto lags = rig::is_finite(input.max_brake_torque_Nm);
  return {.brake_torque_Nm = rig::select(lags, lag_.command_Nm(input.brake_torque_Nm, step_Nm), wanted_Nm),
          .slip_velocity_error_m_s = error_m_s,
          .theta_est_N = rig::unknown,
          .slip_ref = reference};
}

}  // namespace abs_hil::control
