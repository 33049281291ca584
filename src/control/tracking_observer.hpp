#pragma once

#include <cstdint>
#include <limits>

#include "abs_hil/control/options.hpp"

namespace abs_hil::control {

/// Third-order tracking observer of one wheel. It estimates angle, speed and acceleration from encoder counts, with a
/// triple pole at -bandwidth. It is discretised exactly for each time step (the alpha-beta-gamma or fading-memory
/// form), so that it is valid for any rate, also with jitter. It follows a constant deceleration without lag.
///
/// A reading means the middle of its count. The estimate is stored as a difference to the reading, so the half count
/// has no effect. If the count has not changed for `standstill_time_s`, the wheel stands still: speed and acceleration
/// are exactly 0 until the next count.
///
/// A reading whose time stamp is uncertain is ignored, twice in a row at most, if it would change the speed faster than
/// the wheel can. After a gap far above 1/bandwidth the observer restarts from the mean speed over the gap. Real-time
/// safe.
class TrackingObserver {
 public:
  /// @param counts_per_rev  encoder counts per revolution, > 0
  /// @param alpha_max_rad_s2  fastest change of speed that the wheel can have
  TrackingObserver(const ObserverOptions& options, std::int32_t counts_per_rev,
                   double alpha_max_rad_s2 = std::numeric_limits<double>::infinity()) noexcept;

  /// Starts from a reading and a known speed (0 if unknown).
  void reset(std::int32_t counts, double omega_rad_s) noexcept;
  /// Takes the next reading, `dt_s` after the previous one. Ignores it unless `dt_s` > 0. The counter may wrap around.
  /// @param stamp_error_s  by how much the reading's time stamp may be wrong
  void update(std::int32_t counts, double dt_s, double stamp_error_s = 0.0) noexcept;

  [[nodiscard]] double omega_rad_s() const noexcept { return omega_rad_s_; }
  [[nodiscard]] double alpha_rad_s2() const noexcept { return alpha_rad_s2_; }
  [[nodiscard]] bool stands_still() const noexcept { return still_s_ >= standstill_time_s_; }

 private:
  /// False if the reading is ignored.
  bool predict_and_correct(double travel_rad, double dt_s, double stamp_error_s) noexcept;
  [[nodiscard]] bool implausible(double correction_rad_s, double omega_gain, double dt_s,
                                 double stamp_error_s) const noexcept;
  void restart(double travel_rad, double dt_s) noexcept;
  void bound_by_silence() noexcept;

  double bandwidth_rad_s_;
  double standstill_time_s_;
  double rad_per_count_;
  double alpha_max_rad_s2_;
  std::int32_t counts_{0};
  /// Estimated angle minus the last reading. The difference stays exact however far the wheel has turned.
  double angle_error_rad_{0.0};
  double omega_rad_s_{0.0};
  double taken_omega_rad_s_{0.0};  ///< speed at the last reading that was taken
  double alpha_rad_s2_{0.0};
  int ignored_{0};         ///< readings in a row
  double ignored_s_{0.0};  ///< since the last reading that was taken
  double still_s_{0.0};    ///< since the count last changed
};

}  // namespace abs_hil::control
