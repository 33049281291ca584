#include "guardian/watchdog.hpp"

#include <algorithm>

namespace abs_hil::guardian {

void Watchdog::listen(const HeartbeatReading& sight) noexcept {
  const std::int64_t since_last_look_ns = std::min(sight.now_ns - last_look_ns_, 2 * look_period_ns_);
  const bool life = sight.cycle_beats != last_beats_;
  // Before the first cycle nothing can be driven, and there is nothing to be heard.
  silence_ns_ = life || sight.cycle_beats == 0 ? 0 : silence_ns_ + since_last_look_ns;
  last_look_ns_ = sight.now_ns;
  last_beats_ = sight.cycle_beats;
}

Verdict Watchdog::look(const HeartbeatReading& sight) noexcept {
  if (reason_ != rig::Reason::none) return Verdict::make_safe;
  listen(sight);
  if (sight.stage == Stage::closed) return Verdict::dismissed;
  if (sight.stage == Stage::handed_over) {
    reason_ = rig::Reason::safe_state_unverified;
    return Verdict::make_safe;
  }
  if (sight.controller_gone) {
    reason_ = rig::Reason::controller_died;
    return sight.stage == Stage::released ? Verdict::dismissed : Verdict::make_safe;
  }
  const bool silent = sight.stage == Stage::guarded       ? silence_ns_ >= timeout_ns_
                      : sight.stage == Stage::making_safe ? silence_ns_ >= timeout_ns_ + making_safe_ns_
                                                          : false;
  if (silent) {
    reason_ = rig::Reason::controller_silent;
    return Verdict::make_safe;
  }
  return Verdict::wait;
}

}  // namespace abs_hil::guardian
