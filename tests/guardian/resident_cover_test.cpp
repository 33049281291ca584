// The guard of the resident service: runs that it covers, and what it takes back.
#include "resident_service.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;
using rig::Reason;

TEST_CASE("the stricter timeout counts: the run's or the service's") {
  const std::int64_t asked_ms = GENERATE(8, 20, 500);
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = asked_ms * ms});
  const std::int64_t timeout_ns = std::min<std::int64_t>(asked_ms, 20) * ms;
  CHECK(service.page.run_needs_ns.load() == timeout_ns);
  CHECK(service.guard.look_period_ns() == timeout_ns / 8);
  service.beats = true;
  service.pass(100 * ms);
  service.beats = false;
  const std::int64_t silent_ns = service.clock.now_ns();
  service.news.clear();
  while (service.said(NewsWord::acted) == nullptr) service.pass(ms);
  const GuardianReport& report = service.said(NewsWord::acted)->report;
  CHECK(report.reason == Reason::controller_silent);
  CHECK(report.noticed_ns - silent_ns >= timeout_ns - ms);
  CHECK(report.noticed_ns - silent_ns <= timeout_ns + timeout_ns / 8 + ms);
  CHECK(report.verified);
  CHECK(service.said(NewsWord::over) != nullptr);
  CHECK_FALSE(service.pages->guard().taken_back_for.load() == Reason::none);
  CHECK(service.pages->guard().ended_safe.load());
}

TEST_CASE("looks are neither denser than 0.25 ms nor rarer than 5 ms") {
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = ms});
  CHECK(service.guard.look_period_ns() == 250 * us);
  BoardGuard slow({.clock = service.clock,
                   .board = service.board,
                   .processes = service.processes,
                   .timeout_ns = 500 * ms,
                   .keep_ns = 5 * ms});
  slow.cover_only(Pages{}, run_process);
  CHECK(slow.look_period_ns() == 5 * ms);
}

TEST_CASE("a series: each run is covered anew, and the pauses are kept at zero") {
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.covered();
  for (int run = 1; run <= 3; ++run) {
    CHECK(service.pages->guard().covers.load() == static_cast<std::uint32_t>(run));
    service.board.duty = 0.6;
    const std::size_t from = service.story.size();
    service.pass(200 * ms);
    CHECK(service.story.size() == from);  // the board is the run's
    CHECK(service.board.duty == 0.6);
    service.board.duty = 0.0;
    service.beats = false;
    service.news.clear();
    service.stage(Stage::closed);
    service.pass(20 * ms);
    CHECK(service.said(NewsWord::ended) != nullptr);
    CHECK(service.said(NewsWord::over) == nullptr);
    CHECK(service.said(NewsWord::acted) == nullptr);
    CHECK(service.pages->guard().ends.load() == static_cast<std::uint32_t>(run));
    CHECK(service.pages->guard().ended_safe.load());
    service.board.duty = 0.73;
    service.pass(5 * ms);
    CHECK(service.board.duty == 0.0);
    service.pass(100 * ms);
    service.stage(Stage::guarded);
    CHECK(service.board.held);
    CHECK(service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::covered);
    CHECK_FALSE(service.board.held);  // the run opens it
    service.beats = true;
  }
}

TEST_CASE("a covered run that must give the outputs back gets a mark and the time to do it") {
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  service.news.clear();
  service.order({.word = OrderWord::take_back, .reason = Reason::machine_paused});
  service.pass(3 * ms);
  CHECK(service.pages->guard().taken_back_for.load() == Reason::machine_paused);
  CHECK(service.guard.holder() == run_process);
  service.stage(Stage::released);
  service.pass(30 * ms);
  REQUIRE(service.said(NewsWord::acted) != nullptr);
  CHECK(service.said(NewsWord::acted)->report.reason == Reason::machine_paused);
  CHECK(service.said(NewsWord::acted)->report.controller_lives);
  CHECK(service.said(NewsWord::acted)->report.controller_gone_ns == 0);
  CHECK(service.said(NewsWord::over) != nullptr);
  CHECK(service.count("end") == 0);
  CHECK(service.guard.holder() == -1);
  CHECK(service.guard.safe());
}

