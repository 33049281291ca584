#include "control/tracking_observer.hpp"

#include <algorithm>
#include <cmath>

#include "abs_hil/rig/encoder_scale.hpp"

namespace abs_hil::control {

namespace {
/// 1 - exp(-5): after five times 1/bandwidth nothing is left of the estimate before the gap.
constexpr double restart_share = 0.99326;
constexpr int ignored_max = 2;  ///< then the readings are right and the estimate is wrong
constexpr double resolution_counts = 2.0;
}  // namespace

TrackingObserver::TrackingObserver(const ObserverOptions& options, std::int32_t counts_per_rev,
                                   double alpha_max_rad_s2) noexcept
    : bandwidth_rad_s_{options.bandwidth_rad_s},
      standstill_time_s_{options.standstill_time_s},
      rad_per_count_{rig::radians_per_count(counts_per_rev)},
      alpha_max_rad_s2_{alpha_max_rad_s2} {}

void TrackingObserver::reset(std::int32_t counts, double omega_rad_s) noexcept {
  counts_ = counts;
  angle_error_rad_ = 0.0;
  omega_rad_s_ = taken_omega_rad_s_ = omega_rad_s;
  alpha_rad_s2_ = 0.0;
  ignored_ = 0;
  ignored_s_ = 0.0;
  still_s_ = 0.0;
}

[[gnu::noinline]] bool TrackingObserver::implausible(double correction_rad_s, double omega_gain, double dt_s,
                                                     double stamp_error_s) const noexcept {
  const double resolution_rad = resolution_counts * rad_per_count_;
  const bool uncertain = std::abs(omega_rad_s_) * stamp_error_s > resolution_rad;
  const double unexplained_rad_s = std::abs(correction_rad_s) - omega_gain * resolution_rad;
  return uncertain && ignored_ < ignored_max && unexplained_rad_s > alpha_max_rad_s2_ * dt_s;
}

[[gnu::cold]] void TrackingObserver::restart(double travel_rad, double dt_s) noexcept {
  omega_rad_s_ = (travel_rad - angle_error_rad_) / dt_s;
  alpha_rad_s2_ = 0.0;
  angle_error_rad_ = 0.0;
}

[[gnu::always_inline]] inline bool TrackingObserver::predict_and_correct(double travel_rad, double dt_s,
                                                                         double stamp_error_s) noexcept {
  // Fading-memory gains that put all three poles of the discrete filter at p = exp(-bandwidth dt); q = 1 - p.
  const double q = -std::expm1(-bandwidth_rad_s_ * dt_s);
  const double p = 1.0 - q;
  const double angle_gain = 1.0 - p * p * p;
  const double omega_gain = 1.5 * q * q * (1.0 + p) / dt_s;
  const double alpha_gain = q * q * q / (dt_s * dt_s);

  const double omega_predicted = taken_omega_rad_s_ + alpha_rad_s2_ * dt_s;
  const double turned_rad = 0.5 * (taken_omega_rad_s_ + omega_predicted) * dt_s;
  const double residual_rad = travel_rad - (angle_error_rad_ + turned_rad);

  if (stamp_error_s > 0.0 && implausible(omega_gain * residual_rad, omega_gain, dt_s, stamp_error_s)) {
    omega_rad_s_ = omega_predicted;
    return false;
  }
  if (q > restart_share) {
    restart(travel_rad, dt_s);
    return true;
  }

  // Estimate minus reading: the prediction error is -residual, and the angle gain reduces it.
  angle_error_rad_ = (angle_gain - 1.0) * residual_rad;
  omega_rad_s_ = omega_predicted + omega_gain * residual_rad;
  alpha_rad_s2_ += alpha_gain * residual_rad;
  return true;
}

void TrackingObserver::update(std::int32_t counts, double dt_s, double stamp_error_s) noexcept {
  if (!(dt_s > 0.0)) return;  // the next interval then includes this travel
  const std::int32_t travel = rig::counts_between(counts_, counts);
  still_s_ = travel == 0 ? still_s_ + dt_s : 0.0;
  if (stands_still()) {
    counts_ = counts;
    ignored_ = 0;
    ignored_s_ = 0.0;
    angle_error_rad_ = 0.0;
    omega_rad_s_ = taken_omega_rad_s_ = 0.0;
    alpha_rad_s2_ = 0.0;
    return;
  }
  // After an ignored reading the next one counts for the whole time since the last that was taken: its travel does too,
  // and gains for a shorter time would make the filter unstable.
  const double since_taken_s = ignored_s_ + dt_s;
  const bool taken = predict_and_correct(static_cast<double>(travel) * rad_per_count_, since_taken_s, stamp_error_s);
  if (travel == 0) bound_by_silence();
  if (!taken) {
    ++ignored_;
    ignored_s_ = since_taken_s;
    return;
  }
  counts_ = counts;
  ignored_ = 0;
  ignored_s_ = 0.0;
  taken_omega_rad_s_ = omega_rad_s_;
}

void TrackingObserver::bound_by_silence() noexcept {
  // The wheel has stayed within one count for the time T since the last change. Under constant acceleration, also
  // through a reversal, its speed then is below 4 counts per T. Without this bound the filter would swing through zero
  // after a wheel locks, and ring after a lone count.
  const double bound_rad_s = 4.0 * rad_per_count_ / still_s_;
  if (std::abs(omega_rad_s_) <= bound_rad_s) return;
  omega_rad_s_ = std::copysign(bound_rad_s, omega_rad_s_);
  if (alpha_rad_s2_ * omega_rad_s_ > 0.0) alpha_rad_s2_ = 0.0;
}

}  // namespace abs_hil::control
