// The guardian takes the outputs back for a cause outside of the run, or after a pause of its own.

#include "catch.hpp"
#include "guardian/guardian_loop.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;

namespace {

constexpr std::int64_t then_ns = 1'100 * ms;

/// A guardian beside a controller with cycles of 1 kHz. An obedient one makes its outputs safe in the cycle after the
/// mark, as the executive does.
struct LeasePost {
  explicit LeasePost(bool obedient) {
    clock.happens = [this, obedient](std::int64_t now_ns) {
      if (controller.gone()) return;
      HeartbeatPanel& panel = region.panel();
      if (now_ns / ms != last_cycle_ms) {
        last_cycle_ms = now_ns / ms;
        panel.cycle_beats.store(static_cast<std::uint64_t>(last_cycle_ms));
        const rig::Reason mark = panel.taken_back_for.load();
        if (obedient && mark != rig::Reason::none && seen_by_cycle == rig::Reason::none) {
          seen_by_cycle = mark;
          released_ns = now_ns;
          region.set_stage(Stage::released);
        }
      }
      if (event && now_ns >= then_ns) std::exchange(event, nullptr)();
      if (now_ns >= then_ns + 5'000 * ms) region.set_stage(Stage::closed);  // a guardian that sees nothing
    };
  }
  using HeartbeatPanel = runtime::HeartbeatPanel;
  GuardianReport run() { return loop.run(); }

  GuardianOptions options{.timeout_ms = 20.0, .insist_s = 0.5};
  Story story;
  ScriptedClock clock;
  ScriptedController controller{clock, story};
  ScriptedWriter writer{story};
  SharedRegion region{8};
  GuardianLoop loop{clock, controller, region, writer, options};
  std::function<void()> event{};
  rig::Reason seen_by_cycle{rig::Reason::none};
  std::int64_t last_cycle_ms{0};
  std::int64_t released_ns{0};
};

}  // namespace

TEST_CASE("a controller that is asked gives the outputs back itself, and the guardian verifies them") {
  LeasePost post(true);
  post.controller.give_back_at_ns = then_ns;
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::computer_will_suspend);
  CHECK(post.seen_by_cycle == rig::Reason::computer_will_suspend);
  CHECK(report.verified);
  CHECK(report.controller_lives);
  CHECK(post.story == Story{"write"});  // nobody was ended
  CHECK(post.released_ns - then_ns <= post.loop.look_period_ns() + ms);
  CHECK_THAT(to_text(report, 4711), !Catch::Matchers::Contains("DID NOT END"));
}

TEST_CASE("a controller that does not give the outputs back within the timeout is ended first") {
  LeasePost post(false);
  post.controller.give_back_at_ns = then_ns;
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::computer_will_suspend);
  CHECK(report.verified);
  CHECK(post.story == Story{"end", "gone", "write"});
  CHECK(report.noticed_ns - then_ns <= 20 * ms + 2 * post.loop.look_period_ns());
  CHECK_THAT(to_text(report, 4711), Catch::Matchers::Contains("did not give the outputs back"));
}

TEST_CASE("after a pause of its own the guardian takes the outputs back") {
  LeasePost post(true);
  post.event = [&post] { post.clock.jump(41 * ms); };
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::guardian_paused);
  CHECK(report.verified);
  CHECK(post.story == Story{"write"});
}

TEST_CASE("a pause of less than twice the timeout changes nothing") {
  LeasePost post(true);
  post.event = [&post] { post.clock.jump(35 * ms); };
  post.controller.give_back_at_ns = then_ns + 500 * ms;  // ends the test
  CHECK(post.run().reason == rig::Reason::computer_will_suspend);
}

TEST_CASE("after a suspension of the computer the guardian takes the outputs back") {
  LeasePost post(true);
  post.event = [&post] { post.clock.suspend(3'000 * ms); };
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::computer_suspended);
  CHECK(report.verified);
}

TEST_CASE("a run that has released its outputs is not asked for them") {
  LeasePost post(true);
  post.event = [&post] {
    post.region.set_stage(Stage::released);
    post.clock.jump(1'000 * ms);
    post.event = [&post] { post.region.set_stage(Stage::closed); };
  };
  const GuardianReport report = post.run();
  CHECK(report.reason == rig::Reason::none);
  CHECK(post.region.panel().taken_back_for.load() == rig::Reason::none);
  CHECK(post.story.empty());
}
