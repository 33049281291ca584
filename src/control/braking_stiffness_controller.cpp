#include "control/braking_stiffness_controller.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "abs_hil/rig/option_check.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "control/full_torque.hpp"

namespace abs_hil::control {
namespace {

constexpr double least_force_N = 1.0;
constexpr double least_slip = 1e-3;

const BrakingStiffnessOptions& checked(const BrakingStiffnessOptions& o) {
  rig::require_valid(o, "control.braking_stiffness.");
  if (!(o.slip_min <= o.slip_start && o.slip_start <= o.slip_max)) {
    throw std::invalid_argument("control.braking_stiffness.slip_start must be in [slip_min, slip_max]");
  }
  return o;
}

}  // namespace

void BrakingStiffness::reset() noexcept { slip_ = force_N_ = variance_ = covariance_N_ = 0.0; }

void BrakingStiffness::learn(double dt_s, double slip, double force_N) noexcept {
  const double share = -rig::exponential_less_one(-dt_s / memory_s_);
  const double slip_off = slip - slip_, force_off_N = force_N - force_N_;
  slip_ += share * slip_off;
  force_N_ += share * force_off_N;
  variance_ = (1.0 - share) * (variance_ + share * slip_off * slip_off);
  covariance_N_ = (1.0 - share) * (covariance_N_ + share * slip_off * force_off_N);
}

double BrakingStiffness::elasticity() const noexcept {
  const double slip = std::max(least_slip, slip_), force_N = std::max(least_force_N, force_N_);
  const double unknown = slip_noise_ * slip_noise_;
  const double slope_N = (covariance_N_ + unknown * force_N / slip) / (variance_ + unknown);
  return std::clamp(slope_N * slip / force_N, -1.0, 1.0);
}

BrakingStiffnessController::BrakingStiffnessController(const ControllerContext& context)
    : options_{checked(context.options.braking_stiffness)},
      rig_{context.rig},
      laws_{paper::laws(context.rig.wheels)},
      lag_{context.rig.brake.c31_per_s, 1.0 / context.options.rate_Hz},
      period_s_{1.0 / context.options.rate_Hz},
      v_min_m_s_{context.options.v_min_m_s},
      observer_{options_.observer, context.rig, context.options.rate_Hz},
      stiffness_{options_.memory_s, options_.slip_noise} {}

void BrakingStiffnessController::reset(const SlipInput& input) noexcept {
  observer_.reset(input.speeds);
  stiffness_.reset();
  late_slip_ = search_rad_ = 0.0;
  reference_ = options_.slip_start;
}

SlipOutput BrakingStiffnessController::step(const SlipInput& input) noexcept {
  observer_.update(input);
  const rig::WheelSpeeds speeds = observer_.speeds();
  const double slip = rig::wheel_slip(laws_.r1 * speeds.omega1_rad_s, laws_.r2 * speeds.omega2_rad_s, v_min_m_s_);
  if (input.dt_s > 0.0) {
    late_slip_ += -rig::exponential_less_one(-input.dt_s / observer_.force_delay_s()) * (slip - late_slip_);
    stiffness_.learn(input.dt_s, late_slip_, observer_.force_N());
    const double rise = options_.rate_per_s * (stiffness_.elasticity() - options_.target) * input.dt_s;
    reference_ = std::clamp(reference_ * rig::exponential(rise), options_.slip_min, options_.slip_max);
    search_rad_ += options_.search_rad_s * input.dt_s;
    if (search_rad_ > std::numbers::pi) search_rad_ = std::remainder(search_rad_, 2.0 * std::numbers::pi);
  }
  const double reference = reference_ * (1.0 + options_.search_part * rig::sine(search_rad_));
  const paper::Reading<double> now{
      .omega1 = speeds.omega1_rad_s, .omega2 = speeds.omega2_rad_s, .lambda_ref = reference, .phi = 1.0};
  const double error_m_s = laws_.e_v(now);
  const double most_Nm = full_torque_Nm(rig_.brake, input.max_brake_torque_Nm);
  const double force_N = std::max(0.0, observer_.force_N());
  const double wanted_Nm = std::clamp(
      laws_.T_b(laws_.xi_1(now, -options_.slip_gain_per_s * error_m_s, force_N)) - observer_.brake_error_Nm(), 0.0,
      most_Nm);
  const double step_Nm =
      -rig::exponential_less_one(-options_.lag_gain_per_s * period_s_) * (wanted_Nm - input.brake_torque_Nm);
  const bool ideal = std::isinf(input.max_brake_torque_Nm);
  SlipOutput output{.brake_torque_Nm = ideal ? wanted_Nm : lag_.command_Nm(input.brake_torque_Nm, step_Nm),
                    .slip_velocity_error_m_s = error_m_s,
                    .theta_est_N = rig::unknown,
                    .slip_ref = reference};
  output.signals[0] = stiffness_.elasticity();
  return output;
}

std::span<const rig::Signal> BrakingStiffnessController::signals() const noexcept {
  static constexpr std::array<rig::Signal, 1> rows{
      {{"elasticity", "estimated relative growth of the tyre force per relative growth of the slip"}}};
  return rows;
}

}  // namespace abs_hil::control
