// The guard of the resident service: ends of runs, leases and of the service.
#include "resident_service.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;
using rig::Reason;

TEST_CASE("zeros are written first when a run says that it has closed") {
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  const std::size_t from = service.story.size();
  service.beats = false;
  service.stage(Stage::closed);
  service.pass(20 * ms);
  REQUIRE(service.story.size() > from);
  CHECK(service.story[from] == "write");
  CHECK_FALSE(service.guard.over());
}

TEST_CASE("the two looks for which a run is believed are keep_ms apart, however dense its watch") {
  Service service;
  service.guard.begin();
  service.covered();  // watched every 2.5 ms
  service.pass(50 * ms);
  service.beats = false;
  service.stage(Stage::closed);
  service.guard.look();
  const std::size_t first = service.story.size();
  CHECK(service.story.back() == "write");
  service.pass(4'900 * us);
  CHECK(service.story.size() == first);
  CHECK_FALSE(service.pages->guard().ended_safe.load());
  service.pass(200 * us);
  CHECK(service.story.size() == first + 1);
  CHECK(service.pages->guard().ended_safe.load());
}

TEST_CASE("a run that makes its outputs safe again and again is not silent, with cycles or without") {
  const bool with_cycles = GENERATE(false, true);
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  service.beats = with_cycles;
  service.happens = [&](std::int64_t now_ns) {
    if (now_ns % ms == 0) service.pages->run().safe_beats.fetch_add(1);
  };
  service.news.clear();
  service.pass(100 * ms);
  CHECK(service.said(NewsWord::acted) == nullptr);
  CHECK(service.guard.holder() == run_process);
}

TEST_CASE("a guard that has just written zeros waits keep_ms with its first look") {
  Service service;
  service.guard.begin();
  service.guard.look();
  CHECK(service.story == Story{"write"});
}

TEST_CASE("a guard that is told to end looks at once") {
  Service service;
  service.guard.begin();
  service.pass(5 * ms + 200 * us);
  service.board.duty = 0.5;
  service.guard.end();
  service.guard.look();
  CHECK(service.board.duty == 0.0);
}

TEST_CASE("no lease is granted on a board that has just shown a foreign duty") {
  Service service;
  service.guard.begin();
  service.pass(5 * ms + 200 * us);
  service.board.duty = 0.5;
  const News refused = service.answer({.word = OrderWord::grant, .pid = run_process});
  CHECK(refused.word == NewsWord::refused);
  CHECK(refused.why == Refusal::not_safe);
  CHECK(service.board.duty == 0.0);
  service.pass(5 * ms);
  service.granted();
}

TEST_CASE("a new lease owes nothing to the former one") {
  Service service;
  service.guard.begin();
  // The former holder had a run covered, drove its board now and then, and lost its talker.
  service.covered();
  service.pass(50 * ms);
  service.guard.lost_talker();
  service.beats = false;
  service.stage(Stage::closed);
  service.pass(20 * ms);
  REQUIRE(service.guard.holder() == -1);
  const std::uint32_t lease = service.granted(other_process);
  service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms});
  service.beats = true;
  service.pass(50 * ms);
  service.beats = false;
  service.stage(Stage::closed);
  service.pass(20 * ms);
  CHECK(service.guard.holder() == other_process);  // its talker lives
  service.order({.word = OrderWord::close, .lease = lease});
  service.granted();
  service.pass(10'020 * ms);
  CHECK(service.guard.holder() == -1);  // it has had no run covered
}

TEST_CASE("a run goes on without the talker, and its lease ends with it") {
  Service service;
  service.guard.begin();
  service.guard.lost_talker();  // nobody has the lease
  const std::uint32_t lease = service.covered();
  service.pass(50 * ms);
  service.guard.lost_talker();
  service.news.clear();
  service.pass(500 * ms);
  CHECK(service.guard.holder() == run_process);
  CHECK(service.said(NewsWord::over) == nullptr);
  service.beats = false;
  service.stage(Stage::closed);
  service.pass(20 * ms);
  REQUIRE(service.said(NewsWord::over) != nullptr);
  CHECK(service.said(NewsWord::over)->lease == lease);
  CHECK(service.guard.holder() == -1);
  service.granted();
  service.news.clear();
  service.guard.lost_talker();
  service.take_news();
  CHECK(service.said(NewsWord::over) != nullptr);
}

TEST_CASE("a service that is told to end takes its lease back, verifies zeros, and ends") {
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  service.guard.end();
  service.pass(3 * ms);
  CHECK_FALSE(service.guard.over());
  CHECK(service.pages->guard().taken_back_for.load() == Reason::guardian_told_to_end);
  service.stage(Stage::released);
  service.pass(30 * ms);
  CHECK(service.guard.over());
  CHECK(service.guard.safe());
}

TEST_CASE("a service that ends grants no lease, and waits a second for a board that does not answer") {
  Service service;
  service.guard.begin();
  service.board.duty = 0.5;
  service.guard.end();
  service.order({.word = OrderWord::grant, .pid = run_process});
  REQUIRE(service.said(NewsWord::refused) != nullptr);
  CHECK(service.said(NewsWord::refused)->why == Refusal::held);
  Service lost;
  lost.board.fails_first = 1'000'000;
  lost.guard.begin();
  lost.guard.end();
  lost.pass(990 * ms);
  CHECK_FALSE(lost.guard.over());
  lost.pass(20 * ms);
  CHECK(lost.guard.over());
  CHECK_FALSE(lost.guard.safe());
}

