#include "watch/run_view.hpp"

#include <limits>

#include "catch.hpp"
#include "messages.hpp"

using namespace abs_hil;
using namespace abs_hil::watch::test;
using abs_hil::rig::unknown;
using watch::RunView;

TEST_CASE("samples of the window are kept, older ones are not") {
  RunView view(2.0);
  feed(view, 0, 5000);
  REQUIRE(view.samples().size() == 2001);
  CHECK(view.samples().front().time_s == 2.999);
  CHECK(view.samples().back().time_s == 4.999);
  CHECK(view.telemetry()->sequence == 4999);
  CHECK(view.lost() == 0);
  CHECK(view.runs() == 1);
}

TEST_CASE("true values are shown if known, else estimates") {
  RunView view(2.0);
  telemetry_t m = telemetry(0);
  m.omega1_est_rad_s = 1.0;
  m.slip_est = 0.5;
  view.take(m, 0);
  CHECK(view.samples().back().omega1_rad_s == 80.0);
  m = telemetry(1);
  m.omega1_rad_s = m.omega2_rad_s = m.slip = unknown;
  m.omega1_est_rad_s = 1.0;
  m.omega2_est_rad_s = 2.0;
  m.slip_est = 0.5;
  view.take(m, ms);
  CHECK(view.samples().back().omega1_rad_s == 1.0);
  CHECK(view.samples().back().omega2_rad_s == 2.0);
  CHECK(view.samples().back().slip == 0.5);
}

TEST_CASE("missing messages are counted and marked, but decimated ones are not") {
  RunView view(10.0);
  feed(view, 100, 200);  // joined late: nothing is lost
  CHECK(view.lost() == 0);
  feed(view, 250, 260);
  CHECK(view.lost() == 50);
  CHECK(view.samples()[100].after_gap);
  CHECK_FALSE(view.samples()[101].after_gap);
  RunView decimated(10.0);
  for (std::int64_t i = 0; i < 10; ++i) {
    telemetry_t m = telemetry(i);
    m.cycle = 10 * i;
    decimated.take(m, i * ms);
  }
  CHECK(decimated.lost() == 0);
}

TEST_CASE("a few messages out of order are not another run") {
  RunView view(10.0);
  feed(view, 0, 100);
  view.take(telemetry(102), 102 * ms);
  view.take(telemetry(101), 102 * ms);
  view.take(telemetry(102), 102 * ms);
  CHECK(view.runs() == 1);
  CHECK(view.telemetry()->sequence == 102);
}

TEST_CASE("a publisher that restarts is another run, whichever message comes first") {
  RunView view(10.0);
  view.take(experiment(0), 0);
  view.take(event(0, "phase", "run started"), 0);
  view.take(event(1, "phase", "brake"), 0);
  feed(view, 0, 5000);
  view.take(status(5), 5000 * ms);
  // In the order in which a run sends its first messages.
  view.take(experiment(0), 9000 * ms);
  CHECK(view.runs() == 2);
  CHECK(view.events().empty());
  CHECK(view.samples().empty());
  CHECK_FALSE(view.telemetry());
  CHECK_FALSE(view.status());
  view.take(event(0, "phase", "run started again"), 9000 * ms);
  view.take(telemetry(0), 9000 * ms);
  view.take(status(0), 9000 * ms);
  CHECK(view.runs() == 2);
  CHECK(view.events().front().message == "run started again");
  CHECK(view.samples().size() == 1);
  CHECK(view.lost() == 0);
  // The first messages of the third run are lost.
  feed(view, 1, 3000);
  view.take(telemetry(700), 20'000 * ms);
  CHECK(view.runs() == 3);
  CHECK(view.lost() == 0);
}

TEST_CASE("an answer between two runs of a series keeps the ended run in view") {
  RunView view(10.0);
  for (std::int64_t i = 0; i < 30; ++i) view.take(event(i, "phase", "x"), 0);
  feed(view, 0, 3000);
  view.take(event(0, "command", "stop accepted"), 5000 * ms);
  CHECK(view.runs() == 1);
  CHECK(view.samples().size() == 3000);
  CHECK(view.events().front().message == "stop accepted");
  CHECK(view.silence_s(5000 * ms) == 0.0);
  view.take(event(0, "phase", "run started"), 9000 * ms);
  CHECK(view.runs() == 2);
  CHECK(view.samples().empty());
}

TEST_CASE("silence and rate use the receiver's clock") {
  RunView view(10.0);
  CHECK_FALSE(view.silence_s(0));
  CHECK(view.messages_last_second(0) == 0);
  feed(view, 0, 3000);
  CHECK(view.messages_last_second(2999 * ms) == 1000);
  CHECK(view.messages_last_second(3499 * ms) == 500);
  CHECK_THAT(view.silence_s(6199 * ms).value(), Catch::Matchers::WithinAbs(3.2, 1e-9));
  CHECK(view.messages_last_second(6199 * ms) == 0);
  CHECK(view.silence_s(0) == 0.0);  // a clock read before the message was taken
}

TEST_CASE("events are kept up to a number, the latest first, their texts printable") {
  RunView view(10.0);
  for (std::int64_t i = 0; i < 100; ++i) view.take(event(i, "phase", "x"), 0);
  CHECK(view.events().size() == RunView::events_max);
  view.take(event(100, "limit", "\x1b]0;title\x07 and a text"), 0);
  CHECK(view.events().front().sequence == 100);
  CHECK(view.events().front().message == "?]0;title? and a text");
  event_t longer = event(101, "limit", "");
  longer.message.assign(100'000, 'x');
  view.take(longer, 0);
  CHECK(view.events().front().message.size() < 300);
}

TEST_CASE("NaN times are not plotted") {
  RunView view(10.0);
  feed(view, 0, 10);
  telemetry_t m = telemetry(10);
  m.time_s = unknown;
  view.take(m, 10 * ms);
  m = telemetry(11);
  m.time_s = std::numeric_limits<double>::infinity();
  view.take(m, 11 * ms);
  CHECK(view.samples().size() == 10);
  CHECK(view.telemetry()->sequence == 11);
}
