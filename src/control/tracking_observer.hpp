// A wheel's speed from its encoder: SpeedTracker behind a check of the readings.
#pragma once

#include <cstdint>
#include <limits>

#include "abs_hil/control/options.hpp"
#include "control/encoder_disc.hpp"
#include "control/speed_tracker.hpp"

namespace abs_hil::control {

/// Third-order tracking observer of one wheel. It estimates angle, speed and acceleration from encoder counts, with a
/// triple pole at -bandwidth. It is discretised exactly for each time step (the alpha-beta-gamma or fading-memory
/// form), so that it is valid for any rate, also with jitter. It follows a constant deceleration without lag.
///
/// A reading means the middle of its count. The estimate is stored as a difference to the reading, so the half count
/// has no effect. A board that stamps its edges tells more: at the edge the wheel stood between two counts, and it has
/// turned on since then at the predicted speed. That places the wheel within its count. If the count has not changed
/// for `standstill_time_s`, the wheel stands still: speed and acceleration are exactly 0 until the next count.
///
/// A reading whose time stamp is uncertain is ignored, twice in a row at most, if it would change the speed faster than
/// the wheel can. After a gap far above 1/bandwidth the observer restarts from the mean speed over the gap. Real-time
/// safe.
class TrackingObserver {
 public:
  /// @param counts_per_rev  encoder counts per revolution, > 0
  /// @param alpha_max_rad_s2  fastest change of speed that the wheel can have
  /// @param eccentricity  of the encoder's disc; its readings are corrected by it
  TrackingObserver(const ObserverOptions& options, std::int32_t counts_per_rev,
                   double alpha_max_rad_s2 = std::numeric_limits<double>::infinity(),
                   const rig::EccentricityParameters& eccentricity = {}) noexcept;

  /// Starts from a reading and a known speed (0 if unknown).
  void reset(std::int32_t counts, double omega_rad_s) noexcept;
  /// Takes the next reading, `dt_s` after the previous one. Ignores it unless `dt_s` > 0. The counter may wrap around.
  /// @param stamp_error_s  by how much the reading's time stamp may be wrong
  /// @param edge_age_s  time since the counter's last edge; below 0: not known
  void update(std::int32_t counts, double dt_s, double stamp_error_s = 0.0, double edge_age_s = -1.0) noexcept;

  /// Replaces what is known of the disc's eccentricity, without a step of the speed.
  void know(const rig::EccentricityParameters& eccentricity) noexcept { disc_.know(eccentricity); }

  /// Angle that the wheel has turned between the latest two readings, taken or ignored.
  [[nodiscard]] double travel_rad() const noexcept { return travel_ * tracker_.rad_per_count(); }
  [[nodiscard]] double omega_rad_s() const noexcept { return omega_rad_s_; }
  [[nodiscard]] double alpha_rad_s2() const noexcept { return tracker_.alpha_rad_s2(); }
  [[nodiscard]] bool stands_still() const noexcept { return tracker_.stands_still(); }
  /// The filter alone.
  [[nodiscard]] const SpeedTracker<double>& tracker() const noexcept { return tracker_; }

 private:
  [[nodiscard]] bool implausible(double travel, double stamp_error_s) const noexcept;
  [[nodiscard]] double place_in_count(double edge_age_s) const noexcept;

  SpeedTracker<double> tracker_;
  EncoderDisc disc_;
  double alpha_max_rad_s2_;
  double travel_{0.0};       ///< counts between the latest two readings
  double direction_{0.0};    ///< of the last edge, 1 or -1; 0: none was seen
  double place_{0.0};        ///< of the wheel at the last reading that was taken, counts from the middle of its count
  double omega_rad_s_{0.0};  ///< the tracker's speed, or its prediction while readings are ignored
  int ignored_{0};           ///< readings in a row
  double ignored_s_{0.0};    ///< since the last reading that was taken
  double ignored_travel_{0.0};  ///< counts
};

}  // namespace abs_hil::control
