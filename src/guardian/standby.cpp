// The second guard: acts once if the first dies or stands still.
#include "guardian/standby.hpp"

#include <algorithm>
#include <exception>
#include <utility>

namespace abs_hil::guardian {

namespace {

constexpr std::int64_t look_period_ns = 5'000'000;
constexpr std::int64_t board_waits_ns = 1'000'000'000;
constexpr std::int64_t try_period_ns = 1'000'000;
constexpr std::int64_t run_lives_ns = 1'000'000'000;
/// With a board of one owner, whose outputs nobody else can see.
constexpr std::int64_t owner_lives_ns = 100'000'000;

}  // namespace

/// Silence counts in this process' own looks, two periods each at most: a pause of the whole computer is none.
bool Standby::guard_lost() noexcept {
  const std::uint64_t seen = parts_.page.guard_beats.load(std::memory_order_relaxed);
  const std::int64_t since_ns = std::min(now_ns_ - std::exchange(last_look_ns_, now_ns_), 2 * look_period_ns);
  silent_ns_ = seen == std::exchange(beats_, seen) ? silent_ns_ + since_ns : 0;
  // A board that fails may hold the guard up. Another process could not reach it any better, for a while.
  const bool waits = parts_.page.accesses_board.load(std::memory_order_relaxed);
  const std::int64_t most_ns = waits ? std::max(parts_.silence_ns, board_waits_ns) : parts_.silence_ns;
  return silent_ns_ >= most_ns || parts_.processes.gone(parts_.guard);
}

void Standby::look() noexcept {
  now_ns_ = parts_.clock.now_ns();
  next_ns_ = now_ns_ + look_period_ns;
  // Opened while the guard lives and names it: later the number could be another process'.
  if (const pid_t holder = parts_.page.holder.load(std::memory_order_relaxed); !acting_ && holder != run_pid_) {
    if (run_ >= 0) parts_.processes.close(run_);
    run_ = holder != 0 ? parts_.processes.open(holder) : -1;
    run_pid_ = holder;
  }
  if (!acting_ && guard_lost()) {
    // One that ends in order has verified its outputs, or has said that it could not.
    if (parts_.page.over.load(std::memory_order_relaxed)) {
      over_ = true;
      return;
    }
    acting_ = true;
    parts_.processes.end(parts_.guard);
    run_may_drive_until_ns_ = now_ns_ + parts_.page.run_needs_ns.load(std::memory_order_relaxed);
    run_may_live_until_ns_ =
        run_may_drive_until_ns_ + (parts_.board.works_beside_owner() ? run_lives_ns : owner_lives_ns);
  }
  if (acting_) return act();
  if (run_pid_ == 0 && !std::exchange(prepared_, true)) prepare();
}

void Standby::prepare() noexcept try {
  if (parts_.board.works_beside_owner()) parts_.board.prepare();
} catch (const std::exception&) {
  // The board is not there: it is opened when it is needed.
}

void Standby::act() noexcept {
  next_ns_ = now_ns_ + try_period_ns;
  const bool run_gone = run_ < 0 || parts_.processes.gone(run_);
  if (!parts_.processes.gone(parts_.guard)) return;
  if (!run_gone && now_ns_ < run_may_drive_until_ns_) return;
  const bool zeroed = std::exchange(zeroed_, true) && !run_gone;
  const driver::IoResult result = zeroed ? parts_.board.verify_safe() : parts_.board.make_safe();
  if (run_gone && result.ok()) {
    acted_ = over_ = true;
    return;
  }
  // A run that has noticed writes zeros itself. One that drives on is ended.
  const bool drives_on = result.error == driver::IoError::foreign_writer;
  if (!run_gone && (drives_on || now_ns_ >= run_may_live_until_ns_)) parts_.processes.end(run_);
}

}  // namespace abs_hil::guardian
