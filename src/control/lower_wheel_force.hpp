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
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {

/// Three equal lags in a row; `q` is what one covers of its distance in a cycle.
template <class S>
struct ThreeLags {
  std::array<S, 3> lag{S(0.0), S(0.0), S(0.0)};

  template <class Q>
  S operator()(const Q& q, S x) noexcept {
    for (S& y : lag) x = y = y + q * (x - y);
    return x;
  }
};

/// Delays a signal as LowerWheelForce delays the force: `q` = `covered()`.
template <class S>
struct ForceDelay {
  ThreeLags<S> lags;
  S last{0.0}, before{0.0};

  template <class Q>
  S operator()(const Q& q, const S& now) noexcept {
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
template <class S>
class BasicLowerWheelForce {
 public:
  BasicLowerWheelForce() = default;
  /// @param bandwidth_rad_s  of the lags, > 0
  BasicLowerWheelForce(const rig::WheelParameters& wheels, double bandwidth_rad_s) noexcept
      : J2_kg_m2_{wheels.J2_kg_m2},
        d2_Nms_rad_{wheels.d2_Nms_rad},
        M20_Nm_{wheels.M20_Nm},
        r2_m_{wheels.r2_m},
        bandwidth_rad_s_{bandwidth_rad_s} {}

  void reset(const S& omega2_rad_s) noexcept {
    lags_ = {};
    last_rad_s_ = omega2_rad_s;
    last_dt_s_ = covered_ = force_N_ = S(0.0);
  }
  /// @param travel_rad  that the lower wheel turned in `dt_s` > 0
  /// @param omega2_rad_s  for the viscous friction only
  void update(const S& dt_s, const S& travel_rad, const S& omega2_rad_s) noexcept {
    // It follows from `dt_s` alone: lanes whose cycles are as long as before get the same number again.
    if (rig::any(dt_s != last_dt_s_)) covered_ = -rig::exponential_less_one(S(-bandwidth_rad_s_ * dt_s));
    const S friction_Nm = d2_Nms_rad_ * omega2_rad_s + M20_Nm_;
    const auto first = !(last_dt_s_ > 0.0);
    // Before the first interval the wheel ran out without tyre force.
    if (rig::any(first))
      last_rad_s_ = rig::select(first, S(last_rad_s_ + 0.5 * dt_s * friction_Nm / J2_kg_m2_), last_rad_s_);
    // Mean speeds are those of the middle of their intervals.
    const S apart_s = rig::select(first, dt_s, S(0.5 * (last_dt_s_ + dt_s)));
    const S rad_s = travel_rad / dt_s;
    const S alpha_rad_s2 = (rad_s - last_rad_s_) / apart_s;
    force_N_ = lags_(covered_, -(J2_kg_m2_ * alpha_rad_s2 + friction_Nm) / r2_m_);
    last_rad_s_ = rad_s;
    last_dt_s_ = dt_s;
  }
  [[nodiscard]] const S& force_N() const noexcept { return force_N_; }
  /// What a filter of one pole covers of its distance in the last interval.
  [[nodiscard]] const S& covered() const noexcept { return covered_; }

 private:
  S J2_kg_m2_{0.0}, d2_Nms_rad_{0.0}, M20_Nm_{0.0}, r2_m_{0.0};
  S bandwidth_rad_s_{0.0};
  ThreeLags<S> lags_{};
  S last_rad_s_{0.0};  ///< mean speed of the last interval
  S last_dt_s_{0.0};
  S covered_{0.0};
  S force_N_{0.0};
};
using LowerWheelForce = BasicLowerWheelForce<double>;

/// The speeds of both wheels from their travel alone, delayed as ForceDelay delays a force. An observer that knows the
/// brake torque learns of the tyre force later, so its slip is wrong while the torque rises. Real-time safe.
template <class S>
class BasicDelayedSpeeds {
 public:
  void reset(const rig::BasicWheelSpeeds<S>& speeds) noexcept {
    upper_.reset(speeds.omega1_rad_s);
    lower_.reset(speeds.omega2_rad_s);
    speeds_ = speeds;
  }
  /// @param covered  of LowerWheelForce
  /// @param dt_s  time of the travels, > 0
  void update(const S& covered, const S& dt_s, const S& upper_travel_rad, const S& lower_travel_rad) noexcept {
    speeds_ = {.omega1_rad_s = upper_(covered, upper_travel_rad / dt_s),
               .omega2_rad_s = lower_(covered, lower_travel_rad / dt_s)};
  }
  [[nodiscard]] const rig::BasicWheelSpeeds<S>& speeds() const noexcept { return speeds_; }

 private:
  struct Delay {
    ThreeLags<S> lags{};
    S last{0.0};

    void reset(const S& speed) noexcept {
      lags.lag.fill(speed);
      last = speed;
    }
    S operator()(const S& covered, const S& speed) noexcept {
      // The mean speed of an interval is the mean of its ends, so two intervals make the 1, 2, 1 of ForceDelay.
      const S mean = 0.5 * (speed + last);
      last = speed;
      return lags(covered, mean);
    }
  };
  Delay upper_{}, lower_{};
  rig::BasicWheelSpeeds<S> speeds_{};
};
using DelayedSpeeds = BasicDelayedSpeeds<double>;

}  // namespace abs_hil::control
