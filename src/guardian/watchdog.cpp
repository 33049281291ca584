// Decides from heartbeats and stages when outputs must be made safe.
#include "guardian/watchdog.hpp"

#include <algorithm>

namespace abs_hil::guardian {

void Watchdog::measure_silence(const HeartbeatReading& reading) noexcept {
  const std::int64_t since_last_look_ns =
      last_look_ns_ < 0 ? 0 : std::min(reading.now_ns - last_look_ns_, 2 * look_period_ns_);
  const bool beat = reading.cycle_beats != last_beats_;
  silence_ns_ = beat ? 0 : silence_ns_ + since_last_look_ns;
  if (reading.taken_back_for != rig::Reason::none) asked_back_ns_ += since_last_look_ns;
  last_look_ns_ = reading.now_ns;
  last_beats_ = reading.cycle_beats;
}

std::int64_t Watchdog::patience_ns(const HeartbeatReading& reading) const noexcept {
  if (reading.stage == Stage::making_safe) return timeout_ns_ + making_safe_ns_;
  return reading.cycle_beats == 0 ? std::max(timeout_ns_, first_beat_ns) : timeout_ns_;
}

Verdict Watchdog::look(const HeartbeatReading& reading) noexcept {
  if (reason_ != rig::Reason::none) return died_released_ ? Verdict::dismissed : Verdict::make_safe;
  measure_silence(reading);
  if (reading.stage == Stage::closed || reading.stage == Stage::resting) return Verdict::dismissed;
  if (reading.stage == Stage::handed_over) {
    reason_ = rig::Reason::safe_state_unverified;
    return Verdict::make_safe;
  }
  if (reading.controller_gone) {
    reason_ = rig::Reason::controller_died;
    died_released_ = reading.stage == Stage::released;
    return died_released_ ? Verdict::dismissed : Verdict::make_safe;
  }
  if (reading.taken_back_for != rig::Reason::none) {
    // The controller has made the outputs safe. The guardian verifies it with its own handle.
    const bool given_back = reading.stage == Stage::released;
    const std::int64_t limit_ns = timeout_ns_ + (reading.stage == Stage::making_safe ? making_safe_ns_ : 0);
    if (!given_back && asked_back_ns_ < limit_ns) return Verdict::wait;
    reason_ = reading.taken_back_for;
    return Verdict::make_safe;
  }
  // Any number that is no stage counts as `guarded`.
  if (reading.stage != Stage::released && silence_ns_ >= patience_ns(reading)) {
    reason_ = rig::Reason::controller_silent;
    return Verdict::make_safe;
  }
  return Verdict::wait;
}

}  // namespace abs_hil::guardian
