// The guard of the resident service: leases, orders, and the board while no run is covered. Mailbox and pages are real.
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <optional>
#include <vector>

#include "catch.hpp"
#include "guardian/board_guard.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;
using rig::Reason;

namespace {

constexpr pid_t run_process = 4711;
constexpr pid_t other_process = 815;

/// The guard of a service, and the talker's side of the mail.
struct Service {
  Service() {
    clock.happens = [this](std::int64_t now_ns) {
      if (beats && now_ns % ms == 0) pages->run().cycle_beats.fetch_add(1);
      if (happens) happens(now_ns);
    };
  }
  /// Time in which the guard looks as often as it wants to.
  void pass(std::int64_t duration_ns) {
    for (const std::int64_t end_ns = clock.now_ns() + duration_ns; clock.now_ns() < end_ns;) {
      guard.look();
      ++looks;
      take_news();
      clock.sleep_until(std::min(end_ns, std::max(guard.next_ns(), clock.now_ns() + 100 * us)));
    }
    guard.look();
    take_news();
  }
  void take_news() {
    News one;
    driver::FileDescriptor run(-1);
    driver::FileDescriptor page_of_guard(-1);
    while (mail.next(one, run, page_of_guard)) {
      news.push_back(one);
      if (one.word == NewsWord::granted) pages.emplace(Pages::as_run({run.get(), page_of_guard.get()}));
    }
  }
  /// Answers to one order.
  std::vector<News> order(const Order& order) {
    news.clear();
    REQUIRE(mail.order(order));
    guard.look();
    take_news();
    return news;
  }
  News answer(const Order& one) {
    const std::vector<News> all = order(one);
    REQUIRE_FALSE(all.empty());
    return all.back();
  }
  std::uint32_t granted(pid_t pid = run_process) {
    const News said = answer({.word = OrderWord::grant, .pid = pid});
    REQUIRE(said.word == NewsWord::granted);
    return said.lease;
  }
  std::uint32_t covered(pid_t pid = run_process) {
    const std::uint32_t lease = granted(pid);
    REQUIRE(answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::covered);
    beats = true;
    return lease;
  }
  [[nodiscard]] const News* said(NewsWord word) const {
    const auto found = std::find_if(news.begin(), news.end(), [&](const News& one) { return one.word == word; });
    return found == news.end() ? nullptr : &*found;
  }
  /// How often the story has `what` from its line `from` on.
  [[nodiscard]] std::int64_t count(const char* what, std::size_t from = 0) const {
    return std::count(story.begin() + static_cast<std::ptrdiff_t>(from), story.end(), what);
  }
  void stage(Stage to) { pages->run().stage = to; }

  Story story;
  ScriptedClock clock;
  ScriptedProcesses processes{clock, story};
  ScriptedBoard board{story};
  Mail mail;
  ServicePage page;
  std::optional<Pages> pages;
  std::vector<News> news;
  std::function<void(std::int64_t)> happens;
  bool beats{false};
  int looks{0};
  BoardGuard guard{{.clock = clock,
                    .board = board,
                    .processes = processes,
                    .timeout_ns = 20 * ms,
                    .keep_ns = 5 * ms,
                    .mail = &mail,
                    .page = &page}};
};

}  // namespace

