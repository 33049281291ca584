// When the guard of a run acts, and when it believes the run: ends in order, silence, death, outputs let go.

#include "guard_post.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;

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

TEST_CASE("a lost answer of the board ends no run") {
  Post post;
  post.stage_at_ns = then_ns;
  post.at_then = [&post] { post.board.fails_first = 3; };
  CHECK(post.run().reason == Reason::none);
  CHECK(post.processes.lives(run_process));
  CHECK(post.guard_page().ended_safe.load());
  CHECK(post.clock.now_ns() - then_ns <= 60 * ms);
}

TEST_CASE("the guard takes over the outputs of a board that shows nothing for 100 ms, and lets the run end") {
  Post post;
  post.stage_at_ns = then_ns;
  post.at_then = [&post] { post.board.fails_first = 100; };
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::safe_state_unverified);
  CHECK_FALSE(report.ended_controller);
  CHECK(post.processes.lives(run_process));
  CHECK(post.guard_page().taken_back_for.load() == Reason::safe_state_unverified);
  CHECK(report.verified);
  CHECK(report.first_written_ns - then_ns >= 100 * ms);
  CHECK(report.first_written_ns - then_ns <= 120 * ms);
}

TEST_CASE("a run that drives on behind a board that shows nothing is ended once it shows an output") {
  Post post;
  post.stage_at_ns = then_ns;
  post.lies = true;
  post.at_then = [&post] { post.board.fails_first = GENERATE(3, 100); };
  const GuardianReport report = post.run();
  CHECK(report.reason == Reason::safe_state_unverified);
  CHECK(report.ended_controller);
  CHECK(report.verified);
  CHECK(post.board.duty == 0.0);
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
