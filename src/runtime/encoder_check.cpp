// Judges each reading of the encoders: can the wheels have done this, and do they turn at all?
#include "runtime/encoder_check.hpp"

#include <array>
#include <cmath>

namespace abs_hil::runtime {

namespace {

using rig::Reason;

// docs/safety.md, "Where the bounds come from", derives these.
constexpr int outside_max = 3;           ///< number of speed windows
constexpr double standing_max_s = 0.25;  ///< a released wheel turns within this time, however it was braked
constexpr double disagreement_s = 0.1;
constexpr double ahead_max_s = 0.05;

/// One reason for each SpeedInterval::Verdict.
using Reasons = std::array<Reason, 5>;
constexpr Reasons upper_reasons{Reason::none, Reason::encoder_upper_stuck, Reason::encoder_upper_reversed,
                                Reason::encoder_upper_jumped, Reason::overspeed};
constexpr Reasons lower_reasons{Reason::none, Reason::encoder_lower_stuck, Reason::encoder_lower_reversed,
                                Reason::encoder_lower_jumped, Reason::overspeed};

Reason reason_of(SpeedInterval::Verdict verdict, const Reasons& reasons) noexcept {
  return reasons[static_cast<std::size_t>(verdict)];
}

}  // namespace

SpeedInterval::Verdict SpeedInterval::update(double omega_rad_s, double resolution_rad_s, double dt_s,
                                             double stamp_error_s) noexcept {
  const double slack_rad_s = SpeedBounds<double>::slack_rad_s(omega_rad_s, resolution_rad_s, dt_s, stamp_error_s);
  if (bounds_.take(omega_rad_s, slack_rad_s, dt_s)) {
    outside_ = 0;
    too_fast_ = std::abs(omega_rad_s) - slack_rad_s > fastest_rad_s_ ? too_fast_ + 1 : 0;
    return too_fast_ < outside_max ? Verdict::sound : Verdict::too_fast;
  }
  ++outside_;
  if (outside_ < outside_max) return Verdict::sound;
  if (omega_rad_s < -slack_rad_s) return Verdict::reversed;
  return omega_rad_s <= slack_rad_s ? Verdict::stuck : Verdict::jumped;
}

EncoderCheck::EncoderCheck(const PlausibilityLimits& limits) noexcept
    : limits_(limits),
      upper_(limits.upper_gain_rad_s2, limits.upper_loss_rad_s2, limits.overspeed_rad_s),
      lower_(limits.lower_gain_rad_s2, limits.lower_loss_rad_s2, limits.overspeed_rad_s),
      watch_(limits) {}

/// Flattened (all calls inlined): the calls would cost a tenth of its time.
[[gnu::flatten]] CheckResult EncoderCheck::update(const SpeedWindow& speed_window) noexcept {
  watch_.expect_brake(speed_window);
  CheckResult result = judge_speeds(speed_window);
  if (!compares_) [[unlikely]]
    return result.sound() ? judge_parted(speed_window) : result;
  if (result.sound()) result = judge_standing(speed_window);
  if (result.sound()) result = judge_rolling(speed_window);
  if (result.sound()) result = judge_slip(speed_window);
  return result;
}

void EncoderCheck::note_wheels_apart(bool apart) noexcept {
  compares_ = false;
  apart_ = apart;
  together_s_ = standing_s_ = standing_rad_ = 0.0;
  disagreeing_.lasted_s = ahead_.lasted_s = 0.0;
}

/// While the wheels are apart each has a speed of its own. Once they are joined, a standing wheel is spun up at once,
/// but until both roll their speeds differ.
CheckResult EncoderCheck::judge_parted(const SpeedWindow& speed_window) noexcept {
  if (apart_) return {};
  together_s_ += speed_window.dt_s;
  compares_ = together_s_ >= watch_.rolled_after_s;
  return judge_standing(speed_window);
}

CheckResult EncoderCheck::judge_speeds(const SpeedWindow& speed_window) noexcept {
  using Verdict = SpeedInterval::Verdict;
  const double error_s = speed_window.stamp_error_s();
  const Verdict upper =
      upper_.update(speed_window.omega1_rad_s, speed_window.resolution_rad_s, speed_window.dt_s, error_s);
  const Verdict lower =
      lower_.update(speed_window.omega2_rad_s, speed_window.resolution_rad_s, speed_window.dt_s, error_s);
  const bool both_doubtful = upper_.doubtful() && lower_.doubtful();
  if (both_doubtful && (upper == Verdict::stuck || lower == Verdict::stuck)) return {Reason::encoders_lost, 0.0};
  if (upper != Verdict::sound) return {reason_of(upper, upper_reasons), speed_window.omega1_rad_s};
  return {reason_of(lower, lower_reasons), speed_window.omega2_rad_s};
}

CheckResult EncoderCheck::judge_standing(const SpeedWindow& speed_window) noexcept {
  if (watch_.not_standing(speed_window)) {
    standing_s_ = standing_rad_ = 0.0;
    return {};
  }
  standing_s_ += speed_window.dt_s;
  standing_rad_ += speed_window.omega1_rad_s * speed_window.dt_s;
  if (watch_.moved(speed_window, standing_rad_)) {
    standing_s_ = standing_rad_ = 0.0;
    return {};
  }
  if (standing_s_ < standing_max_s) return {};
  return {Reason::released_wheel_stands, standing_s_};
}

void Travelled::add(const SpeedWindow& speed_window, const rig::WheelParameters& wheels) noexcept {
  if (lasted_s == 0.0) *this = {.begin_error_s = speed_window.begin_error_s};
  end_error_s = speed_window.end_error_s;
  resolution_rad = speed_window.resolution_rad_s * speed_window.dt_s;
  lasted_s += speed_window.dt_s;
  upper_m += wheels.r1_m * speed_window.omega1_rad_s * speed_window.dt_s;
  lower_m += wheels.r2_m * speed_window.omega2_rad_s * speed_window.dt_s;
}

CheckResult EncoderCheck::judge_rolling(const SpeedWindow& speed_window) noexcept {
  if (watch_.quiet_rolling(speed_window)) {
    disagreeing_.lasted_s = 0.0;
    return {};
  }
  const double v1_m_s = limits_.wheels.r1_m * speed_window.omega1_rad_s;
  const double v2_m_s = limits_.wheels.r2_m * speed_window.omega2_rad_s;
  if (disagreeing_.lasted_s == 0.0) allowed_m_ = 0.0;
  disagreeing_.add(speed_window, limits_.wheels);
  allowed_m_ += watch_.allowed_m_s(speed_window) * speed_window.dt_s;
  const double apart_m = std::abs(disagreeing_.upper_m - disagreeing_.lower_m);
  if (apart_m <= allowed_m_) {  // so far there is no sign of a disagreement
    disagreeing_.lasted_s = 0.0;
    return {};
  }
  const double stamps_m =
      (std::abs(disagreeing_.upper_m) + std::abs(disagreeing_.lower_m)) * disagreeing_.stamp_share();
  if (disagreeing_.lasted_s < disagreement_s || apart_m <= allowed_m_ + stamps_m) return {};
  if (speed_window.omega1_rad_s == 0.0) return {Reason::encoder_upper_stuck, speed_window.omega1_rad_s};
  if (speed_window.omega2_rad_s == 0.0) return {Reason::encoder_lower_stuck, speed_window.omega2_rad_s};
  return {Reason::encoders_disagree, v1_m_s - v2_m_s};
}

CheckResult EncoderCheck::judge_slip(const SpeedWindow& speed_window) noexcept {
  if (watch_.quiet_slip(speed_window)) {
    ahead_.lasted_s = 0.0;
    return {};
  }
  constexpr double fastest = WheelWatch<double>::fastest;
  const double v1_m_s = limits_.wheels.r1_m * speed_window.omega1_rad_s;
  const double v2_m_s = limits_.wheels.r2_m * speed_window.omega2_rad_s;
  ahead_.add(speed_window, limits_.wheels);
  const double ahead_m = ahead_.upper_m - fastest * ahead_.lower_m;
  if (ahead_m <= 0.0) {  // so far there is no sign that the braked wheel is ahead
    ahead_.lasted_s = 0.0;
    return {};
  }
  const double stamps_m = (ahead_.upper_m + fastest * ahead_.lower_m) * ahead_.stamp_share();
  const double counts_m = (limits_.wheels.r1_m + fastest * limits_.wheels.r2_m) * ahead_.resolution_rad;
  if (ahead_.lasted_s < ahead_max_s || ahead_m <= stamps_m + counts_m) return {};
  return {Reason::slip_implausible, 1.0 - v1_m_s / v2_m_s};
}

}  // namespace abs_hil::runtime
