#pragma once

#include <cstdint>

#include "abs_hil/control/options.hpp"

namespace abs_hil::control {

/// Third-order tracking observer of one wheel: angle, speed and acceleration from encoder counts, with a triple pole at
/// -bandwidth, discretised exactly for the time step given (the alpha-beta-gamma form), so that it holds for any rate
/// and for a jittering one. Follows a constant deceleration without lag. Real-time safe.
class TrackingObserver {
 public:
  /// @param counts_per_rev encoder counts per revolution, > 0
  TrackingObserver(const ObserverOptions& options, std::int32_t counts_per_rev) noexcept;

  /// Starts from a reading, with the speed it is known to have (0 if unknown).
  void reset(std::int32_t counts, double omega_rad_s) noexcept;
  /// Takes the next reading, `dt_s` > 0 after the one before.
  void update(std::int32_t counts, double dt_s) noexcept;

  [[nodiscard]] double omega_rad_s() const noexcept { return omega_rad_s_; }
  [[nodiscard]] double alpha_rad_s2() const noexcept { return alpha_rad_s2_; }
  [[nodiscard]] bool stands_still() const noexcept { return still_s_ >= standstill_time_s_; }

 private:
  double bandwidth_rad_s_;
  double standstill_time_s_;
  double rad_per_count_;
  std::int32_t counts_{0};
  /// Estimated angle less the last reading's: a difference, so that it stays exact however far the wheel has turned.
  double angle_error_rad_{0.0};
  double omega_rad_s_{0.0};
  double alpha_rad_s2_{0.0};
  double still_s_{0.0};
};

}  // namespace abs_hil::control
