#include "guardian/board_guard.hpp"

#include <atomic>

#include "catch.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;
using rig::Reason;

namespace {

constexpr std::int64_t then_ns = 1'100 * ms;
constexpr int run_process = 4711;

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

}  // namespace

TEST_CASE("a run that ends in order is believed after two looks at its board, and nobody is ended") {
  Post post;
  post.stage_at_ns = then_ns;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::none);
  CHECK_FALSE(report.acted);
  CHECK(post.story == Story{"write", "look"});
  CHECK(post.guard_page().ends.load() == 1);
  CHECK(post.guard_page().ended_safe.load());
  CHECK(post.clock.now_ns() - then_ns >= 5 * ms);
  CHECK(post.clock.now_ns() - then_ns <= post.guard.look_period_ns() + 5 * ms + 200 * us);
}

TEST_CASE("a run that says that it is done and drives on is ended") {
  const Stage stage = GENERATE(Stage::closed, Stage::released, Stage::handed_over);
  CAPTURE(static_cast<int>(stage));
  Post post;
  post.stage_at_ns = then_ns;
  post.stage = stage;
  post.lies = true;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::safe_state_unverified);
  CHECK(report.ended_controller);
  CHECK_FALSE(report.controller_lives);
  CHECK(report.verified);
  CHECK(post.board.duty == 0.0);
  CHECK(report.verified_ns - then_ns <= 40 * ms);
}

TEST_CASE("a number that is no stage counts as a run that may drive") {
  Post post;
  post.stage_at_ns = then_ns;
  post.stage = static_cast<Stage>(77);
  post.lies = true;
  post.last_cycle_ns = then_ns + 5 * ms;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::controller_silent);
  CHECK(report.verified_ns - post.last_cycle_ns <= 20 * ms + post.guard.look_period_ns() + ms);
}

TEST_CASE("the guard of one run keeps its board open beside the run") {
  Post post;
  post.guard.cover_only(Pages::as_guard(post.pages.descriptors()), run_process);
  CHECK(post.board.held);
}

TEST_CASE("the guardian beats at each of its looks") {
  Post post;
  post.stage_at_ns = then_ns;
  static_cast<void>(post.run());
  const std::int64_t looks = (then_ns - 1'000 * ms) / post.guard.look_period_ns();
  CHECK(post.guard_page().guardian_beats.load() >= static_cast<std::uint64_t>(looks));
}

TEST_CASE("after the controller's death the safe state is written at once") {
  Post post;
  post.processes.dies_at_ns[run_process] = then_ns;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::controller_died);
  CHECK(report.verified);
  CHECK(report.tries == 1);
  CHECK(post.story == Story{"gone", "write"});
  CHECK(report.verified_ns - then_ns <= 200 * us);
}

TEST_CASE("the report keeps the time at which the controller was seen to be gone, however long the board fails") {
  Post post;
  post.last_cycle_ns = then_ns;
  post.board.fails_first = 50;
  const GuardianReport report = post.run();
  CHECK(report.verified);
  CHECK(report.tries == 51);
  CHECK(report.controller_gone_ns <= report.first_written_ns);
}

TEST_CASE("a silent controller is ended, and seen to have ended, before anything is written") {
  Post post;
  post.last_cycle_ns = then_ns;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::controller_silent);
  CHECK(post.story == Story{"end", "gone", "write"});
  CHECK(report.verified);
  CHECK(report.verified_ns - then_ns <= 20 * ms + post.guard.look_period_ns() + 1 * ms);
  CHECK(report.controller_gone_ns <= report.first_written_ns);
}

TEST_CASE("zeros are written in the same look if a process that is ended is gone at once") {
  Post post;
  post.last_cycle_ns = then_ns;
  post.processes.dying_takes_ns = 0;
  const GuardianReport report = post.run();
  CHECK(report.verified_ns == report.noticed_ns);
}

TEST_CASE("a run whose board cannot be looked at is not believed") {
  Post post;
  post.stage_at_ns = then_ns;
  post.at_then = [&post] { post.board.fails_first = 3; };
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::safe_state_unverified);
  CHECK(report.ended_controller);
  CHECK(report.verified);
}

TEST_CASE("a run that rests with a board that others reach is looked at like any other") {
  Post post;
  post.stage_at_ns = then_ns;
  post.stage = Stage::resting;
  CHECK(post.run().reason == Reason::none);
  CHECK(post.story == Story{"write", "look"});
}

TEST_CASE("a run that rests with a board of its own is believed without a look") {
  Post post;
  post.board.shared = false;
  post.stage_at_ns = then_ns;
  post.stage = Stage::resting;
  CHECK(post.run().reason == Reason::none);
  CHECK(post.story.empty());
}

