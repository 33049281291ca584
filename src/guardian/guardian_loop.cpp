#include "guardian/guardian_loop.hpp"

#include <algorithm>
#include <utility>

#include "abs_hil/rig/time_units.hpp"

namespace abs_hil::guardian {

namespace {

/// A killed process ends within microseconds unless the kernel is still executing one of its accesses.
constexpr std::int64_t end_wait_ns = 5'000'000;
constexpr int quick_tries = 100;
constexpr std::int64_t quick_pause_ns = 1'000'000;
constexpr std::int64_t slow_pause_ns = 50'000'000;
constexpr std::int64_t least_suspension_ns = 1'000'000;

/// Eight looks per timeout. The guardian therefore notices silence at most an eighth of the timeout late.
std::int64_t look_period_for(std::int64_t timeout_ns) noexcept {
  constexpr std::int64_t shortest_ns = 250'000;
  constexpr std::int64_t longest_ns = 5'000'000;
  return std::clamp(timeout_ns / 8, shortest_ns, longest_ns);
}

}  // namespace

GuardianLoop::GuardianLoop(runtime::Clock& clock, ControllerProcess& controller, SharedRegion& region,
                           driver::SafeStateWriter& writer, const GuardianOptions& options,
                           std::atomic<bool>* released) noexcept
    : clock_(clock),
      controller_(controller),
      region_(region),
      writer_(writer),
      released_(released),
      timeout_ns_(static_cast<std::int64_t>(options.timeout_ms * rig::ns_per_ms)),
      insist_ns_(static_cast<std::int64_t>(options.insist_s * rig::ns_per_s)),
      look_period_ns_(look_period_for(timeout_ns_)),
      watchdog_(timeout_ns_, look_period_ns_, writer.owner_needs_ns()) {}

GuardianReport GuardianLoop::run() noexcept {
  std::int64_t next_look_ns = clock_.now_ns();
  last_look_ns_ = next_look_ns;
  suspended_ns_ = clock_.suspended_ns();
  std::uint64_t beats = 0;
  for (;;) {
    next_look_ns = std::max(next_look_ns + look_period_ns_, clock_.now_ns());
    HeartbeatReading reading{};
    reading.controller_gone = controller_.gone_by(next_look_ns);
    region_.panel().guardian_beats.store(++beats, std::memory_order_relaxed);
    // Read after `controller_gone`: if the controller has ended, these values are final.
    reading.stage = region_.stage();
    reading.cycle_beats = region_.panel().cycle_beats.load(std::memory_order_relaxed) +
                          region_.panel().safe_beats.load(std::memory_order_relaxed);
    reading.now_ns = clock_.now_ns();
    reading.taken_back_for = must_give_back_for(reading);
    const Verdict verdict = watchdog_.look(reading);
    if (verdict == Verdict::wait) continue;

    GuardianReport report{
        .reason = watchdog_.reason(), .silence_ns = watchdog_.silence_ns(), .noticed_ns = reading.now_ns};
    if (reading.controller_gone) report.controller_gone_ns = reading.now_ns;
    const bool writes_zeros_only = reading.stage == Stage::handed_over || reading.stage == Stage::released;
    if (verdict == Verdict::make_safe) make_safe(report, writes_zeros_only);
    return report;
  }
}

rig::Reason GuardianLoop::must_give_back_for(const HeartbeatReading& reading) noexcept {
  const std::int64_t gap_ns = reading.now_ns - std::exchange(last_look_ns_, reading.now_ns);
  const std::int64_t told_ns = clock_.suspended_ns();
  const std::int64_t suspended_ns = told_ns - suspended_ns_;
  suspended_ns_ = std::max(suspended_ns_, told_ns);
  const bool has_outputs = reading.stage == Stage::guarded || reading.stage == Stage::making_safe;
  if (taken_back_for_ != rig::Reason::none || !has_outputs) return taken_back_for_;
  taken_back_for_ = controller_.must_give_back_for();
  if (taken_back_for_ == rig::Reason::none && suspended_ns > least_suspension_ns) {
    taken_back_for_ = rig::Reason::computer_suspended;
  }
  // The controller's own limit is one timeout, or three of its periods.
  if (taken_back_for_ == rig::Reason::none && gap_ns > 2 * timeout_ns_) taken_back_for_ = rig::Reason::guardian_paused;
  if (taken_back_for_ != rig::Reason::none) {
    region_.panel().taken_back_for.store(taken_back_for_, std::memory_order_relaxed);
  }
  return taken_back_for_;
}

bool GuardianLoop::must_give_up(GuardianReport& report, std::int64_t since_ns) const noexcept {
  report.released = released_ != nullptr && released_->load(std::memory_order_relaxed);
  return report.released || (insist_ns_ > 0 && clock_.now_ns() - since_ns >= insist_ns_);
}

void GuardianLoop::make_safe(GuardianReport& report, bool writes_zeros_only) noexcept {
  report.acted = true;
  if (released_ != nullptr) released_->store(false, std::memory_order_relaxed);
  report.controller_lives = writes_zeros_only;
  report.ended_controller = watchdog_.must_end_controller();
  if (report.ended_controller) controller_.end();
  bool gone = writes_zeros_only || controller_.gone_by(clock_.now_ns() + end_wait_ns);
  const std::int64_t since_ns = clock_.now_ns();
  for (;;) {
    if (gone && !writes_zeros_only && report.controller_gone_ns == 0) report.controller_gone_ns = clock_.now_ns();
    const driver::IoResult result = writer_.make_safe();
    ++report.tries;
    const std::int64_t now_ns = clock_.now_ns();
    if (report.tries == 1) report.first_written_ns = now_ns;
    if (!result.ok()) report.last_error = result;
    if (result.ok() && gone) {
      report.verified = true;
      report.verified_ns = now_ns;
      return;
    }
    if (must_give_up(report, since_ns)) return;
    const std::int64_t next_ns = now_ns + (report.tries < quick_tries ? quick_pause_ns : slow_pause_ns);
    if (gone) {
      clock_.sleep_until(next_ns);
    } else {
      gone = controller_.gone_by(next_ns);
    }
  }
}

}  // namespace abs_hil::guardian
