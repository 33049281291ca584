// Speed and acceleration of a wheel from the counts of its encoder.
#pragma once

#include <cstdint>

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::control {

/// The filter of TrackingObserver for readings that are all taken. Real-time safe.
template <class S>
class SpeedTracker {
 public:
  SpeedTracker() = default;
  SpeedTracker(const ObserverOptions& options, std::int32_t counts_per_rev) noexcept
      : bandwidth_rad_s_{options.bandwidth_rad_s},
        standstill_time_s_{options.standstill_time_s},
        rad_per_count_{rig::radians_per_count(counts_per_rev)} {}

  void reset(const S& omega_rad_s) noexcept {
    angle_error_rad_ = S(0.0);
    omega_rad_s_ = omega_rad_s;
    alpha_rad_s2_ = S(0.0);
    still_s_ = S(0.0);
  }

  /// Fading-memory gains that put all three poles of the discrete filter at p = exp(-bandwidth dt); q = 1 - p.
  void prepare(const S& dt_s) noexcept {
    dt_s_ = dt_s;
    q_ = -rig::exponential_less_one(S(-bandwidth_rad_s_ * dt_s));
    const S p = 1.0 - q_;
    angle_gain_ = 1.0 - p * p * p;
    omega_gain_ = 1.5 * q_ * q_ * (1.0 + p) / dt_s;
    alpha_gain_ = q_ * q_ * q_ / (dt_s * dt_s);
  }

  /// Takes the counts travelled in the time that `prepare` was called for.
  void take(const S& travel) noexcept {
    note(travel, dt_s_);
    correct(travel);
    bound_by_silence(travel);
    stop_where(stands_still());
  }

  // The parts of `take`.
  void note(const S& travel, const S& dt_s) noexcept {
    still_s_ = rig::select(travel == 0.0, S(still_s_ + dt_s), S(0.0));
  }
  [[nodiscard]] S predicted_rad_s() const noexcept { return omega_rad_s_ + alpha_rad_s2_ * dt_s_; }
  /// Angle read less angle predicted.
  [[nodiscard]] S residual_rad(const S& travel) const noexcept {
    const S turned_rad = 0.5 * (omega_rad_s_ + predicted_rad_s()) * dt_s_;
    return travel * rad_per_count_ - (angle_error_rad_ + turned_rad);
  }
  void correct(const S& travel) noexcept {
    const S residual = residual_rad(travel);
    // Estimate minus reading: the prediction error is -residual, and the angle gain reduces it.
    angle_error_rad_ = (angle_gain_ - 1.0) * residual;
    omega_rad_s_ = predicted_rad_s() + omega_gain_ * residual;
    alpha_rad_s2_ += alpha_gain_ * residual;
  }
  /// The wheel has stayed within one count for the time T since the last change. Under constant acceleration, also
  /// through a reversal, its speed then is below 4 counts per T. Without this bound the filter would swing through zero
  /// after a wheel locks, and ring after a lone count.
  void bound_by_silence(const S& travel, S& omega_rad_s) noexcept {
    const auto silent = travel == 0.0;
    if (!rig::any(silent)) return;
    const S bound_rad_s = 4.0 * rad_per_count_ / still_s_;
    const auto beyond = silent && rig::magnitude(omega_rad_s) > bound_rad_s;
    omega_rad_s = rig::select(beyond, rig::with_sign(bound_rad_s, omega_rad_s), omega_rad_s);
    alpha_rad_s2_ = rig::select(beyond && alpha_rad_s2_ * omega_rad_s > 0.0, S(0.0), alpha_rad_s2_);
  }
  void bound_by_silence(const S& travel) noexcept { bound_by_silence(travel, omega_rad_s_); }
  template <class Condition>
  void stop_where(const Condition& stands) noexcept {
    if (!rig::any(stands)) return;
    angle_error_rad_ = rig::select(stands, S(0.0), angle_error_rad_);
    omega_rad_s_ = rig::select(stands, S(0.0), omega_rad_s_);
    alpha_rad_s2_ = rig::select(stands, S(0.0), alpha_rad_s2_);
  }
  /// Forgets what came before a gap far above 1/bandwidth: the mean speed over the gap remains.
  void restart(const S& travel) noexcept {
    omega_rad_s_ = (travel * rad_per_count_ - angle_error_rad_) / dt_s_;
    alpha_rad_s2_ = S(0.0);
    angle_error_rad_ = S(0.0);
  }

  [[nodiscard]] S omega_rad_s() const noexcept { return omega_rad_s_; }
  [[nodiscard]] S alpha_rad_s2() const noexcept { return alpha_rad_s2_; }
  [[nodiscard]] auto stands_still() const noexcept { return still_s_ >= standstill_time_s_; }
  [[nodiscard]] S dt_s() const noexcept { return dt_s_; }
  [[nodiscard]] S omega_gain() const noexcept { return omega_gain_; }
  [[nodiscard]] S rad_per_count() const noexcept { return rad_per_count_; }
  /// 1 - exp(-5): after five times 1/bandwidth nothing is left of the estimate before the gap.
  [[nodiscard]] auto must_restart() const noexcept { return q_ > 0.99326; }

 private:
  S bandwidth_rad_s_{0.0};
  S standstill_time_s_{0.0};
  S rad_per_count_{0.0};
  S dt_s_{0.0};  ///< of the gains
  S q_{0.0};
  S angle_gain_{0.0};
  S omega_gain_{0.0};
  S alpha_gain_{0.0};
  /// Estimated angle minus the last reading. The difference stays exact however far the wheel has turned.
  S angle_error_rad_{0.0};
  S omega_rad_s_{0.0};
  S alpha_rad_s2_{0.0};
  S still_s_{0.0};  ///< since the count last changed
};

}  // namespace abs_hil::control