TEST_CASE("a suspension takes back the outputs of a run that was covered then, and of no later one") {
  Service service;
  service.guard.begin();
  service.clock.suspend(3'000 * ms);
  const std::uint32_t lease = service.covered();
  service.pass(50 * ms);
  CHECK(service.pages->guard().taken_back_for.load() == Reason::none);
  for (int i = 0; i < 2; ++i) {
    service.clock.suspend(900 * us);
    service.guard.look();
    CHECK(service.pages->guard().taken_back_for.load() == Reason::none);
  }
  service.clock.suspend(1'200 * us);
  service.guard.look();
  CHECK(service.pages->guard().taken_back_for.load() == Reason::computer_suspended);
  service.stage(Stage::released);
  service.pass(50 * ms);
  CHECK(service.guard.holder() == -1);
  service.beats = false;
  CHECK(service.covered() == lease + 1);
  service.pass(50 * ms);
  CHECK(service.pages->guard().taken_back_for.load() == Reason::none);
}

TEST_CASE("the first reason for which outputs are taken back stays") {
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  REQUIRE(service.mail.order({.word = OrderWord::take_back, .reason = Reason::machine_paused}));
  REQUIRE(service.mail.order({.word = OrderWord::take_back, .reason = Reason::computer_suspended}));
  service.pass(3 * ms);
  CHECK(service.pages->guard().taken_back_for.load() == Reason::machine_paused);
}

TEST_CASE("a run that is asked for its outputs is not covered again") {
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.covered();
  service.pass(50 * ms);
  service.beats = false;
  service.stage(Stage::closed);
  service.news.clear();
  service.order({.word = OrderWord::close, .lease = lease});
  service.pass(20 * ms);
  CHECK(service.said(NewsWord::over) != nullptr);
  CHECK(service.guard.holder() == -1);
}

TEST_CASE("outputs that nobody covers are taken back at once") {
  Service service;
  service.guard.begin();
  service.granted();
  service.board.duty = 0.5;
  service.order({.word = OrderWord::take_back, .reason = Reason::computer_suspended});
  CHECK(service.said(NewsWord::over) != nullptr);
  CHECK(service.board.duty == 0.0);
  CHECK(service.count("end") == 0);
}

TEST_CASE("the lease of a holder that dies between its runs is over at the next look") {
  Service service;
  service.guard.begin();
  service.granted();
  service.board.duty = 0.5;
  service.processes.dies_at_ns[run_process] = 0;
  service.guard.look();
  service.take_news();
  CHECK(service.said(NewsWord::over) != nullptr);
  CHECK(service.board.duty == 0.0);
  CHECK(service.guard.holder() == -1);
  CHECK(service.granted(other_process) != 0);
  CHECK(service.guard.holder() == other_process);
}

TEST_CASE("a covered run that dies is zero at once, and its lease is over") {
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  service.board.duty = 0.5;
  service.beats = false;
  service.processes.dies_at_ns[run_process] = 0;
  service.news.clear();
  service.guard.look();
  service.take_news();
  CHECK(service.board.duty == 0.0);
  REQUIRE(service.said(NewsWord::acted) != nullptr);
  CHECK(service.said(NewsWord::acted)->report.reason == Reason::controller_died);
  CHECK(service.said(NewsWord::acted)->report.tries == 1);
  CHECK(service.pages->guard().ends.load() == 1);
  CHECK(service.said(NewsWord::over) != nullptr);
  CHECK(service.guard.safe());
  CHECK_FALSE(service.guard.over());
}

TEST_CASE("the report of a run that dies after it released its outputs says when") {
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  service.beats = false;
  service.stage(Stage::released);
  service.pass(20 * ms);
  service.news.clear();
  const std::int64_t died_ns = service.clock.now_ns();
  service.processes.dies_at_ns[run_process] = died_ns;
  service.pass(20 * ms);
  REQUIRE(service.said(NewsWord::acted) != nullptr);
  const GuardianReport& report = service.said(NewsWord::acted)->report;
  CHECK(report.reason == Reason::controller_died);
  CHECK(report.controller_gone_ns >= died_ns);
  CHECK_FALSE(report.acted);
  CHECK(service.said(NewsWord::ended) != nullptr);
  CHECK_FALSE(service.guard.over());
}

TEST_CASE("a foreign duty between the cover and the first cycle is gone within 20 ms") {
  const std::int64_t after_ns = GENERATE(0, 7 * ms, 14'900 * us, 15'100 * us, 400 * ms, 900 * ms);
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  REQUIRE(service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::covered);
  const std::int64_t from_ns = service.clock.now_ns() + after_ns;
  std::int64_t on_ns = 0;
  service.happens = [&](std::int64_t now_ns) {
    if (now_ns == from_ns) service.board.duty = 0.8;
    if (service.board.duty > 0.0) on_ns += 100 * us;
  };
  if (after_ns == 0) service.board.duty = 0.8;
  service.pass(after_ns + 40 * ms);
  CAPTURE(after_ns, on_ns);
  CHECK(on_ns > 0);
  CHECK(on_ns <= 20 * ms);
  CHECK(service.processes.lives(run_process));
}

TEST_CASE("between the cover and the first cycle the board is looked at only after the run has taken it over") {
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  const std::size_t from = service.story.size();
  REQUIRE(service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::covered);
  service.pass(14 * ms);
  CHECK(service.story.size() == from);
  service.pass(500 * ms);
  CHECK(service.count("look", from) >= 90);
  CHECK(service.count("write", from) == 0);
  service.board.shared = false;  // a board that cannot be looked at beside its owner
  const std::size_t then = service.story.size();
  service.pass(100 * ms);
  CHECK(service.story.size() == then);
}

TEST_CASE("a holder whose board is driven again and again before its first cycle is ended") {
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  REQUIRE(service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::covered);
  service.happens = [&](std::int64_t) { service.board.duty = 0.8; };
  const std::int64_t from_ns = service.clock.now_ns();
  while (service.processes.lives(run_process) && service.clock.now_ns() < from_ns + 100 * ms) service.pass(ms);
  CHECK(service.clock.now_ns() - from_ns <= 30 * ms);
  REQUIRE(service.said(NewsWord::acted) != nullptr);
  CHECK(service.said(NewsWord::acted)->report.reason == Reason::foreign_writer);
}

TEST_CASE("a holder that begins no cycle within a second of the cover is ended") {
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  REQUIRE(service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::covered);
  service.pass(990 * ms);
  CHECK(service.processes.lives(run_process));
  service.pass(20 * ms);
  CHECK_FALSE(service.processes.lives(run_process));
}

TEST_CASE("the guard says that somebody drives without a cover after five looks, at any pace, and while it lasts") {
  const std::int64_t every_ms = GENERATE(1, 10, 200, 5'000);
  Service service;
  service.guard.begin();
  std::int64_t on_ns = 0;
  service.happens = [&](std::int64_t now_ns) {
    if (now_ns % (every_ms * ms) == 0) service.board.duty = 0.5;
    if (service.board.duty > 0.0) on_ns += 100 * us;
  };
  const std::int64_t from_ns = service.clock.now_ns();
  while (!service.guard.driven_by_others()) {
    service.pass(ms);
    REQUIRE(service.clock.now_ns() - from_ns <= 5 * every_ms * ms + 20 * ms);
  }
  CAPTURE(every_ms);
  CHECK(on_ns <= 30 * ms);
  service.happens = {};
  service.pass(50 * ms);
  CHECK_FALSE(service.guard.driven_by_others());
}

TEST_CASE("a board that comes back with a duty is no foreign writer, nor is a run that is covered") {
  Service service;
  service.guard.begin();
  for (int time = 0; time < 5; ++time) {
    service.board.duty = 0.5;
    service.pass(50 * ms);
    CHECK(service.board.duty == 0.0);
    CHECK_FALSE(service.guard.driven_by_others());
    service.pass(61'000 * ms);
  }
  static_cast<void>(service.covered());
  service.pass(2 * ms);
  for (int look = 0; look < 100; ++look) {
    service.board.duty = 0.5;
    service.pass(ms);
    REQUIRE_FALSE(service.guard.driven_by_others());
  }
}