TEST_CASE("a resident guard writes zeros first, and looks at them every keep_ms") {
  Service service;
  service.guard.begin();
  CHECK(service.story == Story{"write"});
  CHECK(service.guard.safe());
  service.pass(1'000 * ms);
  CHECK(service.count("look") >= 199);
  CHECK(service.count("look") <= 201);
  CHECK(service.count("write") == 1);
  CHECK(service.page.guard_beats.load() >= 200);
  CHECK_FALSE(service.page.accesses_board.load());
}

TEST_CASE("a duty that nobody may write goes within keep_ms, and is then looked for every millisecond") {
  Service service;
  service.guard.begin();
  service.pass(101 * ms);
  service.board.duty = 0.73;
  service.pass(5 * ms);
  CHECK(service.board.duty == 0.0);
  CHECK(service.guard.safe());  // it was read back since
  const std::size_t from = service.story.size();
  service.board.duty = 0.73;
  service.pass(1 * ms + 100 * us);
  CHECK(service.board.duty == 0.0);
  CHECK(service.count("look", from) + service.count("write", from) >= 1);
  // Twelve looks weigh off the most that duties can weigh.
  service.pass(20 * ms);
  const std::size_t calm = service.story.size();
  service.pass(100 * ms);
  CHECK(service.count("look", calm) <= 21);
}

TEST_CASE("a guard that reads a foreign duty says so") {
  Service service;
  service.guard.begin();
  service.pass(10 * ms);
  service.news.clear();
  service.board.duty = 0.73;
  service.pass(5 * ms);
  REQUIRE(service.said(NewsWord::board) != nullptr);
  CHECK(service.said(NewsWord::board)->board.error == driver::IoError::foreign_writer);
  CHECK_FALSE(service.said(NewsWord::board)->safe);
}

TEST_CASE("a board that does not answer is tried every 10 ms, and no lease is granted") {
  Service service;
  service.board.fails_first = 50;
  service.guard.begin();
  CHECK_FALSE(service.guard.safe());
  service.pass(301 * ms);
  CHECK(service.count("write") >= 30);
  CHECK(service.count("write") <= 32);
  const News refused = service.answer({.word = OrderWord::grant, .pid = run_process});
  CHECK(refused.word == NewsWord::refused);
  CHECK(refused.why == Refusal::not_safe);
  CHECK(service.page.holder.load() == 0);
  service.news.clear();
  service.pass(250 * ms);
  REQUIRE(service.said(NewsWord::board) != nullptr);
  CHECK(service.said(NewsWord::board)->board.ok());
  CHECK(service.guard.safe());
  service.granted();
}

TEST_CASE("one process at a time has the lease, and only one that the guard can end") {
  Service service;
  service.guard.begin();
  service.processes.dies_at_ns[other_process] = 0;
  const News none = service.answer({.word = OrderWord::grant, .pid = other_process});
  CHECK(none.word == NewsWord::refused);
  CHECK(none.why == Refusal::cannot_end_it);
  CHECK(service.guard.holder() == -1);
  const std::uint32_t lease = service.granted();
  CHECK(lease != 0);
  CHECK(service.guard.holder() == run_process);
  CHECK(service.page.holder.load() == run_process);
  CHECK_FALSE(service.board.held);
  const News held = service.answer({.word = OrderWord::grant, .pid = run_process + 1});
  CHECK(held.word == NewsWord::refused);
  CHECK(held.why == Refusal::held);
  CHECK(held.lease == lease);
  service.order({.word = OrderWord::close, .lease = lease});
  CHECK(service.said(NewsWord::over) != nullptr);
  CHECK(service.said(NewsWord::over)->why == Refusal::none);
  CHECK(service.page.holder.load() == 0);
  CHECK(service.board.held);
  CHECK(service.pages->guard().taken_back_for.load() == Reason::lease_closed);
  CHECK(service.granted() == lease + 1);
}

TEST_CASE("a process whose handle is 0 is a process like others") {
  Service service;
  service.processes.first = run_process;
  service.processes.dying_takes_ns = 300 * ms;
  service.guard.begin();
  service.covered();
  CHECK(service.guard.holder() == 0);
  service.pass(50 * ms);
  service.beats = false;
  service.news.clear();
  while (service.said(NewsWord::over) == nullptr) service.pass(ms);  // silent, ended, still there
  service.pass(10 * ms);
  const News refused = service.answer({.word = OrderWord::grant, .pid = other_process});
  CHECK(refused.why == Refusal::former_lives);
  CHECK(refused.former_pid == run_process);
  service.pass(500 * ms);
  CHECK(service.guard.safe());
  CHECK(service.answer({.word = OrderWord::grant, .pid = other_process}).former_pid == 0);
}

TEST_CASE("a holder whose handle is 0 may live on after its lease") {
  Service service;
  service.processes.first = run_process;
  service.guard.begin();
  service.order({.word = OrderWord::close, .lease = service.granted()});
  CHECK(service.guard.safe());
  CHECK(service.answer({.word = OrderWord::grant, .pid = run_process + 1}).word == NewsWord::granted);
}

TEST_CASE("the lease of a holder whose handle is 0 ends with its process") {
  Service service;
  service.processes.first = run_process;
  service.board.shared = false;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  service.happens = [&](std::int64_t) { service.board.fails_first = service.processes.lives(0) ? 1 : 0; };
  service.board.fails_first = 1;
  service.order({.word = OrderWord::close, .lease = lease});
  service.pass(1'020 * ms);
  CHECK(service.count("end") == 1);
  service.processes.dies_at_ns.clear();
  service.board.fails_first = 0;
  service.happens = nullptr;
  service.pass(20 * ms);
  service.granted();
  service.processes.dies_at_ns[0] = 0;
  service.news.clear();
  service.pass(ms);
  CHECK(service.said(NewsWord::over) != nullptr);
}

TEST_CASE("orders of a lease that is over change nothing") {
  Service service;
  service.guard.begin();
  const std::uint32_t first = service.granted();
  service.order({.word = OrderWord::close, .lease = first});
  CHECK(service.answer({.word = OrderWord::cover, .lease = 0, .timeout_ns = 20 * ms}).word == NewsWord::refused);
  const std::uint32_t lease = service.granted();
  CHECK(service.order({.word = OrderWord::close, .lease = first}).empty());
  CHECK(service.guard.holder() == run_process);
  CHECK(service.answer({.word = OrderWord::cover, .lease = first, .timeout_ns = 20 * ms}).word == NewsWord::refused);
  CHECK(service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::covered);
  CHECK(service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms}).word == NewsWord::refused);
}

