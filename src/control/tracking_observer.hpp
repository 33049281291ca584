#pragma once

#include <cstdint>

#include "abs_hil/control/options.hpp"

namespace abs_hil::control {

/// Third-order tracking observer of one wheel: angle, speed and acceleration from encoder counts, with a triple pole at
/// -bandwidth, discretised exactly for the time step given (the alpha-beta-gamma or fading-memory form), so that it
/// holds for any rate and for a jittering one. Follows a constant deceleration without lag.
///
/// A reading stands for the middle of its count; the estimate is kept as a difference to it, so the half count never
/// shows. A wheel whose count has not changed for `standstill_time_s` stands still: speed and acceleration exactly 0;
/// the next count ends that. Real-time safe.
class TrackingObserver {
 public:
  /// @param counts_per_rev encoder counts per revolution, > 0
  TrackingObserver(const ObserverOptions& options, std::int32_t counts_per_rev) noexcept;

  /// Starts from a reading, with the speed it is known to have (0 if unknown).
  void reset(std::int32_t counts, double omega_rad_s) noexcept;
  /// Takes the next reading, `dt_s` > 0 after the one before (otherwise it is ignored), right across the counter's
  /// wrap-around.
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
  /// Estimated angle less the last reading's: a difference, so that it stays exact however far the wheel has turned.
  double angle_error_rad_{0.0};
  double omega_rad_s_{0.0};
  double alpha_rad_s2_{0.0};
  double still_s_{0.0};  ///< since the count last changed
};

}  // namespace abs_hil::control
