// Windows of readings: mean speeds and commands over some 2 ms; stale readings and leaps are faults.
#include "runtime/speed_window.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::runtime {

namespace {
// docs/safety.md, "Where the bounds come from", derives these.
constexpr std::int64_t window_per_stamp_error = 4;  ///< a speed that its stamps make less certain is not judged
constexpr double resolution_max_rad_s = 40.0;       ///< nor is one that its counts resolve less well
/// Fewer stale cycles in a row are no fault: a single delayed answer must pass, however long it took.
constexpr int stale_cycles_max = 5;
/// Added to the time since the previous measurement: no counter moves faster than twice the overspeed in this time.
constexpr double leap_slack_s = 1e-3;

/// True for |travel| > most, also for the travel that has no negative counterpart.
bool beyond(std::int32_t travel, std::int32_t most) noexcept {
  const auto range = static_cast<std::uint32_t>(most);
  return static_cast<std::uint32_t>(travel) + range > 2U * range;
}
}  // namespace

SpeedWindows::SpeedWindows(const PlausibilityLimits& limits)
    : limits_(limits),
      delay_(limits.ideal_actuator ? rig::BrakeDelay() : rig::BrakeDelay(limits.brake)),
      most_counts_per_s_(limits.enabled ? 2.0 * limits.overspeed_rad_s / limits.rad_per_count : 0.0),
      sure_counts_(static_cast<std::int32_t>(resolution_counts + most_counts_per_s_ * leap_slack_s)),
      resolving_ns_(static_cast<std::int64_t>(resolution_counts * limits.rad_per_count / resolution_max_rad_s *
                                              static_cast<double>(rig::ns_per_s))) {}

void SpeedWindows::begin(const rig::Measurement& measurement) noexcept {
  begin_ns_ = measurement.time_ns;
  begin_error_ns_ = stamp_error_ns_;
  begin_upper_ = measurement.upper_counts;
  begin_lower_ = measurement.lower_counts;
  brake_impulse_Nms_ = 0.0;
  motor_duty_s_ = 0.0;
}

bool SpeedWindows::fresh(std::int64_t stamp_ns, std::int64_t now_ns) noexcept {
  const bool recent = std::abs(static_cast<double>(now_ns - stamp_ns)) * rig::s_per_ns <= limits_.sample_age_max_s;
  if (!recent || (started_ && stamp_ns <= stamp_ns_)) {
    ++stale_cycles_;
    return false;
  }
  stale_cycles_ = 0;
  fresh_ns_ = now_ns;
  return true;
}

double SpeedWindows::impulse_Nms(const rig::Command& sent, double time_s) noexcept {
  if (limits_.ideal_actuator) return sent.brake_torque_Nm * time_s;
  if (!delay_.any()) [[likely]]
    return rig::brake_torque_at(limits_.brake, sent.brake_duty) * time_s;
  double sum_Nms = 0.0;
  delay_.send(sent.brake_duty);
  delay_.pass(time_s,
              [&](double duty, double part_s) { sum_Nms += rig::brake_torque_at(limits_.brake, duty) * part_s; });
  return sum_Nms;
}

[[gnu::cold]] CheckResult SpeedWindows::leaps(std::int32_t upper_travel, std::int32_t lower_travel,
                                              double since_s) const noexcept {
  const double most_counts = resolution_counts + most_counts_per_s_ * (since_s + leap_slack_s);
  const auto leap = [&](std::int32_t travel) { return std::abs(static_cast<double>(travel)) > most_counts; };
  if (leap(upper_travel)) return {rig::Reason::encoder_upper_jumped, upper_travel * limits_.rad_per_count};
  if (leap(lower_travel)) return {rig::Reason::encoder_lower_jumped, lower_travel * limits_.rad_per_count};
  return {};
}

CheckResult SpeedWindows::update(const rig::Measurement& measurement, std::int64_t now_ns, const rig::Command& sent,
                                 std::int64_t reading_ns) noexcept {
  complete_ = false;
  usable_ = fresh(measurement.time_ns, now_ns);
  overdue_ = !usable_;
  if (!usable_) {
    const double missing_s = static_cast<double>(now_ns - fresh_ns_) * rig::s_per_ns;
    const bool lost = stale_cycles_ >= stale_cycles_max && missing_s >= limits_.sample_age_max_s;
    return lost ? CheckResult{rig::Reason::samples_missing, missing_s} : CheckResult{};
  }
  const double since_s = static_cast<double>(measurement.time_ns - stamp_ns_) * rig::s_per_ns;
  const std::int32_t upper_before = std::exchange(upper_, measurement.upper_counts);
  const std::int32_t lower_before = std::exchange(lower_, measurement.lower_counts);
  const std::int64_t error_before_ns =
      std::exchange(stamp_error_ns_, rig::stamp_error_ns(measurement.time_ns, now_ns, reading_ns));
  stamp_ns_ = measurement.time_ns;
  if (!started_) {
    started_ = true;
    begin(measurement);
    return {};
  }
  brake_impulse_Nms_ += impulse_Nms(sent, since_s);
  motor_duty_s_ += sent.motor_duty * since_s;
  const std::int32_t upper_travel = rig::counts_between(upper_before, upper_);
  const std::int32_t lower_travel = rig::counts_between(lower_before, lower_);
  if (beyond(upper_travel, sure_counts_) || beyond(lower_travel, sure_counts_)) {
    const double errors_s = static_cast<double>(error_before_ns + stamp_error_ns_) * rig::s_per_ns;
    const CheckResult leap = leaps(upper_travel, lower_travel, since_s + errors_s);
    usable_ = leap.sound();
    if (!usable_) return leap;
  }

  const std::int64_t dt_ns = measurement.time_ns - begin_ns_;
  if (dt_ns < least_speed_window_ns) return {};
  const std::int64_t sure_ns = window_per_stamp_error * (begin_error_ns_ + stamp_error_ns_);
  overdue_ = dt_ns < std::max(resolving_ns_, sure_ns);
  if (overdue_) return {};
  const double dt_s = static_cast<double>(dt_ns) * rig::s_per_ns;
  speed_window_ = speed_window_over<double>(
      dt_s, limits_.rad_per_count, rig::counts_between(begin_upper_, measurement.upper_counts),
      rig::counts_between(begin_lower_, measurement.lower_counts), brake_impulse_Nms_, motor_duty_s_);
  speed_window_.motor_stall_Nm =
      rig::stall_torque_Nm(limits_.motor, speed_window_.omega2_rad_s) * speed_window_.motor_duty;
  speed_window_.begin_error_s = static_cast<double>(begin_error_ns_) * rig::s_per_ns;
  speed_window_.end_error_s = static_cast<double>(stamp_error_ns_) * rig::s_per_ns;
  complete_ = true;
  begin(measurement);
  return {};
}

}  // namespace abs_hil::runtime
