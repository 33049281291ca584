#include "control/theta_estimator.hpp"

#include <algorithm>
#include <cmath>

#include "control/standing_wheel.hpp"

namespace abs_hil::control {

namespace {
constexpr double least_decay = 1e-12;  ///< the quotient of two numbers below it loses its digits
}  // namespace

ThetaEstimator::ThetaEstimator(const AdaptiveOptions& options, const rig::WheelParameters& wheels) noexcept
    : wheels_{wheels},
      innovation_gain_{options.gamma * options.ka1},
      zeta0_N_{std::clamp(options.zeta0, options.theta_min_N, options.theta_max_N)},
      theta_min_N_{options.theta_min_N},
      theta_max_N_{options.theta_max_N},
      theta_N_{zeta0_N_},
      zeta_N_{zeta0_N_} {}

void ThetaEstimator::reset() noexcept {
  theta_N_ = zeta0_N_;
  zeta_N_ = zeta0_N_;
}

void ThetaEstimator::take_over(const ThetaEstimator& before) noexcept {
  theta_N_ = std::clamp(before.theta_N_, theta_min_N_, theta_max_N_);
  zeta_N_ = before.zeta_N_;
}

double ThetaEstimator::omega1_hat_rad_s(double omega1_rad_s) const noexcept {
  return omega1_rad_s - wheels_.r1_m / wheels_.J1_kg_m2 * (theta_N_ - zeta_N_) / innovation_gain_;
}

void ThetaEstimator::update(const AdaptationInterval& past) noexcept {
  if (!(past.dt_s > 0.0 && turns(past.omega1_before_rad_s) && turns(past.omega1_after_rad_s))) return;
  const auto& w = wheels_;
  const double omega1_rate = (past.omega1_after_rad_s - past.omega1_before_rad_s) / past.dt_s;
  const double omega1_mean = 0.5 * (past.omega1_before_rad_s + past.omega1_after_rad_s);
  const double tyre_force_N =
      (w.J1_kg_m2 * omega1_rate + w.d1_Nms_rad * omega1_mean + w.M10_Nm + past.brake_torque_Nm) / w.r1_m;
  update(ForceInterval{past.dt_s, tyre_force_N, past.phi, past.zeta_rate_N_s});
}

void ThetaEstimator::update(const ForceInterval& past) noexcept {
  if (!(past.phi > 0.0 && past.dt_s > 0.0)) return;
  // theta' = rate_now - decay (theta - theta_now): over dt it covers (1 - exp(-decay dt))/decay of the present rate.
  const double rate_now = past.zeta_rate_N_s + innovation_gain_ * (past.tyre_force_N - past.phi * theta_N_);
  const double decay = innovation_gain_ * past.phi;
  // For a decay that vanishes, that is dt.
  const double covered_s =
      std::abs(decay * past.dt_s) < least_decay ? past.dt_s : -std::expm1(-decay * past.dt_s) / decay;
  const double theta_N = theta_N_ + covered_s * rate_now;
  theta_N_ = std::clamp(theta_N, theta_min_N_, theta_max_N_);
  zeta_N_ += past.zeta_rate_N_s * past.dt_s;
}

}  // namespace abs_hil::control
