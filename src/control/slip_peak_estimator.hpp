// The slip of the largest tyre force from pairs of slip and force: an extended Kalman filter (docs/theory-beyond.md).
//
// l is the slip as read, F the force, N. Unknowns: ln Fp (Fp: peak force, N), ln w (w: width), the shape c, and the
// zero z of the slip reading, which is -z where no force acts.
//
//   curve       F = Fp g(x),  g(x) = (2 + c) x / D,  D = 1 + c |x| + x^2,  x = (l + z) / w;  the peak is at x = 1
//   gradient    dF/d ln Fp = Fp g,  dF/d ln w = -Fp x g',  dF/dc = Fp x (1 - |x|)^2 / D^2,  dF/dz = Fp g' / w
//               with g' = (2 + c) (1 - x^2) / D^2
//   prediction  P += h diag(force_drift_per_s, slip_drift_per_s, shape_drift_per_s, 0)      h: time step, s
//   update      S = G P G' + R,  R = force_noise_N2_s times the control rate,  r = F - Fp g,
//               unknowns += P G' r / S,  P -= (P G') (P G')' / S
//   jump        |F - F(15 ms ago) - (curve(l) - curve(l 15 ms ago))| > max(3 N, Fp (jump_level + |l - l ago| / w))
//
// g is the simplest curve that rises to a peak and falls after it, more slowly for larger c. It is not the plant's.
#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/scalar.hpp"
#include "rig/lane_array.hpp"

namespace abs_hil::control {

/// Estimates the slip of the largest tyre force by the equations above. The level drifts fastest, so the filter learns
/// the peak's slip from the response of the force to the search, not from the level of the force. After a jump of
/// friction it learns the level again, for `jump_hold_s` only the level, and discards what it learnt in the last 30 ms.
/// `reset` and `update` are real-time safe.
template <class S>
class BasicSlipPeakEstimator {
 public:
  BasicSlipPeakEstimator() = default;
  /// @param slip_min, slip_max  bounds of `width`; 0 < slip_min < slip_max
  /// @param rate_Hz  control cycles per second, > 0
  /// Throws std::invalid_argument for options out of range.
  BasicSlipPeakEstimator(const SlipPeakOptions<>& options, double slip_min, double slip_max, double rate_Hz);

  void reset() noexcept;
  /// One measured pair, both of the same time, `dt_s` > 0 after the previous pair.
  void update(const S& dt_s, const S& slip, const S& force_N) noexcept;

  [[nodiscard]] S peak_force_N() const noexcept { return peak_force_N_; }
  /// Measured slip at which the force peaks.
  [[nodiscard]] S peak_slip() const noexcept { return width_ - state_[zero]; }
  /// The curve and its slope at a measured slip.
  [[nodiscard]] S force_N(const S& slip) const noexcept { return peak_force_N_ * curve_at(slip).value; }
  [[nodiscard]] S force_slope_N(const S& slip) const noexcept { return peak_force_N_ / width_ * curve_at(slip).slope; }
  /// Jumps of friction found since the last `reset`.
  [[nodiscard]] S jumps() const noexcept { return jumps_; }

 private:
  enum Index : std::size_t { log_force, log_width, shape, zero };
  using State = std::array<S, 4>;
  /// The curve for Fp = 1.
  struct CurvePoint {
    S x;
    S value;
    S slope;     ///< by x
    S by_shape;  ///< derivative by c
  };
  /// Of the kept samples, which reach back over 30 ms: at any rate at most 45, the newest, and a place for the next.
  static constexpr std::size_t room = 47;
  using Ring = std::array<S, room>;

  // Initial standard deviations of the logarithms, the shape and the slip's zero.
  static constexpr double log_force_spread = 1.0;
  static constexpr double log_width_spread = 0.6;
  static constexpr double shape0 = 1.0;
  static constexpr double shape_spread = 1.0;
  static constexpr double zero_spread = 0.01;
  // Bounds of the unknowns. The controller gives the bounds of the width.
  static constexpr double log_force_max = 7.0;
  static constexpr double shape_min = -0.5;
  static constexpr double shape_max = 20.0;
  static constexpr double zero_max = 0.03;
  // Jumps of friction.
  static constexpr double jump_least_N = 3.0;       ///< three standard deviations of the force estimate
  static constexpr double jump_force_spread = 0.5;  ///< of the logarithm of the level after a jump
  /// Jumps are detected only once the level is known to this accuracy.
  static constexpr double level_known_spread = 0.12;

