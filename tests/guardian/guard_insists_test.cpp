// How the guard of a run writes the safe state: at once, again until it is verified, and how long a controller may take
// for its own.

#include "guard_post.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;

TEST_CASE("the report keeps the time at which the controller was seen to be gone, however long the board fails") {
  Post post;
  post.last_cycle_ns = then_ns;
  post.board.fails_first = 50;
  const GuardianReport report = post.run();
  CHECK(report.verified);
  CHECK(report.tries == 51);
  CHECK(report.controller_gone_ns <= report.first_written_ns);
}

TEST_CASE("zeros are written in the same look if a process that is ended is gone at once") {
  Post post;
  post.last_cycle_ns = then_ns;
  post.processes.dying_takes_ns = 0;
  const GuardianReport report = post.run();
  CHECK(report.verified_ns == report.noticed_ns);
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
