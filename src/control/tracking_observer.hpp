#pragma once

#include <cstdint>

#include "abs_hil/control/options.hpp"

namespace abs_hil::control {

/// Third-order tracking observer of one wheel. It estimates angle, speed and acceleration from encoder counts, with a
/// triple pole at -bandwidth. It is discretised exactly for each time step (the alpha-beta-gamma or fading-memory
/// form), so that it is valid for any rate, also with jitter. It follows a constant deceleration without lag.
///
/// A reading means the middle of its count. The estimate is stored as a difference to the reading, so the half count
/// has no effect. If the count has not changed for `standstill_time_s`, the wheel stands still: speed and acceleration
/// are exactly 0 until the next count. Real-time safe.
class TrackingObserver {
 public:
  /// @param counts_per_rev encoder counts per revolution, > 0
  TrackingObserver(const ObserverOptions& options, std::int32_t counts_per_rev) noexcept;

  /// Starts from a reading and a known speed (0 if unknown).
  void reset(std::int32_t counts, double omega_rad_s) noexcept;
  /// Takes the next reading, `dt_s` after the previous one. Ignores it unless `dt_s` > 0. The counter may wrap around.
  void update(std::int32_t counts, double dt_s) noexcept;

  [[nodiscard]] double omega_rad_s() const noexcept { return omega_rad_s_; }
  [[nodiscard]] double alpha_rad_s2() const noexcept { return alpha_rad_s2_; }
  [[nodiscard]] bool stands_still() const noexcept { return still_s_ >= standstill_time_s_; }

 private:
  void predict_and_correct(double travel_rad, double dt_s) noexcept;
  void bound_by_silence() noexcept;

  double bandwidth_rad_s_;
  double standstill_time_s_;
  double rad_per_count_;
  std::int32_t counts_{0};
  /// Estimated angle minus the last reading. The difference stays exact however far the wheel has turned.
  double angle_error_rad_{0.0};
  double omega_rad_s_{0.0};
  double alpha_rad_s2_{0.0};
  double still_s_{0.0};  ///< since the count last changed
};

}  // namespace abs_hil::control
