// The step of commissioning that has a person pull the cable that the board watches.

#include <cmath>

#include "abs_hil/rig/time_units.hpp"
#include "experiment/commissioning.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::experiment {

using rig::formatted;

bool Commissioning::drive_until_silent(WheelCounts& before) {
  constexpr std::int64_t longest_ns = 30 * rig::ns_per_s;
  constexpr std::int64_t window_ns = rig::ns_per_s / 10;
  rig::Measurement now;
  rig::Measurement mark;
  const std::int64_t end_ns = clock_.now_ns() + longest_ns;
  for (std::int64_t tick_ns = clock_.now_ns(); tick_ns < end_ns && !stop_requested_(); tick_ns += cycle_ns) {
    clock_.sleep_until(tick_ns);
    if (!guard_.beat()) {
      dialog_.tell("FAILED: the guardian process has ended; the drive was stopped");
      return false;
    }
    const driver::IoResult result = driver_.read(clock_.now_ns(), now);
    if (result.error == driver::IoError::no_answer) return true;
    if (const driver::IoResult io =
            result.ok() ? driver_.write({.motor_duty = options_.drive_duty, .motor_enable = true}) : result;
        !io.ok()) {
      dialog_.tell("FAILED: " + reason_and_error(io));
      return false;
    }
    if (now.time_ns - mark.time_ns < window_ns) continue;
    before = travel_between(mark, now);
    mark = now;
  }
  if (!stop_requested_()) dialog_.tell("FAILED: the cable was not pulled, or the board works without it");
  return false;
}

bool Commissioning::await_board() {
  rig::Measurement ignored;
  const std::int64_t end_ns = clock_.now_ns() + std::llround(run_out_limit_s / rig::s_per_ns);
  for (std::int64_t tick_ns = clock_.now_ns(); tick_ns < end_ns && !stop_requested_(); tick_ns += cycle_ns) {
    clock_.sleep_until(tick_ns);
    if (!guard_.beat()) return false;
    if (driver_.read(clock_.now_ns(), ignored).error != driver::IoError::no_answer) return true;
  }
  if (!stop_requested_()) dialog_.tell("FAILED: the board does not answer again");
  return false;
}

bool Commissioning::counts_in_0_1_s(WheelCounts& travel) {
  rig::Measurement first;
  rig::Measurement last;
  if (!read_fresh(first)) return false;
  clock_.sleep_until(clock_.now_ns() + rig::ns_per_s / 10);
  if (!read_fresh(last)) return false;
  travel = travel_between(first, last);
  return true;
}

CommissioningResult Commissioning::pull_cable() {
  const std::string cable(driver_.watched_cable());
  if (cable.empty()) return CommissioningResult::passed;
  if (!agrees(step(4) +
              formatted("the drive gets duty %.2f until you pull the %s. The wheels must then coast. If they go "
                        "faster, press the E-stop at once: the outputs have the wrong polarity. Close the cover, "
                        "stand clear, one hand at the cable and one at the E-stop. Go on?",
                        options_.drive_duty, cable.c_str()))) {
    return CommissioningResult::declined;
  }
  guard_.begin();
  dialog_.tell("Pull the " + cable + " now, at the board. Plug it in again after a second or two.");
  WheelCounts before;
  const bool back = drive_until_silent(before) && await_board();
  const driver::IoResult ended = driver_.deactivate();
  guard_.end(ended.ok());
  if (stop_requested_()) return CommissioningResult::interrupted;
  if (!back || !ended.ok()) return CommissioningResult::failed;
  driver_.configure();
  WheelCounts after;
  if (!activate_and_rest() || !counts_in_0_1_s(after)) return CommissioningResult::failed;
  if (after.lower > before.lower + still_counts / 4) {
    dialog_.tell(
        formatted("FAILED: the lower wheel made %d counts in 0.1 s before and %d after: the outputs are on while "
                  "the board is off. Wire them active-low (docs/hm2.md, \"Wiring\")",
                  before.lower, after.lower));
    return CommissioningResult::failed;
  }
  if (const CommissioningResult coasted = is_seen("Did the wheels coast while the cable was out?",
                                                  "wire the outputs active-low (docs/hm2.md, \"Wiring\")");
      coasted != CommissioningResult::passed) {
    return coasted;
  }
  dialog_.tell(
      formatted("ok: the lower wheel made %d counts in 0.1 s before the cable was pulled and %d after it was "
                "back; waiting for both wheels to stop",
                before.lower, after.lower));
  return wait_for_standstill() ? CommissioningResult::passed : CommissioningResult::failed;
}

}  // namespace abs_hil::experiment
