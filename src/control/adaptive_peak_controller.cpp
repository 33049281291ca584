#include "control/adaptive_peak_controller.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/tyre_curve.hpp"

namespace abs_hil::control {
namespace {

const AdaptivePeakOptions& checked(const AdaptivePeakOptions& o) {
  rig::require_valid(o, "control.adaptive_peak.");
  if (!(o.slip_min < o.slip_max))
    throw std::invalid_argument("control.adaptive_peak.slip_min must be below control.adaptive_peak.slip_max");
  if (!(o.slip_start >= o.slip_min && o.slip_start <= o.slip_max)) {
    throw std::invalid_argument("control.adaptive_peak.slip_start must be in [slip_min, slip_max]");
  }
  return o;
}

}  // namespace

AdaptivePeakController::AdaptivePeakController(const ControllerContext& context)
    : options_{checked(context.options.adaptive_peak)},
      wheels_{context.rig.wheels},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s},
      period_s_{1.0 / context.options.rate_Hz},
      observer_{options_.observer, context.rig, context.options.rate_Hz},
      peak_{options_.peak, options_.slip_min, options_.slip_max, context.options.rate_Hz} {}

void AdaptivePeakController::reset(const SlipInput& input) noexcept {
  observer_.reset(input.speeds);
  peak_.reset();
  centre_ = options_.slip_start;
  integral_.reset(slip_velocity_error_m_s(wheels_, input.speeds, centre_), centre_);
  time_s_ = 0.0;
  half_late_slip_ = late_slip_ = 0.0;
}

void AdaptivePeakController::learn(double dt_s, double slip) noexcept {
  if (!(dt_s > 0.0)) return;
  const double covered = -std::expm1(-2.0 * dt_s / observer_.force_delay_s());
  half_late_slip_ += covered * (slip - half_late_slip_);
  late_slip_ += covered * (half_late_slip_ - late_slip_);
  peak_.update(dt_s, late_slip_, observer_.force_N());
}

AdaptivePeakController::Reference AdaptivePeakController::next_reference(double dt_s) noexcept {
  const double target = std::clamp(peak_.peak_slip(), options_.slip_min, options_.slip_max);
  const double most = options_.slip_rate_per_s * dt_s;
  const double step = std::clamp(target - centre_, -most, most);
  centre_ += step;
  time_s_ += dt_s;
  const double swing = std::max(options_.search_part * centre_, options_.search_min);
  const double angle = options_.search_rad_s * time_s_;
  return {.slip = centre_ + swing * std::sin(angle),
          .rate_per_s = (dt_s > 0.0 ? step / dt_s : 0.0) + swing * options_.search_rad_s * std::cos(angle)};
}

SlipOutput AdaptivePeakController::step(const SlipInput& input) noexcept {
  observer_.update(input);
  const rig::WheelSpeeds speeds = observer_.speeds();
  const double v_x = wheels_.r2_m * speeds.omega2_rad_s;
  const double slip = rig::wheel_slip(wheels_.r1_m * speeds.omega1_rad_s, v_x, v_min_m_s_);
  learn(input.dt_s, slip);
  const Reference reference = next_reference(input.dt_s);

  const double error_m_s = slip_velocity_error_m_s(wheels_, speeds, reference.slip);
  integral_.advance(input, error_m_s, reference.slip, v_x);
  const double torque_Nm = command_Nm(input, slip, reference, error_m_s);
  return {.brake_torque_Nm = torque_Nm,
          .slip_velocity_error_m_s = error_m_s,
          .theta_est_N = peak_.peak_force_N(),
          .slip_ref = reference.slip};
}

double AdaptivePeakController::command_Nm(const SlipInput& input, double slip, const Reference& reference,
                                          double error_m_s) const noexcept {
  const rig::WheelSpeeds speeds = observer_.speeds();
  const double v_x = std::max(wheels_.r2_m * speeds.omega2_rad_s, v_min_m_s_);
  const paper::Laws<double> laws = paper::laws(wheels_);
  const paper::Gains<double> gains{.ks0 = options_.ks0, .ks1 = options_.ks1};
  // The observed force replaces theta phi: theta is the force, and phi is 1.
  const paper::Reading<double> reading{
      .omega1 = speeds.omega1_rad_s, .omega2 = speeds.omega2_rad_s, .lambda_ref = reference.slip, .phi = 1.0};
  // The observed force is delayed. The curve gives its change with the slip since then.
  const double force_N = observer_.force_N() + peak_.force_N(slip) - peak_.force_N(late_slip_);
  const double reference_m_s2 = reference.rate_per_s * v_x;

  // e_v' = -ks0 I - ks1 e_v, as in (16), with a reference that moves and a brake that is off by the observed error.
  const double nu = paper::Laws<double>::nu(gains, integral_.value_m(), error_m_s);
  const double wanted_Nm = laws.T_b(laws.xi_1(reading, nu, force_N) + reference_m_s2) - observer_.brake_error_Nm();
  if (std::isinf(input.max_brake_torque_Nm)) return wanted_Nm;

  const WheelMotion<double> motion = wheel_motion(
      laws, speeds, slip, reference.slip,
      {.tyre_force_N = force_N, .brake_torque_Nm = input.brake_torque_Nm + observer_.brake_error_Nm()}, v_min_m_s_);
  const double wanted_rate_Nm_s =
      laws.T_b(paper::Laws<double>::nu(gains, error_m_s, motion.error_rate_m_s2 - reference_m_s2) +
               laws.k(reading) * peak_.force_slope_N(slip) * motion.slip_rate_per_s);
  const double catch_up_Nm = std::expm1(-options_.lag_gain_per_s * period_s_) * (input.brake_torque_Nm - wanted_Nm);
  return lag_.command_Nm(input.brake_torque_Nm, period_s_ * wanted_rate_Nm_s + catch_up_Nm);
}

}  // namespace abs_hil::control