TEST_CASE("a run that is covered and never begins a cycle is ended in the end") {
  Post post;
  post.last_cycle_ns = 0;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::controller_silent);
  CHECK(report.noticed_ns - 1'000 * ms >= Watchdog::first_beat_ns);
  CHECK(report.noticed_ns - 1'000 * ms <= Watchdog::first_beat_ns + 2 * post.guard.look_period_ns());
}

TEST_CASE("the guardian does not wait for a controller stuck in the kernel, but writes again after its end") {
  Post post;
  post.last_cycle_ns = then_ns;
  post.processes.dying_takes_ns = 40 * ms;
  const GuardianReport report = post.run();
  REQUIRE(report.verified);
  CHECK(report.tries > 2);
  CHECK(report.first_written_ns - report.noticed_ns <= 6 * ms);
  const auto gone = std::find(post.story.begin(), post.story.end(), "gone");
  REQUIRE(gone != post.story.end());
  CHECK(std::distance(gone, post.story.end()) == 2);
  CHECK(report.controller_gone_ns > report.first_written_ns);
  CHECK(report.verified_ns >= report.controller_gone_ns);
}

TEST_CASE("the guardian retries the safe state until it is verified") {
  Post post;
  post.processes.dies_at_ns[run_process] = then_ns;
  post.board.fails_first = 7;
  const GuardianReport report = post.run();
  CHECK(report.verified);
  CHECK(report.tries == 8);
  CHECK(report.last_error.error == driver::IoError::no_answer);
  CHECK(report.verified_ns - then_ns <= 8 * ms);
}

TEST_CASE("the guardian gives up on a lost board after guardian.insist_s and reports it") {
  Post post;
  post.processes.dies_at_ns[run_process] = then_ns;
  post.board.fails_first = 1'000'000;
  const GuardianReport report = post.run();
  CHECK_FALSE(report.verified);
  CHECK(post.clock.now_ns() - then_ns >= 500 * ms);
  CHECK(post.clock.now_ns() - then_ns <= 600 * ms);
  CHECK_THAT(to_text(report, 4711), Catch::Matchers::Contains("SAFE STATE NOT VERIFIED") &&
                                        Catch::Matchers::Contains("0x6c") && Catch::Matchers::Contains("E-stop"));
}

TEST_CASE("without guardian.insist_s the guardian tries until the board comes back or a person releases it") {
  Post post;
  BoardGuard guard({.clock = post.clock,
                    .board = post.board,
                    .processes = post.processes,
                    .timeout_ns = 20 * ms,
                    .keep_ns = 5 * ms,
                    .released = &post.released});
  post.processes.dies_at_ns[run_process] = then_ns;
  post.released = true;  // before there is anything to release it from
  const bool comes_back = GENERATE(true, false);
  post.board.fails_first = comes_back ? 3'000 : 1'000'000'000;
  guard.cover_only(Pages::as_guard(post.pages.descriptors()), run_process);
  const std::int64_t released_at_ns = then_ns + 600'000 * ms;
  while (!guard.over()) {
    guard.look();
    if (!comes_back && post.clock.now_ns() >= released_at_ns) post.released = true;
    post.clock.sleep_until(guard.next_ns());
  }
  CHECK(guard.report().verified == comes_back);
  CHECK(guard.report().released == !comes_back);
  // Quick tries first, then one every 10 ms: a board that comes back is zero within that time.
  if (comes_back) CHECK(guard.report().verified_ns - then_ns <= 3'000 * 10 * ms);
  if (!comes_back) CHECK(post.clock.now_ns() >= released_at_ns);
}

TEST_CASE("the guardian makes handed-over outputs safe while the controller lives on") {
  Post post;
  post.stage_at_ns = then_ns;
  post.stage = Stage::handed_over;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::safe_state_unverified);
  CHECK(report.verified);
  CHECK(report.controller_lives);
  CHECK(post.story == Story{"write", "look"});
  CHECK(report.verified_ns - report.first_written_ns >= 5 * ms);
}

TEST_CASE("a controller that dies after it released its outputs leaves only a record to be written") {
  Post post;
  post.stage = Stage::released;
  post.stage_at_ns = then_ns;
  post.processes.dies_at_ns[run_process] = then_ns + 50 * ms;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::controller_died);
  CHECK_FALSE(report.acted);
  CHECK(post.board.duty == 0.0);
  CHECK(std::count(post.story.begin(), post.story.end(), "end") == 0);
}