TEST_CASE("the report of a run does not wait for a board that is gone, the tries go on") {
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  service.board.duty = 0.5;
  service.board.fails_first = 400;
  service.beats = false;
  service.processes.dies_at_ns[run_process] = 0;
  service.news.clear();
  const std::int64_t died_ns = service.clock.now_ns();
  while (service.said(NewsWord::acted) == nullptr) {
    service.pass(ms);
    CHECK_FALSE(service.guard.safe());
  }
  CHECK(service.clock.now_ns() - died_ns >= 195 * ms);
  CHECK(service.clock.now_ns() - died_ns <= 220 * ms);
  const GuardianReport& report = service.said(NewsWord::acted)->report;
  CHECK_FALSE(report.verified);
  CHECK(report.verified_ns == 0);
  // A try a millisecond at first, then one every 10 ms.
  CHECK(report.tries >= 100);
  CHECK(report.tries <= 115);
  CHECK_FALSE(service.pages->guard().ended_safe.load());
  CHECK_FALSE(service.guard.safe());
  CHECK(service.said(NewsWord::over) != nullptr);
  service.pass(4'000 * ms);
  CHECK(service.board.duty == 0.0);
  CHECK(service.guard.safe());
}

TEST_CASE("a board of one owner is left alone during its lease") {
  Service service;
  service.board.shared = false;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  const std::size_t from = service.story.size();
  service.pass(1'000 * ms);
  CHECK(service.story.size() == from);
  CHECK(service.guard.next_ns() - service.clock.now_ns() == ms);
  service.board.duty = 0.5;
  service.order({.word = OrderWord::close, .lease = lease});
  CHECK(service.board.duty == 0.0);
}

TEST_CASE("a run that keeps its board of one owner is believed for now, and its lease goes on") {
  Service service;
  service.board.shared = false;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  service.beats = false;
  service.board.fails_first = 1'000'000;
  service.stage(Stage::closed);
  service.news.clear();
  service.pass(10 * ms);
  CHECK(service.said(NewsWord::ended) != nullptr);
  CHECK(service.said(NewsWord::over) == nullptr);
  CHECK_FALSE(service.guard.safe());
}

TEST_CASE("the end of a process is looked for every 0.1 ms before the first write") {
  Service service;
  service.processes.dying_takes_ns = 250 * us;
  service.guard.begin();
  service.covered();
  service.pass(50 * ms);
  service.beats = false;
  service.news.clear();
  while (service.said(NewsWord::acted) == nullptr) service.pass(ms);
  const GuardianReport& report = service.said(NewsWord::acted)->report;
  CHECK(report.controller_gone_ns - report.noticed_ns == 300 * us);
  CHECK(report.tries == 1);
}

TEST_CASE("a former holder that keeps its board is ended after a second") {
  Service service;
  service.board.shared = false;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  // The board cannot be opened as long as its owner lives.
  service.happens = [&](std::int64_t) { service.board.fails_first = service.processes.lives(run_process) ? 1 : 0; };
  service.board.fails_first = 1;
  service.order({.word = OrderWord::close, .lease = lease});
  CHECK_FALSE(service.guard.safe());
  service.pass(980 * ms);
  CHECK(service.count("end") == 0);
  service.pass(40 * ms);
  CHECK(service.count("end") == 1);
  service.pass(20 * ms);
  CHECK(service.guard.safe());
  service.granted(other_process);
}

TEST_CASE("the guard takes eight orders a look, and answers orders to look with what it saw at once") {
  Service service;
  service.guard.begin();
  service.pass(ms);
  const std::size_t from = service.story.size();
  for (int i = 0; i < 20; ++i) REQUIRE(service.mail.order({.word = OrderWord::look}));
  service.news.clear();
  service.guard.look();
  service.take_news();
  CHECK(service.news.size() == 8);
  CHECK(service.news.front().word == NewsWord::looked);
  CHECK(service.news.front().safe);
  CHECK(service.count("look", from) == 1);
  service.guard.look();
  service.guard.look();
  const std::uint32_t lease = service.granted();
  const std::size_t during = service.story.size();
  CHECK(service.answer({.word = OrderWord::look}).lease == lease);
  CHECK(service.story.size() == during);
}

TEST_CASE("the guard tells the standby while it waits for the board") {
  struct Slow final : driver::SafeStateWriter {
    explicit Slow(const ServicePage& of) : page(of) {}
    [[nodiscard]] std::string_view name() const noexcept override { return "slow"; }
    void prepare() override {}
    [[nodiscard]] driver::IoResult make_safe() noexcept override { return seen(); }
    [[nodiscard]] driver::IoResult verify_safe() noexcept override { return seen(); }
    driver::IoResult seen() noexcept {
      told = told && page.accesses_board.load();
      return {};
    }
    const ServicePage& page;
    bool told{true};
  };
  Service service;
  Slow board(service.page);
  BoardGuard guard({.clock = service.clock,
                    .board = board,
                    .processes = service.processes,
                    .timeout_ns = 20 * ms,
                    .keep_ns = 5 * ms,
                    .mail = &service.mail,
                    .page = &service.page});
  guard.begin();
  service.clock.sleep_until(service.clock.now_ns() + 10 * ms);
  guard.look();
  CHECK(board.told);
  CHECK_FALSE(service.page.accesses_board.load());
}