TEST_CASE("a holder without a covered run keeps its lease for ten seconds") {
  Service service;
  service.guard.begin();
  service.processes.dying_takes_ns = 300 * ms;
  service.granted();
  service.news.clear();
  service.pass(9'990 * ms);
  CHECK(service.guard.holder() == run_process);
  service.pass(20 * ms);
  REQUIRE(service.said(NewsWord::over) != nullptr);
  CHECK(service.said(NewsWord::over)->why == Refusal::too_late);
  CHECK(service.count("end") == 1);
  // The one that was ended could still write.
  CHECK_FALSE(service.guard.safe());
  const News refused = service.answer({.word = OrderWord::grant, .pid = other_process});
  CHECK(refused.why == Refusal::former_lives);
  CHECK(refused.former_pid == run_process);
  service.processes.dies_at_ns[run_process] = 0;
  service.pass(5 * ms);
  CHECK(service.guard.safe());
  CHECK(service.answer({.word = OrderWord::grant, .pid = other_process}).word == NewsWord::granted);
}

TEST_CASE("a holder that has had a run covered may rest for as long as it likes") {
  Service service;
  service.guard.begin();
  service.covered();
  service.pass(100 * ms);
  service.beats = false;
  service.stage(Stage::closed);
  service.pass(20'000 * ms);
  CHECK(service.guard.holder() == run_process);
  CHECK(service.count("end") == 0);
  CHECK(service.guard.safe());
  const std::size_t from = service.story.size();
  service.pass(1'000 * ms);
  CHECK(service.count("look", from) >= 199);
}

TEST_CASE("a holder that drives its board while no run is covered is ended, and its lease is over") {
  Service service;
  service.guard.begin();
  service.granted();
  service.happens = [&](std::int64_t) {
    if (service.processes.lives(run_process)) service.board.duty = 0.5;
  };
  service.news.clear();
  const std::int64_t start_ns = service.clock.now_ns();
  while (service.said(NewsWord::over) == nullptr) service.pass(ms);
  CHECK(service.clock.now_ns() - start_ns <= 26 * ms);
  CHECK(service.said(NewsWord::over)->why == Refusal::not_safe);
  CHECK(service.count("end") == 1);
  service.pass(10 * ms);
  CHECK(service.board.duty == 0.0);
  CHECK(service.guard.safe());
}

TEST_CASE("a holder is not ended for duties that another program writes now and then") {
  Service service;
  service.guard.begin();
  service.granted();
  service.happens = [&](std::int64_t now_ns) {
    if (now_ns % (4 * ms) == 0) service.board.duty = 0.5;
  };
  service.pass(3'000 * ms);
  CHECK(service.guard.holder() == run_process);
  CHECK(service.count("end") == 0);
}

TEST_CASE("foreign duties before a lease are not the holder's, and those before a cover not its run's") {
  Service service;
  service.guard.begin();
  const auto foreign_duties = [&service](int number) {
    for (int n = 0; n < number; ++n) {
      service.board.duty = 0.5;
      service.pass(ms);
    }
  };
  foreign_duties(30);
  service.pass(ms);
  const std::uint32_t lease = service.granted();
  foreign_duties(9);
  CHECK(service.guard.holder() == run_process);
  service.answer({.word = OrderWord::cover, .lease = lease, .timeout_ns = 20 * ms});
  service.beats = true;
  service.pass(50 * ms);
  // The run says that it is done. After duties the guard looks every ms; this run had none.
  service.beats = false;
  service.stage(Stage::closed);
  service.pass(4 * ms);
  CHECK(service.said(NewsWord::ended) == nullptr);
  service.pass(20 * ms);
  CHECK(service.said(NewsWord::ended) != nullptr);
  CHECK(service.said(NewsWord::acted) == nullptr);
  CHECK(service.guard.holder() == run_process);
}

TEST_CASE("the board refuses owners between leases, and the page of a lease that is over stands still") {
  Service service;
  service.guard.begin();
  const std::uint32_t lease = service.granted();
  CHECK_FALSE(service.board.refuses_owners);
  service.pass(10 * ms);
  service.order({.word = OrderWord::close, .lease = lease});
  CHECK(service.board.refuses_owners);
  const std::uint64_t beats = service.pages->guard().guardian_beats.load();
  CHECK(beats >= 2);
  service.pass(50 * ms);
  CHECK(service.pages->guard().guardian_beats.load() == beats);
}

TEST_CASE("each run that dies gets zeros first, the second as the first") {
  Service service;
  service.guard.begin();
  for (const pid_t process : {run_process, other_process}) {
    service.covered(process);
    service.pass(50 * ms);
    const std::size_t from = service.story.size();
    service.processes.dies_at_ns[process] = service.clock.now_ns();
    service.pass(20 * ms);
    REQUIRE(service.story.size() > from + 1);
    CHECK(service.story[from] == "gone");
    CHECK(service.story[from + 1] == "write");
    service.beats = false;
  }
}

TEST_CASE("a process for which there is no memory gets no lease, and its handle is closed") {
  Service service;
  service.guard.begin();
  rlimit before{};
  REQUIRE(::getrlimit(RLIMIT_NOFILE, &before) == 0);
  const int next_free = ::dup(0);
  ::close(next_free);
  const rlimit none_left{static_cast<rlim_t>(next_free), before.rlim_max};
  REQUIRE(::setrlimit(RLIMIT_NOFILE, &none_left) == 0);
  const News said = service.answer({.word = OrderWord::grant, .pid = run_process});
  REQUIRE(::setrlimit(RLIMIT_NOFILE, &before) == 0);
  CHECK(said.word == NewsWord::refused);
  CHECK(said.why == Refusal::no_memory);
  CHECK(service.processes.handles == 0);
  service.granted();
}

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