TEST_CASE("released outputs are kept at zero against any other writer") {
  Post post;
  post.stage = Stage::released;
  post.stage_at_ns = then_ns;
  post.closes_at_ns = then_ns + 200 * ms;
  const auto cycles = post.clock.happens;
  std::int64_t longest_ns = 0;
  std::int64_t on_since_ns = 0;
  post.clock.happens = [&](std::int64_t now_ns) {
    cycles(now_ns);
    if (now_ns > then_ns + 20 * ms && now_ns < then_ns + 190 * ms && now_ns % (60 * ms) == 0) post.board.duty = 0.73;
    if (now_ns < then_ns + 20 * ms) return;
    if (post.board.duty == 0.0) on_since_ns = 0;
    if (post.board.duty != 0.0 && on_since_ns == 0) on_since_ns = now_ns;
    if (on_since_ns != 0) longest_ns = std::max(longest_ns, now_ns - on_since_ns);
  };
  CHECK(post.run().reason == Reason::none);
  CHECK(longest_ns > 0);
  CHECK(longest_ns <= 5 * ms);
}

TEST_CASE("the outputs of a board with one owner are looked at when the owner has let go") {
  Post post;
  post.board.shared = false;
  post.stage = Stage::released;
  post.stage_at_ns = then_ns;
  post.closes_at_ns = then_ns + 50 * ms;
  CHECK(post.run().reason == Reason::none);
  CHECK(post.story == Story{"write", "look"});
}

TEST_CASE("reports say who, why and how fast") {
  Post post;
  post.last_cycle_ns = then_ns;
  const std::string text = to_text(post.run(), 4711);
  CHECK_THAT(text, Catch::Matchers::Contains("process 4711") && Catch::Matchers::Contains("reason 163") &&
                       Catch::Matchers::Contains("SIGKILL") && Catch::Matchers::Contains("at try 1"));
}

TEST_CASE("a controller that makes its board safe twice has the full time for each") {
  Post post;
  post.last_cycle_ns = then_ns;
  const auto cycles = post.clock.happens;
  post.clock.happens = [&post, cycles](std::int64_t now_ns) {
    cycles(now_ns);
    if (now_ns < then_ns) return;
    if (now_ns > then_ns + 580 * ms) return post.release(Stage::closed);
    post.release(Stage::making_safe);
    post.page().safe_beats.store(now_ns < then_ns + 290 * ms ? 1 : 2);
  };
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::none);
  CHECK_FALSE(report.acted);
}

TEST_CASE("beats of cycles and of the safe state count together") {
  Post post;
  post.stage_at_ns = then_ns;
  const auto cycles = post.clock.happens;
  post.clock.happens = [&post, cycles](std::int64_t now_ns) {
    cycles(now_ns);
    post.page().safe_beats.store(post.page().cycle_beats.load());
  };
  CHECK(post.run().reason == Reason::none);
}

TEST_CASE("a controller that hangs while it makes its board safe is ended after that board's time") {
  Post post;
  post.last_cycle_ns = then_ns;
  post.stage_at_ns = then_ns;
  post.stage = Stage::making_safe;
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::controller_silent);
  const std::int64_t allowed_ns = 20 * ms + post.board.owner_needs_ns();
  CHECK(report.noticed_ns - then_ns >= allowed_ns - ms);
  CHECK(report.noticed_ns - then_ns <= allowed_ns + 2 * post.guard.look_period_ns());
}

TEST_CASE("after a pause of its own the guardian takes the outputs back") {
  Post post;
  post.at_then = [&post] { post.clock.jump(41 * ms); };
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::guardian_paused);
  CHECK(post.seen_by_cycle == Reason::guardian_paused);
  CHECK(report.verified);
  CHECK(report.controller_lives);
  CHECK(post.story == Story{"write", "look"});
  CHECK_THAT(to_text(report, 4711), !Catch::Matchers::Contains("DID NOT END"));
}

TEST_CASE("a controller that does not give the outputs back within the timeout is ended first") {
  Post post(false);
  post.at_then = [&post] { post.clock.jump(41 * ms); };
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::guardian_paused);
  CHECK(report.verified);
  CHECK(post.story == Story{"end", "gone", "write"});
  CHECK(report.noticed_ns - then_ns <= 41 * ms + 20 * ms + 2 * post.guard.look_period_ns());
  CHECK_THAT(to_text(report, 4711), Catch::Matchers::Contains("did not give the outputs back"));
}

TEST_CASE("a pause of less than twice the timeout changes nothing") {
  Post post;
  post.at_then = [&post] { post.clock.jump(35 * ms); };
  post.closes_at_ns = then_ns + 500 * ms;
  CHECK(post.run().reason == Reason::none);
  CHECK(post.seen_by_cycle == Reason::none);
}

TEST_CASE("after a suspension of the computer the guardian takes the outputs back") {
  Post post;
  post.at_then = [&post] { post.clock.suspend(3'000 * ms); };
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::computer_suspended);
  CHECK(report.verified);
}

TEST_CASE("a run that has released its outputs is not asked for them") {
  Post post;
  post.at_then = [&post] {
    post.release(Stage::released);
    post.clock.jump(1'000 * ms);
    post.closes_at_ns = post.clock.now_ns() + 20 * ms;
  };
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::none);
  CHECK(post.guard_page().taken_back_for.load() == Reason::none);
}