  [[nodiscard]] CurvePoint curve_at(const S& slip) const noexcept;
  template <class Condition>
  void keep(const Condition& where, const S& slip, const S& force_N) noexcept;
  /// Place of the sample that was kept `back` samples before the newest, or of the oldest.
  [[nodiscard]] S kept(const S& back) const noexcept;
  [[nodiscard]] auto jumped(const S& slip, const S& force_N) const noexcept;
  template <class Condition>
  void start_over_after_jump(const Condition& where) noexcept;
  template <class Condition>
  void learn(const Condition& where, const Condition& level_only, const S& slip, const S& force_N) noexcept;
  /// Limits the unknowns, and computes what they give.
  void conclude() noexcept;

  SlipPeakOptions<S> options_{};
  S log_force0_{0.0};
  S log_width0_{0.0};
  S log_slip_min_{0.0};
  S log_slip_max_{0.0};
  S sample_variance_N2_{0.0};  ///< of one pair, scaled so that the information per second does not depend on the rate
  S decimation_{1.0};          ///< cycles between kept samples, 1 ms or one cycle
  S window_{1.0};              ///< kept samples in 15 ms and in 30 ms
  S rollback_{1.0};
  State state_{};
  std::array<State, 4> covariance_{};
  S peak_force_N_{0.0};
  S width_{1.0};
  Ring kept_slip_{};
  Ring kept_force_N_{};
  Ring kept_log_width_{};
  Ring kept_shape_{};
  S newest_{0.0};  ///< place in the rings
  S kept_count_{0.0};
  S until_kept_{0.0};  ///< cycles
  S hold_s_{0.0};
  S jumps_{0.0};
};
using SlipPeakEstimator = BasicSlipPeakEstimator<double>;

template <class S>
void BasicSlipPeakEstimator<S>::reset() noexcept {
  state_ = {log_force0_, log_width0_, S(shape0), S(0.0)};
  covariance_ = {};
  covariance_[log_force][log_force] = S(log_force_spread * log_force_spread);
  covariance_[log_width][log_width] = S(log_width_spread * log_width_spread);
  covariance_[shape][shape] = S(shape_spread * shape_spread);
  covariance_[zero][zero] = S(zero_spread * zero_spread);
  conclude();
  kept_count_ = until_kept_ = hold_s_ = jumps_ = S(0.0);
}

template <class S>
void BasicSlipPeakEstimator<S>::update(const S& dt_s, const S& slip, const S& force_N) noexcept {
  if (!rig::any(dt_s > 0.0)) return;
  covariance_[log_force][log_force] += options_.force_drift_per_s * dt_s;
  covariance_[log_width][log_width] += options_.slip_drift_per_s * dt_s;
  covariance_[shape][shape] += options_.shape_drift_per_s * dt_s;
  const auto holds = hold_s_ > 0.0;
  hold_s_ = rig::select(holds, S(hold_s_ - dt_s), hold_s_);
  keep(!holds, slip, force_N);
  const auto jumps = !holds && jumped(slip, force_N);
  if (rig::any(jumps)) start_over_after_jump(jumps);
  learn(!jumps, holds, slip, force_N);
  conclude();
}

template <class S>
typename BasicSlipPeakEstimator<S>::CurvePoint BasicSlipPeakEstimator<S>::curve_at(const S& slip) const noexcept {
  const S x = (slip + state_[zero]) / width_;
  const S c = state_[shape];
  const S a = rig::magnitude(x);
  const S per_d = 1.0 / (1.0 + c * a + a * a);
  return {.x = x,
          .value = (2.0 + c) * x * per_d,
          .slope = (2.0 + c) * (1.0 - a * a) * (per_d * per_d),
          .by_shape = x * (1.0 - a) * (1.0 - a) * (per_d * per_d)};
}

template <class S>
template <class Condition>
void BasicSlipPeakEstimator<S>::keep(const Condition& where, const S& slip, const S& force_N) noexcept {
  const auto keeps = where && !(until_kept_ > 0.0);
  until_kept_ = rig::select(where, rig::select(keeps, S(decimation_ - 1.0), S(until_kept_ - 1.0)), until_kept_);
  if (!rig::any(keeps)) return;
  const S next = rig::select(newest_ < static_cast<double>(room - 1), S(newest_ + 1.0), S(0.0));
  newest_ = rig::select(keeps, next, newest_);
  kept_count_ = rig::select(keeps, S(kept_count_ + 1.0), kept_count_);
  // In lanes, a sample that is not kept goes to the place of the next one.
  rig::put_element(kept_slip_, next, slip);
  rig::put_element(kept_force_N_, next, force_N);
  rig::put_element(kept_log_width_, next, state_[log_width]);
  rig::put_element(kept_shape_, next, state_[shape]);
}

template <class S>
S BasicSlipPeakEstimator<S>::kept(const S& back) const noexcept {
  const S place = newest_ - rig::smaller(back, rig::larger(S(kept_count_ - 1.0), S(0.0)));
  return rig::select(place < 0.0, S(place + static_cast<double>(room)), place);
}

template <class S>
auto BasicSlipPeakEstimator<S>::jumped(const S& slip, const S& force_N) const noexcept {
  const auto level_known = covariance_[log_force][log_force] < level_known_spread * level_known_spread;
  const S past = kept(window_);
  const S past_slip = rig::element(kept_slip_, past);
  const S past_force_N = rig::element(kept_force_N_, past);
  const S unexplained = force_N - past_force_N - (this->force_N(slip) - this->force_N(past_slip));
  // The curve is least accurate for long moves along it.
  const S trusted = options_.jump_level + rig::magnitude(S(slip - past_slip)) / width_;
  return level_known && kept_count_ > window_ &&
         rig::magnitude(unexplained) > rig::larger(S(jump_least_N), S(peak_force_N_ * trusted));
}

template <class S>
template <class Condition>
void BasicSlipPeakEstimator<S>::start_over_after_jump(const Condition& where) noexcept {
  const S before = kept(rollback_);
  state_[log_width] = rig::select(where, rig::element(kept_log_width_, before), state_[log_width]);
  state_[shape] = rig::select(where, rig::element(kept_shape_, before), state_[shape]);
  for (std::size_t i = 0; i < state_.size(); ++i) {
    const S variance = i == log_force ? S(jump_force_spread * jump_force_spread) : S(0.0);
    covariance_[log_force][i] = rig::select(where, variance, covariance_[log_force][i]);
    covariance_[i][log_force] = covariance_[log_force][i];
  }
  hold_s_ = rig::select(where, options_.jump_hold_s, hold_s_);
  kept_count_ = rig::select(where, S(0.0), kept_count_);
  until_kept_ = rig::select(where, S(0.0), until_kept_);
  jumps_ = rig::select(where, S(jumps_ + 1.0), jumps_);
}

template <class S>
template <class Condition>
void BasicSlipPeakEstimator<S>::learn(const Condition& where, const Condition& level_only, const S& slip,
                                      const S& force_N) noexcept {
  const CurvePoint c = curve_at(slip);
  const S residual = force_N - peak_force_N_ * c.value;
  const State gradient{peak_force_N_ * c.value, -peak_force_N_ * c.x * c.slope, peak_force_N_ * c.by_shape,
                       peak_force_N_ * c.slope / width_};
  State reach{};
  S variance = sample_variance_N2_;
  for (std::size_t i = 0; i < reach.size(); ++i) {
    for (std::size_t j = 0; j < reach.size(); ++j) reach[i] += covariance_[i][j] * gradient[j];
    variance += gradient[i] * reach[i];
  }
  const S per_variance = 1.0 / variance;
  // What it does not learn, the residual does not reach.
  for (std::size_t i = 0; i < reach.size(); ++i) {
    reach[i] = rig::select(i == log_force ? where : where && !level_only, reach[i], S(0.0));
    state_[i] += reach[i] * per_variance * residual;
  }
  for (std::size_t i = 0; i < reach.size(); ++i) {
    for (std::size_t j = 0; j < reach.size(); ++j) covariance_[i][j] -= reach[i] * reach[j] * per_variance;
  }
}

template <class S>
void BasicSlipPeakEstimator<S>::conclude() noexcept {
  state_[log_force] = rig::clamped(state_[log_force], S(0.0), S(log_force_max));
  state_[log_width] = rig::clamped(state_[log_width], log_slip_min_, log_slip_max_);
  state_[shape] = rig::clamped(state_[shape], S(shape_min), S(shape_max));
  state_[zero] = rig::clamped(state_[zero], S(-zero_max), S(zero_max));
  peak_force_N_ = rig::exponential(state_[log_force]);
  width_ = rig::exponential(state_[log_width]);
}

}  // namespace abs_hil::control
