// The tyre force from the lower wheel alone, from (2) without the motor: neither the brake nor its model enters.
//
//   F_n = -(J2 a_n + d2 omega2 + M20) / r2,  a_n = (p_n / h_n - p_(n-1) / h_(n-1)) / ((h_n + h_(n-1)) / 2)
//   three lags in a row:  y_i += q (y_(i-1) - y_i),  y_0 = F_n,  q = 1 - exp(-bandwidth h_n)
//
// p_n is the wheel's travel in cycle n, rad, h_n its time, s, a_n the acceleration, rad/s^2, F the force, N. A force
// that is linear over a cycle answers with (F_n + 2 F_(n-1) + F_(n-2)) / 4 before the lags: `ForceDelay` is that and
// the lags. A curve that is compared with F passes through it, so that the delay cancels (docs/theory-beyond.md).
#pragma once

#include <array>

#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// Three equal lags in a row; `q` is what one covers of its distance in a cycle.
template <class S>
struct ThreeLags {
  std::array<S, 3> lag{S(0.0), S(0.0), S(0.0)};

  S operator()(double q, S x) noexcept {
    for (S& y : lag) x = y = y + q * (x - y);
    return x;
  }
};

/// Delays a signal as LowerWheelForce delays the force: `q` = `covered()`.
template <class S>
struct ForceDelay {
  ThreeLags<S> lags;
  S last{0.0}, before{0.0};

  S operator()(double q, const S& now) noexcept {
    // A force sampled now and in the two cycles before: the mean acceleration of the two intervals that the newest
    // second difference of the angle spans.
    const S x = 0.25 * (now + 2.0 * last + before);
    before = last;
    last = now;
    return lags(q, x);
  }
  /// As after a long time at this value.
  void settle(const S& value) noexcept {
    lags.lag.fill(value);
    last = before = value;
  }
  void shift(const S& by) noexcept {
    for (S& y : lags.lag) y = y + by;
    last = last + by;
    before = before + by;
  }
};

/// The tyre force by the equations above. The lags remove the noise of the counts. Real-time safe.
class LowerWheelForce {
 public:
  /// @param bandwidth_rad_s  of the lags, > 0
  LowerWheelForce(const rig::WheelParameters& wheels, double bandwidth_rad_s) noexcept;

  void reset(double omega2_rad_s) noexcept;
  /// @param travel_rad  that the lower wheel turned in `dt_s` > 0
  /// @param omega2_rad_s  for the viscous friction only
  void update(double dt_s, double travel_rad, double omega2_rad_s) noexcept;
  [[nodiscard]] double force_N() const noexcept { return force_N_; }
  /// What a filter of one pole covers of its distance in the last interval.
  [[nodiscard]] double covered() const noexcept { return covered_; }

 private:
  rig::WheelParameters wheels_;
  double bandwidth_rad_s_;
  ThreeLags<double> lags_;
  double last_rad_s_{0.0};  ///< mean speed of the last interval
  double last_dt_s_{0.0};
  double covered_{0.0};
  double force_N_{0.0};
};

/// The speeds of both wheels from their travel alone, delayed as ForceDelay delays a force. An observer that knows the
/// brake torque learns of the tyre force later, so its slip is wrong while the torque rises. Real-time safe.
class DelayedSpeeds {
 public:
  void reset(const rig::WheelSpeeds& speeds) noexcept;
  /// @param covered  of LowerWheelForce
  /// @param dt_s  time of the travels, > 0
  void update(double covered, double dt_s, double upper_travel_rad, double lower_travel_rad) noexcept;
  [[nodiscard]] const rig::WheelSpeeds& speeds() const noexcept { return speeds_; }

 private:
  struct Delay {
    ThreeLags<double> lags;
    double last{0.0};

    void reset(double speed) noexcept;
    double operator()(double covered, double speed) noexcept;
  };
  Delay upper_, lower_;
  rig::WheelSpeeds speeds_{};
};

}  // namespace abs_hil::control
