#pragma once

#include "abs_hil/rig/measurement.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::analysis {

/// Car speed above which slip and its estimates are judged. Below it one encoder count is a large part of them.
inline constexpr double least_judged_speed_m_s = 3.0;

/// What the metrics of braking need of one cycle.
template <class S>
struct BrakingSample {
  S time_s{0.0};
  S v_x_m_s{0.0};
  S distance_m{0.0};  ///< since the start of braking
  S slip{0.0};
  S slip_ref{0.0};
  S torque_ref_Nm{0.0};
  S theta_est_N{0.0};
  S theta_N{0.0};
};

/// Time since which a quantity has stayed within its band, from the start of braking.
template <class S>
class Settling {
 public:
  template <class Condition>
  void observe(const Condition& judged, const S& since_brake_s, const Condition& inside) noexcept {
    since_s_ = rig::select(judged && inside && !(settled_ > 0.0), since_brake_s, since_s_);
    settled_ = rig::select(judged, rig::select(inside, S(1.0), S(0.0)), settled_);
  }
  [[nodiscard]] S since_s() const noexcept { return rig::select(settled_ > 0.0, since_s_, S(rig::unknown)); }

 private:
  S settled_{0.0};  ///< 1 or 0
  S since_s_{rig::unknown};
};

/// The figures behind RunMetrics from the first cycle of braking on. `S` is a `double`, or a pack of them
/// (rig/scalar.hpp).
template <class S>
class BrakingFigures {
 public:
  BrakingFigures() = default;
  explicit BrakingFigures(const S& end_speed_m_s) noexcept : end_speed_m_s_(end_speed_m_s) {}

  static constexpr double rms_start_s = 0.3;
  static constexpr double slip_band = 0.02;
  static constexpr double theta_band = 0.05;

  /// @param braking  the cycle is in phase brake; it is in the first one
  template <class Condition>
  void note(const BrakingSample<S>& sample, const Condition& braking) noexcept;

  [[nodiscard]] auto stop_known() const noexcept { return !rig::is_nan(stop_time_s); }
  [[nodiscard]] S end_speed_m_s() const noexcept { return end_speed_m_s_; }

  // NaN: not known so far.
  S brake_start_s{rig::unknown};
  S stop_time_s{rig::unknown};
  S stop_distance_m{rig::unknown};
  S theta_final_N{rig::unknown};
  S theta_error_final{rig::unknown};
  S torque_total_variation_Nm{rig::unknown};
  S slip_overshoot{rig::unknown};
  S slip_largest{rig::unknown};
  S slip_reached_s{rig::unknown};
  S theta_error_max_N{rig::unknown};
  S time_locked_s{rig::unknown};
  S final_speed_m_s{rig::unknown};
  S slip_square_sum{0.0};
  S theta_square_sum{0.0};
  S samples{0.0};  ///< in the two sums
  S last_time_s{rig::unknown};
  S last_distance_m{0.0};
  S deceleration_m_s2{0.0};  ///< over the last interval of at least 10 ms
  Settling<S> slip_settling{};
  Settling<S> theta_settling{};

 private:
  template <class Condition>
  void note_braking(const BrakingSample<S>& sample, const Condition& braking, const S& since_brake_s) noexcept;
  void note_deceleration(const S& time_s, const S& v_x_m_s) noexcept;

  S end_speed_m_s_{0.0};
  S interval_start_s_{rig::unknown};
  S interval_start_m_s_{0.0};
  S last_torque_Nm_{rig::unknown};
};

template <class S>
template <class Condition>
void BrakingFigures<S>::note(const BrakingSample<S>& sample, const Condition& braking) noexcept {
  brake_start_s = rig::select(rig::is_nan(brake_start_s), sample.time_s, brake_start_s);
  const S since_brake_s = sample.time_s - brake_start_s;
  final_speed_m_s = sample.v_x_m_s;
  last_distance_m = sample.distance_m;
  note_deceleration(sample.time_s, sample.v_x_m_s);
  if (rig::any(braking)) note_braking(sample, braking, since_brake_s);
  last_time_s = sample.time_s;
  const auto stops = !stop_known() && since_brake_s > 0.0 && sample.v_x_m_s < end_speed_m_s_;
  stop_time_s = rig::select(stops, since_brake_s, stop_time_s);
  stop_distance_m = rig::select(stops, sample.distance_m, stop_distance_m);
}

