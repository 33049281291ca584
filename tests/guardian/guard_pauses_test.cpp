// The guard of a run after a pause of its own or a suspension of the computer.

#include "guard_post.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;

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
