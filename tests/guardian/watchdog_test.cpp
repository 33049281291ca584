// The guardian's watchdog over the cycles of a run, in virtual time.
#include "guardian/watchdog.hpp"

#include "catch.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;

namespace {

constexpr std::int64_t us = 1'000;
constexpr std::int64_t ms = 1'000'000;
constexpr std::int64_t timeout_ns = 20 * ms;
constexpr std::int64_t period_ns = 2'500 * us;

/// Looks every period at cycles of 1 kHz that end at `last_cycle_ns`; returns when the verdict was no longer to wait.
std::int64_t look_until_verdict(Watchdog& watchdog, std::int64_t last_cycle_ns, std::int64_t until_ns,
                                std::int64_t first_look_ns = 0) {
  for (std::int64_t now_ns = first_look_ns; now_ns < until_ns; now_ns += period_ns) {
    const auto beats = static_cast<std::uint64_t>(1 + std::min(now_ns, last_cycle_ns) / ms);
    if (watchdog.look({.now_ns = now_ns, .cycle_beats = beats}) != Verdict::wait) return now_ns;
  }
  return -1;
}

}  // namespace

TEST_CASE("the watchdog waits as long as cycles go on") {
  Watchdog watchdog(timeout_ns, period_ns);
  CHECK(look_until_verdict(watchdog, INT64_MAX, 10'000 * ms) == -1);
  CHECK(watchdog.reason() == rig::Reason::none);
}

TEST_CASE("a silent controller is noticed within the timeout and one look, wherever the looks fall") {
  for (std::int64_t offset_ns = 0; offset_ns < period_ns; offset_ns += 100 * us) {
    Watchdog watchdog(timeout_ns, period_ns);
    constexpr std::int64_t last_ns = 100 * ms;
    const std::int64_t noticed_ns = look_until_verdict(watchdog, last_ns, 1000 * ms, offset_ns);
    CAPTURE(offset_ns, noticed_ns - last_ns);
    CHECK(noticed_ns - last_ns >= timeout_ns);
    CHECK(noticed_ns - last_ns <= timeout_ns + period_ns);
    CHECK(watchdog.reason() == rig::Reason::controller_silent);
  }
}

TEST_CASE("before the first cycle a missing heartbeat is no fault for a second") {
  Watchdog watchdog(timeout_ns, period_ns);
  std::int64_t now_ns = 0;
  while (watchdog.look({.now_ns = now_ns += period_ns, .cycle_beats = 0}) == Verdict::wait) {
    REQUIRE(now_ns < 1'100 * ms);
  }
  CHECK(now_ns >= 1'000 * ms);
  CHECK(watchdog.reason() == rig::Reason::controller_silent);
}

TEST_CASE("a controller that dies before its first cycle has died") {
  Watchdog watchdog(timeout_ns, period_ns);
  CHECK(watchdog.look({.now_ns = period_ns, .cycle_beats = 0, .controller_gone = true}) == Verdict::make_safe);
  CHECK(watchdog.reason() == rig::Reason::controller_died);
}

TEST_CASE("a pause of the whole computer does not count as silence of the controller") {
  Watchdog watchdog(timeout_ns, period_ns);
  REQUIRE(look_until_verdict(watchdog, INT64_MAX, 100 * ms) == -1);
  // No process ran for a second; the guardian is the first one to run again.
  CHECK(watchdog.look({.now_ns = 1100 * ms, .cycle_beats = 100}) == Verdict::wait);
  CHECK(watchdog.silence_ns() <= 2 * period_ns);
  CHECK(watchdog.look({.now_ns = 1102 * ms, .cycle_beats = 101}) == Verdict::wait);
  CHECK(watchdog.silence_ns() == 0);
}

TEST_CASE("the watchdog acts on the controller's death at once, and the first reason stays") {
  Watchdog watchdog(timeout_ns, period_ns);
  CHECK(watchdog.look({.now_ns = 0, .cycle_beats = 7}) == Verdict::wait);
  CHECK(watchdog.look({.now_ns = 1, .cycle_beats = 7, .controller_gone = true}) == Verdict::make_safe);
  CHECK(watchdog.look({.now_ns = 2, .cycle_beats = 8, .stage = Stage::closed}) == Verdict::make_safe);
  CHECK(watchdog.reason() == rig::Reason::controller_died);
}

TEST_CASE("released outputs need no heartbeat and stay safe if the controller dies") {
  Watchdog watchdog(timeout_ns, period_ns);
  for (std::int64_t now_ns = 0; now_ns < 5'000 * ms; now_ns += period_ns) {
    REQUIRE(watchdog.look({.now_ns = now_ns, .cycle_beats = 9, .stage = Stage::released}) == Verdict::wait);
  }
  const HeartbeatReading died{
      .now_ns = 5'000 * ms, .cycle_beats = 9, .stage = Stage::released, .controller_gone = true};
  CHECK(watchdog.look(died) == Verdict::dismissed);
  CHECK(watchdog.reason() == rig::Reason::controller_died);
  CHECK(watchdog.look(died) == Verdict::dismissed);  // the guard asks again until it has read the board back
}

TEST_CASE("a controller that waits for its board to confirm the safe state has that board's time in addition") {
  constexpr std::int64_t board_needs_ns = 300 * ms;
  Watchdog watchdog(timeout_ns, period_ns, board_needs_ns);
  std::int64_t now_ns = 0;
  REQUIRE(watchdog.look({.now_ns = now_ns, .cycle_beats = 9}) == Verdict::wait);
  while (watchdog.look({.now_ns = now_ns += period_ns, .cycle_beats = 9, .stage = Stage::making_safe}) ==
         Verdict::wait) {
    REQUIRE(now_ns < timeout_ns + board_needs_ns);
  }
  CHECK(now_ns >= timeout_ns + board_needs_ns);
  CHECK(watchdog.reason() == rig::Reason::controller_silent);
}

TEST_CASE("the outputs are not safe if the controller dies while it makes them safe") {
  Watchdog watchdog(timeout_ns, period_ns, 300 * ms);
  const HeartbeatReading died{.now_ns = 0, .cycle_beats = 9, .stage = Stage::making_safe, .controller_gone = true};
  CHECK(watchdog.look(died) == Verdict::make_safe);
  CHECK(watchdog.reason() == rig::Reason::controller_died);
}

TEST_CASE("a run closed in order dismisses the guardian, whether or not the process has ended") {
  for (const bool gone : {false, true}) {
    Watchdog watchdog(timeout_ns, period_ns);
    CHECK(watchdog.look({.now_ns = 0, .cycle_beats = 9, .stage = Stage::closed, .controller_gone = gone}) ==
          Verdict::dismissed);
    CHECK(watchdog.reason() == rig::Reason::none);
  }
}

TEST_CASE("the guardian takes over handed-over outputs without ending the controller") {
  Watchdog watchdog(timeout_ns, period_ns);
  CHECK(watchdog.look({.now_ns = 0, .cycle_beats = 9, .stage = Stage::handed_over}) == Verdict::make_safe);
  CHECK(watchdog.reason() == rig::Reason::safe_state_unverified);
}

TEST_CASE("silence begins with the first look and grows by the time between two looks") {
  Watchdog watchdog(timeout_ns, period_ns);
  CHECK(watchdog.look({.now_ns = 0, .cycle_beats = 0}) == Verdict::wait);
  CHECK(watchdog.silence_ns() == 0);
  CHECK(watchdog.look({.now_ns = period_ns, .cycle_beats = 0}) == Verdict::wait);
  CHECK(watchdog.silence_ns() == period_ns);
}

TEST_CASE("a pause counts as two look periods of silence if the controller is silent after it") {
  Watchdog watchdog(timeout_ns, period_ns);
  REQUIRE(watchdog.look({.now_ns = 0, .cycle_beats = 9}) == Verdict::wait);
  CHECK(watchdog.look({.now_ns = 1'000 * ms, .cycle_beats = 9}) == Verdict::wait);
  CHECK(watchdog.silence_ns() == 2 * period_ns);
}

TEST_CASE("a controller that was asked to give the outputs back has the timeout for it, and then is ended") {
  constexpr std::int64_t board_needs_ns = 300 * ms;
  const Stage stage = GENERATE(Stage::guarded, Stage::making_safe);
  const std::int64_t limit_ns = timeout_ns + (stage == Stage::making_safe ? board_needs_ns : 0);
  Watchdog watchdog(timeout_ns, period_ns, board_needs_ns);
  HeartbeatReading reading{.now_ns = 0, .cycle_beats = 9};
  REQUIRE(watchdog.look(reading) == Verdict::wait);
  reading.stage = stage;
  reading.taken_back_for = rig::Reason::safe_state_unverified;
  Verdict verdict = Verdict::wait;
  while (verdict == Verdict::wait) {
    REQUIRE(reading.now_ns < limit_ns);
    reading.now_ns += period_ns;
    ++reading.cycle_beats;
    verdict = watchdog.look(reading);
  }
  CHECK(verdict == Verdict::make_safe);
  CHECK(reading.now_ns == limit_ns);
  CHECK(watchdog.reason() == rig::Reason::safe_state_unverified);
}

TEST_CASE("a controller that gives the outputs back when it is asked to is not ended") {
  Watchdog watchdog(timeout_ns, period_ns);
  const HeartbeatReading given_back{
      .now_ns = 0, .cycle_beats = 9, .stage = Stage::released, .taken_back_for = rig::Reason::safe_state_unverified};
  CHECK(watchdog.look(given_back) == Verdict::make_safe);
  CHECK(watchdog.reason() == rig::Reason::safe_state_unverified);
}
