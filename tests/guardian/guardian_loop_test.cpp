#include "guardian/guardian_loop.hpp"

#include <atomic>

#include "catch.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;

namespace {

/// A guardian beside a controller that runs cycles at 1 kHz until the test stops it.
struct Post {
  Post() {
    clock.happens = [this](std::int64_t now_ns) {
      if (now_ns < last_cycle_ns && !controller.gone()) {
        region.panel().cycle_beats.store(static_cast<std::uint64_t>(now_ns / ms));
      }
      if (now_ns >= stage_at_ns) region.set_stage(stage);
    };
  }
  GuardianReport run() { return duty.run(); }

  GuardianOptions options{.timeout_ms = 20.0, .insist_s = 0.5};
  Story story;
  ScriptedClock clock;
  ScriptedController controller{clock, story};
  ScriptedWriter writer{story};
  SharedRegion region{8};
  std::atomic<bool> released{false};
  GuardianLoop duty{clock, controller, region, writer, options, &released};
  std::int64_t last_cycle_ns{INT64_MAX};
  std::int64_t stage_at_ns{INT64_MAX};
  Stage stage{Stage::closed};
};

constexpr std::int64_t then_ns = 1'100 * ms;

}  // namespace

TEST_CASE("the guardian writes nothing after a run that ends in order") {
  Post post;
  post.stage_at_ns = then_ns;
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::none);
  CHECK_FALSE(report.acted);
  CHECK(post.story.empty());
  CHECK(post.clock.now_ns() - then_ns <= post.duty.look_period_ns());
}

TEST_CASE("the guardian beats at each of its looks") {
  Post post;
  post.stage_at_ns = then_ns;
  static_cast<void>(post.run());
  const std::int64_t looks = (then_ns - 1'000 * ms) / post.duty.look_period_ns();
  CHECK(post.region.panel().guardian_beats.load() >= static_cast<std::uint64_t>(looks));
}

TEST_CASE("after the controller's death the safe state is written at once") {
  Post post;
  post.controller.dies_at_ns = then_ns;
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::controller_died);
  CHECK(report.verified);
  CHECK(report.tries == 1);
  CHECK(post.story == Story{"gone", "write"});
  CHECK(report.verified_ns - then_ns <= 100 * us);
}

TEST_CASE("a silent controller is ended, and seen to have ended, before anything is written") {
  Post post;
  post.last_cycle_ns = then_ns;
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::controller_silent);
  CHECK(post.story == Story{"end", "gone", "write"});
  CHECK(report.verified);
  CHECK(report.verified_ns - then_ns <= 20 * ms + post.duty.look_period_ns() + 1 * ms);
  CHECK(report.controller_gone_ns <= report.first_written_ns);
}

TEST_CASE("the guardian does not wait for a controller stuck in the kernel, but writes again after its end") {
  Post post;
  post.last_cycle_ns = then_ns;
  post.controller.dying_takes_ns = 40 * ms;
  const GuardianReport report = post.run();
  REQUIRE(report.verified);
  CHECK(report.tries > 2);
  CHECK(report.first_written_ns - report.noticed_ns <= 6 * ms);
  const auto gone = std::find(post.story.begin(), post.story.end(), "gone");
  REQUIRE(gone != post.story.end());
  CHECK(std::count(gone, post.story.end(), "write") == 1);
  CHECK(report.verified_ns >= report.controller_gone_ns);
}

TEST_CASE("the guardian retries the safe state until it is verified") {
  Post post;
  post.controller.dies_at_ns = then_ns;
  post.writer.fails_first = 7;
  const GuardianReport report = post.run();
  CHECK(report.verified);
  CHECK(report.tries == 8);
  CHECK(report.last_error.error == driver::IoError::no_answer);
  CHECK(report.verified_ns - then_ns <= 8 * ms);
}

TEST_CASE("the guardian gives up on a lost board after guardian.insist_s and reports it") {
  Post post;
  post.controller.dies_at_ns = then_ns;
  post.writer.fails_first = 1'000'000;
  const GuardianReport report = post.run();
  CHECK_FALSE(report.verified);
  CHECK(post.clock.now_ns() - then_ns >= 500 * ms);
  CHECK(post.clock.now_ns() - then_ns <= 600 * ms);
  CHECK_THAT(to_text(report, 4711), Catch::Matchers::Contains("SAFE STATE NOT VERIFIED") &&
                                        Catch::Matchers::Contains("0x6c") && Catch::Matchers::Contains("E-stop"));
}

TEST_CASE("without guardian.insist_s the guardian tries until the board comes back or a person releases it") {
  Post post;
  post.options.insist_s = 0.0;
  GuardianLoop duty{post.clock, post.controller, post.region, post.writer, post.options, &post.released};
  post.controller.dies_at_ns = then_ns;
  post.released = true;  // before there is anything to release it from
  SECTION("the board comes back after 30 s") {
    post.writer.fails_first = 100 + (30'000 - 100) / 50;  // 1 ms apart, later 50 ms
    const GuardianReport report = duty.run();
    CHECK(report.verified);
    CHECK_FALSE(report.released);
    CHECK(report.verified_ns - then_ns >= 29'000 * ms);
  }
  SECTION("a person releases it") {
    post.writer.fails_first = 1'000'000;
    const auto cycles = post.clock.happens;
    post.clock.happens = [&post, cycles](std::int64_t now_ns) {
      cycles(now_ns);
      if (now_ns >= then_ns + 3'600'000 * ms) post.released = true;
    };
    const GuardianReport report = duty.run();
    CHECK_FALSE(report.verified);
    CHECK(report.released);
    CHECK(post.clock.now_ns() - then_ns >= 3'600'000 * ms);
    CHECK_THAT(to_text(report, 4711), Catch::Matchers::Contains("released by a person"));
  }
}

TEST_CASE("the guardian makes handed-over outputs safe while the controller lives on") {
  Post post;
  post.stage_at_ns = then_ns;
  post.stage = Stage::handed_over;
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::safe_state_unverified);
  CHECK(report.verified);
  CHECK(post.story == Story{"write"});
}

TEST_CASE("a controller that dies after it released its outputs leaves only a record to be written") {
  Post post;
  post.stage = Stage::released;
  post.stage_at_ns = then_ns;
  post.controller.dies_at_ns = then_ns + 50 * ms;
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::controller_died);
  CHECK_FALSE(report.acted);
  CHECK(post.story == Story{"gone"});
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
  post.clock.happens = [&post](std::int64_t now_ns) {
    auto& panel = post.region.panel();
    if (now_ns < then_ns) return panel.cycle_beats.store(static_cast<std::uint64_t>(now_ns / ms));
    if (now_ns > then_ns + 580 * ms) return post.region.set_stage(Stage::closed);
    post.region.set_stage(Stage::making_safe);
    panel.safe_beats.store(now_ns < then_ns + 290 * ms ? 1 : 2);
  };
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::none);
  CHECK_FALSE(report.acted);
  CHECK(post.story.empty());
}

TEST_CASE("a controller that hangs while it makes its board safe is ended after that board's time") {
  Post post;
  post.last_cycle_ns = then_ns;
  post.stage_at_ns = then_ns;
  post.stage = Stage::making_safe;
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::controller_silent);
  const std::int64_t allowed_ns = 20 * ms + post.writer.owner_needs_ns();
  CHECK(report.noticed_ns - then_ns >= allowed_ns - ms);
  CHECK(report.noticed_ns - then_ns <= allowed_ns + 2 * post.duty.look_period_ns());
}
