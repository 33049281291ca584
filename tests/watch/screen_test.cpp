#include "watch/screen.hpp"

#include <algorithm>
#include <limits>
#include <string>

#include "abs_hil/rig/reason.hpp"
#include "catch.hpp"
#include "messages.hpp"

using namespace abs_hil;
using namespace abs_hil::watch;
using namespace abs_hil::watch::test;
using abs_hil::rig::unknown;
using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

namespace {

/// A run of 5 s.
RunView whole_run() {
  RunView view(10.0);
  view.take(experiment(0), 0);
  view.take(event(0, "phase", "run started"), 0);
  feed(view, 0, 5000);
  view.take(status(5), 4999 * ms);
  return view;
}

std::string shown(const RunView& view, std::int64_t now_ns, ScreenOptions options = {}) {
  return draw_screen(view, now_ns, options).to_text();
}

bool has_style(const CellGrid& grid, int row, Style style) {
  for (int column = 0; column < grid.columns(); ++column) {
    if (grid.at(column, row).style == style) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("the screen of a run shows all its quantities") {
  const std::string text = shown(whole_run(), 4999 * ms);
  CHECK_THAT(text, Contains("paper · adaptive · paper-table1 · sim"));
  CHECK_THAT(text, Contains("1000 messages/s"));
  CHECK_THAT(text, Contains("brake        4.999 s  ω1  80.0 ω2 100.0 rad/s  slip  0.210/0.200  θ̂  22.50 N"));
  CHECK_THAT(text, Contains("wake-up 11/12/13/14 cycle 15/15/15/15 µs"));
  CHECK_THAT(text, Contains("overruns 0  drops 0  unpublished 0  lost on the way 0"));
  CHECK_THAT(text, Contains("run started"));
  CHECK_THAT(text, Contains("-10 s") && Contains("now"));
  CHECK_THAT(text, Contains("⠤") || Contains("⠒") || Contains("⣀") || Contains("⠉"));
  CHECK_THAT(text, Contains("q quits"));
}

TEST_CASE("the controller's own signals stand above the timing, for as long as they come") {
  RunView view = whole_run();
  CHECK_THAT(shown(view, 4999 * ms), !Contains("zeta_N"));
  view.take(with_signals(5000), 5000 * ms);
  CHECK_THAT(shown(view, 5000 * ms), Contains("I_m 0.1250  zeta_N 15.5000") && Contains("wake-up 11/12/13/14"));
  view.take(telemetry(0), 5000 * ms);  // another run, whose controller has none
  CHECK_THAT(shown(view, 5000 * ms), !Contains("zeta_N"));
}

TEST_CASE("a phase has the name that the experiment gives it") {
  RunView view = whole_run();
  telemetry_t named = telemetry(5000);
  named.phase_name = "brake-low";
  view.take(named, 5000 * ms);
  CHECK_THAT(shown(view, 5000 * ms), Contains("brake-low    5.000 s"));
  CHECK_THAT(one_line(view, 5000 * ms, {}), StartsWith("brake-low    5.000 s"));
  telemetry_t last = telemetry(5001);
  last.phase = telemetry_t::PHASE_FAULT;  // no phase of the experiment
  view.take(last, 5001 * ms);
  CHECK_THAT(one_line(view, 5001 * ms, {}), StartsWith("fault "));
}

TEST_CASE("names of signals from the network are made printable") {
  RunView view(10.0);
  telemetry_t hostile = telemetry(0);
  hostile.names = "\x1b[2J,,a,b,c,d,e,f,g,h,i";
  hostile.values.assign(100, 1.0);
  view.take(hostile, 0);
  REQUIRE(view.values().size() == 11);
  CHECK(view.values()[0].name == "?[2J");
  hostile = telemetry(1);
  hostile.phase_name = "\x1b[2J";
  view.take(hostile, ms);
  CHECK(view.name_of(rig::Phase::brake) == "?[2J");
}

TEST_CASE("ASCII is ASCII everywhere") {
  const RunView view = whole_run();
  for (const char c : shown(view, 9000 * ms, {.columns = 120, .rows = 50, .unicode = false})) {
    CHECK(static_cast<unsigned char>(c) < 0x80);
  }
  CHECK_THAT(shown(view, 4999 * ms, {.unicode = false}), Contains("w1  80.0") && Contains("*****"));
}

TEST_CASE("waiting, silence and the end of a run look different") {
  CHECK_THAT(
      shown(RunView(10.0), 0, {.source = "udpm://here", .channel = "ABS_TELEMETRY"}),
      Contains("waiting for messages") && Contains("No message has arrived yet on ABS_TELEMETRY at udpm://here."));
  RunView view = whole_run();
  const CellGrid grid = draw_screen(view, 8199 * ms, {});
  CHECK_THAT(grid.to_text(), Contains("  no messages for 3.2 s"));
  CHECK(has_style(grid, 0, Style::alarm));
  telemetry_t last = telemetry(5000);
  last.phase = telemetry_t::PHASE_STOPPED;
  view.take(last, 5000 * ms);
  const CellGrid ended = draw_screen(view, 8200 * ms, {});
  CHECK_THAT(ended.to_text(), Contains("run ended, no messages for 3.2 s"));
  CHECK_FALSE(has_style(ended, 0, Style::alarm));
}

TEST_CASE("a fault is shown with its reason, from the event or without it") {
  RunView view = whole_run();
  telemetry_t m = telemetry(5000);
  m.phase = telemetry_t::PHASE_FAULT;
  m.reason = static_cast<std::int16_t>(rig::Reason::overspeed);
  view.take(m, 5000 * ms);
  CHECK_THAT(shown(view, 5000 * ms), Contains("fault") && Contains("wheel speed above the limit"));
  view.take(event(1, "fault", "wheel 2 at 190 rad/s"), 5000 * ms);
  const CellGrid grid = draw_screen(view, 5000 * ms, {});
  CHECK_THAT(grid.to_text(), Contains("wheel 2 at 190 rad/s"));
  CHECK(has_style(grid, 1, Style::alarm));
}

TEST_CASE("counts that should be 0 are highlighted") {
  RunView view = whole_run();
  status_t s = status(6);
  s.overruns = 3;
  s.telemetry_drops = 4;
  s.realtime = 0;
  view.take(s, 5000 * ms);
  view.take(telemetry(5010), 5010 * ms);
  view.note_malformed();
  CHECK_THAT(shown(view, 5010 * ms), Contains("overruns 3  drops 4") && Contains("lost on the way 10") &&
                                         Contains("malformed 1") && Contains("NOT IN REAL TIME"));
}

TEST_CASE("a screen can be drawn at every size") {
  const RunView view = whole_run();
  for (int columns = -1; columns < 140; columns += 3) {
    for (int rows = -1; rows < 60; rows += 2) {
      const CellGrid grid = draw_screen(view, 4999 * ms, {.columns = columns, .rows = rows});
      REQUIRE(grid.columns() == std::max(columns, 0));
      REQUIRE(grid.rows() == std::max(rows, 0));
    }
  }
  CHECK_THAT(shown(view, 4999 * ms, {.columns = 80, .rows = 12}), Contains("slip  ━") && Contains("lost on the way"));
  CHECK_THAT(shown(view, 4999 * ms, {.columns = 80, .rows = 24}), Contains("θ̂, N"));
}

TEST_CASE("a screen can be drawn for any numbers") {
  constexpr double inf = std::numeric_limits<double>::infinity();
  for (const double value : {unknown, inf, -inf, 1e300, -1e300, 5e-324, 0.0}) {
    RunView view(10.0);
    for (std::int64_t i = 0; i < 100; ++i) {
      telemetry_t m = telemetry(i);
      m.omega1_rad_s = m.omega2_rad_s = m.slip = m.slip_ref = m.theta_est_N = m.theta_N = value;
      m.phase = static_cast<std::int8_t>(i - 50);
      m.reason = static_cast<std::int16_t>(i * 300);
      if (i > 90) m.time_s = value;
      view.take(m, i * ms);
    }
    status_t s = status(0);
    s.cycle_time_max_us = s.wakeup_latency_p50_us = value;
    view.take(s, 0);
    const CellGrid grid = draw_screen(view, 100 * ms, {});
    CHECK(grid.rows() == 24);
    CHECK_FALSE(one_line(view, 100 * ms, {}).empty());
  }
}

TEST_CASE("one line holds the same for a log") {
  CHECK(one_line(RunView(10.0), 0, {}) == "waiting for messages");
  const std::string line = one_line(whole_run(), 4999 * ms, {.unicode = false});
  CHECK(line ==
        "brake        4.999 s  w1  80.0 w2 100.0 rad/s  slip  0.210/0.200  theta  22.50 N  overruns 0  "
        "drops 0  lost 0  1000 messages/s");
}