template <class S>
template <class Condition>
void BrakingFigures<S>::note_braking(const BrakingSample<S>& sample, const Condition& braking,
                                     const S& since_brake_s) noexcept {
  // A wheel below a twentieth of the car's speed can be steered no better than a locked one.
  constexpr double locked_slip = 0.95;

  const S variation_Nm = torque_total_variation_Nm + rig::magnitude(S(sample.torque_ref_Nm - last_torque_Nm_));
  torque_total_variation_Nm =
      rig::select(braking, rig::select(rig::is_nan(last_torque_Nm_), S(0.0), variation_Nm), torque_total_variation_Nm);
  last_torque_Nm_ = rig::select(braking, sample.torque_ref_Nm, last_torque_Nm_);
  // Slower than this the slip dynamics stiffen as 1 / v_x and the paper calls the performance "no longer relevant".
  const auto judged = braking && sample.v_x_m_s > least_judged_speed_m_s;
  if (!rig::any(judged)) return;

  const S slip_error = sample.slip - sample.slip_ref;
  const S over = rig::select(slip_error > 0.0, slip_error, S(0.0));
  const auto further = judged && (rig::is_nan(slip_overshoot) || slip_overshoot < over);
  slip_overshoot = rig::select(further, over, slip_overshoot);
  const auto largest = judged && (rig::is_nan(slip_largest) || slip_largest < sample.slip);
  slip_largest = rig::select(largest, sample.slip, slip_largest);
  time_locked_s = rig::select(judged && rig::is_nan(time_locked_s), S(0.0), time_locked_s);
  const auto locked = judged && sample.slip > locked_slip && !rig::is_nan(last_time_s);
  time_locked_s = rig::select(locked, S(time_locked_s + (sample.time_s - last_time_s)), time_locked_s);
  const auto near = rig::magnitude(slip_error) <= slip_band;
  slip_reached_s = rig::select(judged && near && rig::is_nan(slip_reached_s), since_brake_s, slip_reached_s);
  slip_settling.observe(judged, since_brake_s, near);
  theta_final_N = rig::select(judged, sample.theta_est_N, theta_final_N);
  const S theta_relative = sample.theta_est_N / sample.theta_N - 1.0;
  theta_error_final = rig::select(judged, theta_relative, theta_error_final);
  const auto counted = judged && since_brake_s > rms_start_s;
  slip_square_sum = rig::select(counted, S(slip_square_sum + slip_error * slip_error), slip_square_sum);
  theta_square_sum = rig::select(counted, S(theta_square_sum + theta_relative * theta_relative), theta_square_sum);
  samples = rig::select(counted, S(samples + 1.0), samples);
  const S theta_error_N = rig::magnitude(S(sample.theta_est_N - sample.theta_N));
  const auto worse = counted && (rig::is_nan(theta_error_max_N) || theta_error_max_N < theta_error_N);
  theta_error_max_N = rig::select(worse, theta_error_N, theta_error_max_N);
  theta_settling.observe(judged, since_brake_s, theta_error_N <= theta_band * sample.theta_N);
}

template <class S>
void BrakingFigures<S>::note_deceleration(const S& time_s, const S& v_x_m_s) noexcept {
  constexpr double interval_s = 0.01;
  const auto over = !(time_s - interval_start_s_ < interval_s);
  if (!rig::any(over)) return;
  const S deceleration = (interval_start_m_s_ - v_x_m_s) / (time_s - interval_start_s_);
  deceleration_m_s2 = rig::select(over && !rig::is_nan(interval_start_s_), deceleration, deceleration_m_s2);
  interval_start_s_ = rig::select(over, time_s, interval_start_s_);
  interval_start_m_s_ = rig::select(over, v_x_m_s, interval_start_m_s_);
}

}  // namespace abs_hil::analysis
