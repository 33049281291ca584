#pragma once

// The guard of one run beside a scripted controller, clock and board.

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <utility>

#include "catch.hpp"
#include "guardian/board_guard.hpp"
#include "scripted_parts.hpp"

namespace abs_hil::guardian::test {

using rig::Reason;

inline constexpr std::int64_t then_ns = 1'100 * ms;
inline constexpr int run_process = 4711;

/// The guard of one run, beside a controller with cycles of 1 kHz until the test stops it. An obedient controller makes
/// its outputs safe in the cycle after the guard's mark, as the executive does.
struct Post {
  explicit Post(bool obedient = true) {
    clock.happens = [this, obedient](std::int64_t now_ns) {
      if (at_then && now_ns >= then_ns) std::exchange(at_then, nullptr)();
      if (!processes.lives(run_process)) return;
      if (now_ns / ms != last_ms && now_ns < last_cycle_ns) {
        last_ms = now_ns / ms;
        page().cycle_beats.store(static_cast<std::uint64_t>(last_ms));
        if (drives) board.duty = 0.5;
        const Reason mark = guard_page().taken_back_for.load();
        if (obedient && mark != Reason::none && seen_by_cycle == Reason::none) {
          seen_by_cycle = mark;
          released_ns = now_ns;
          release(Stage::released);
        }
      }
      if (now_ns >= stage_at_ns) std::exchange(stage_at_ns, INT64_MAX), release(stage);
      if (now_ns >= closes_at_ns) std::exchange(closes_at_ns, INT64_MAX), release(Stage::closed);
    };
  }
  RunPage& page() { return pages.run(); }
  GuardPage& guard_page() { return pages.guard(); }
  void release(Stage to) {
    if (to != Stage::guarded && to != Stage::making_safe && !lies) drives = false, board.duty = 0.0;
    page().stage = to;
  }
  GuardianReport run() {
    guard.cover_only(Pages::as_guard(pages.descriptors()), run_process);
    while (!guard.over()) {
      guard.look();
      // The holder's end wakes a real guard at once.
      const bool lived = processes.lives(run_process);
      while (clock.now_ns() < guard.next_ns() && lived == processes.lives(run_process)) {
        clock.sleep_until(std::min(guard.next_ns(), clock.now_ns() + 100 * us));
      }
      REQUIRE(clock.now_ns() < 5'000'000 * ms);
    }
    return guard.report();
  }

  Story story;
  ScriptedClock clock;
  ScriptedProcesses processes{clock, story};
  ScriptedBoard board{story};
  std::atomic<bool> released{false};
  Pages pages;
  BoardGuard guard{{.clock = clock,
                    .board = board,
                    .processes = processes,
                    .timeout_ns = 20 * ms,
                    .keep_ns = 5 * ms,
                    .insist_ns = insist_ns,
                    .released = &released}};
  static constexpr std::int64_t insist_ns = 500 * ms;
  std::int64_t last_cycle_ns{INT64_MAX};
  std::int64_t last_ms{0};
  std::int64_t stage_at_ns{INT64_MAX};
  std::int64_t closes_at_ns{INT64_MAX};
  Stage stage{Stage::closed};
  bool drives{true};
  bool lies{false};  ///< it drives on after it said that it does not
  std::function<void()> at_then{};
  Reason seen_by_cycle{Reason::none};
  std::int64_t released_ns{0};
};

}  // namespace abs_hil::guardian::test
