// The guard of the resident service: leases, and the board while no run is covered.
#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "guardian/linux_process.hpp"
#include "resident_service.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;
using rig::Reason;

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

TEST_CASE("two answers that are lost at a request refuse no lease, a third one does") {
  for (const int lost : {2, 3}) {
    Service service;
    service.guard.begin();
    service.pass(20 * ms);
    service.board.fails_first = lost;
    const News told = service.answer({.word = OrderWord::grant, .pid = run_process});
    CHECK(told.word == (lost == 2 ? NewsWord::granted : NewsWord::refused));
  }
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

TEST_CASE("an order ends the guard's wait, also one in the mail that has replaced another") {
  Service service;
  service.pass(0);
  for (int talker = 0; talker < 3; ++talker) {
    REQUIRE(service.mail.order({.word = OrderWord::look}));
    const std::int64_t before_ns = service.clock.now_ns();
    wait_for_guard(service.guard, service.clock, {-1, -1});
    CHECK(service.clock.now_ns() == before_ns);
    service.guard.look();
    service.mail = Mail();
  }
}

TEST_CASE("a broken descriptor does not end the guard's wait") {
  Service service;
  service.granted();
  REQUIRE(::fcntl(service.guard.holder(), F_GETFD) < 0);
  const std::int64_t next_ns = service.guard.next_ns();
  REQUIRE(next_ns > service.clock.now_ns());
  wait_for_guard(service.guard, service.clock, {-1, -1});
  CHECK(service.clock.now_ns() == next_ns);
}

TEST_CASE("a companion's end ends the guard's wait") {
  Service service;
  service.pass(0);
  const pid_t ends = ::fork();
  if (ends == 0) ::_exit(0);
  const driver::FileDescriptor process(open_pidfd(ends));
  REQUIRE(service.guard.next_ns() > service.clock.now_ns());
  const std::int64_t before_ns = service.clock.now_ns();
  wait_for_guard(service.guard, service.clock, {-1, process.get()});
  CHECK(service.clock.now_ns() == before_ns);
  CHECK(::waitpid(ends, nullptr, WNOHANG) == ends);
}
