// The standby: when it stops a run that its guard no longer watches.
#include "guardian/standby.hpp"

#include "catch.hpp"
#include "scripted_parts.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;

namespace {

constexpr pid_t run_process = 4711;
constexpr pid_t other_process = 4712;
constexpr int guard_handle = 7;
constexpr std::int64_t look_period_ns = 5 * ms;
constexpr std::int64_t try_period_ns = 1 * ms;
constexpr std::int64_t limit_ns = 20 * ms;
constexpr std::int64_t run_needs_ns = 30 * ms;
constexpr std::int64_t run_lives_ns = 1'000 * ms;
constexpr std::int64_t owner_lives_ns = 100 * ms;

/// What the standby does with processes, as text. The run has handle 0, as a real handle may be.
class ToldProcesses final : public Processes {
 public:
  ToldProcesses(ScriptedProcesses& processes, Story& story) : processes_(processes), story_(story) {}
  [[nodiscard]] int open(pid_t pid) noexcept override {
    story_.push_back("open " + std::to_string(pid));
    return processes_.open(pid);
  }
  void close(int handle) noexcept override {
    story_.push_back("close " + name(handle));
    processes_.close(handle);
  }
  [[nodiscard]] bool gone(int handle) noexcept override { return processes_.gone(handle); }
  void end(int handle) noexcept override {
    story_.push_back("end " + name(handle));
    processes_.end(handle);
  }

 private:
  [[nodiscard]] std::string name(int handle) const {
    return handle == guard_handle ? "guard" : std::to_string(processes_.first + handle);
  }

  ScriptedProcesses& processes_;
  Story& story_;
};

/// A standby beside a guard that beats every 0.1 ms as long as it lives, and a run that may drive.
struct Post {
  explicit Post(std::int64_t silence_ns = limit_ns)
      : standby({.clock = clock,
                 .board = board,
                 .processes = told,
                 .page = page,
                 .guard = guard_handle,
                 .silence_ns = silence_ns}) {
    processes.first = run_process;
    page.run_needs_ns = run_needs_ns;
    clock.happens = [this](std::int64_t now_ns) {
      if (processes.lives(guard_handle) && now_ns <= last_beat_ns) page.guard_beats.fetch_add(1);
      if (drives && processes.lives(0)) board.duty = 0.5;
    };
  }
  void look() {
    standby.look();
    looks.push_back(clock.now_ns());
    times.resize(story.size(), clock.now_ns());
  }
  /// Looks whenever the standby wants to, up to and with `end_ns` or until it is over.
  void pass_until(std::int64_t end_ns) {
    for (;;) {
      if (clock.now_ns() >= standby.next_ns()) look();
      if (standby.over() || clock.now_ns() >= end_ns) return;
      clock.sleep_until(std::min(end_ns, std::max(standby.next_ns(), clock.now_ns() + 100 * us)));
    }
  }
  void pass(std::int64_t duration_ns) { pass_until(clock.now_ns() + duration_ns); }
  /// A run is covered for 50 ms; then guard and run are left to themselves, and the guard dies. Returns the time of the
  /// look that finds it.
  std::int64_t lose_guard_of_run() {
    page.holder = run_process;
    pass(50 * ms);
    return lose_guard();
  }
  std::int64_t lose_guard() {
    story.clear();
    times.clear();
    processes.dies_at_ns[guard_handle] = clock.now_ns() + 1;
    return standby.next_ns();
  }
  /// When it did this for the first time; -1: never.
  [[nodiscard]] std::int64_t when(const std::string& deed) const {
    const auto found = std::find(story.begin(), story.end(), deed);
    return found == story.end() ? -1 : times[static_cast<std::size_t>(found - story.begin())];
  }

  Story story;
  Story unread;
  std::vector<std::int64_t> times;  ///< of the deeds in `story`
  std::vector<std::int64_t> looks;
  ScriptedClock clock;
  ScriptedProcesses processes{clock, unread};
  ToldProcesses told{processes, story};
  ScriptedBoard board{story};
  ServicePage page;
  std::int64_t last_beat_ns{INT64_MAX};
  bool drives{false};
  Standby standby;
};

}  // namespace

TEST_CASE("while the guard beats, the standby looks every 5 ms and touches neither the board nor the run") {
  Post post;
  post.page.holder = run_process;
  post.drives = true;
  const std::int64_t start_ns = post.clock.now_ns();
  post.pass(10'000 * ms);
  CHECK(post.story == Story{"open 4711"});
  CHECK(post.board.duty == 0.5);
  CHECK_FALSE(post.standby.over());
  CHECK_FALSE(post.standby.acted());
  REQUIRE(post.looks.size() == 2'001);
  for (std::size_t i = 0; i < post.looks.size(); ++i) {
    REQUIRE(post.looks[i] == start_ns + static_cast<std::int64_t>(i) * look_period_ns);
  }
  CHECK(post.standby.next_ns() == post.clock.now_ns() + look_period_ns);
}

TEST_CASE("the standby opens the board once, while nobody has the lease, if two can have it open") {
  Post post;
  post.board.shared = GENERATE(true, false);
  post.board.absent = GENERATE(true, false);
  post.page.holder = run_process;
  post.pass(1'000 * ms);
  CHECK(post.board.prepared == 0);
  post.page.holder = 0;
  post.pass(1'000 * ms);
  CHECK(post.board.prepared == (post.board.shared ? 1 : 0));
  post.lose_guard();
  post.pass(50 * ms);
  CHECK(post.standby.acted());
}

TEST_CASE("a standby that began during a lease makes the board safe without having opened it before") {
  Post post;
  post.drives = true;
  const std::int64_t found_ns = post.lose_guard_of_run();
  post.processes.dies_at_ns[0] = found_ns;
  post.pass(50 * ms);
  CHECK(post.when("write") == found_ns);
  CHECK(post.board.duty == 0.0);
  CHECK(post.board.prepared == 0);
  CHECK(post.standby.acted());
}

TEST_CASE("the standby notices a silent guard within the limit and one look, wherever the last beat falls") {
  for (std::int64_t offset_ns = 0; offset_ns < look_period_ns; offset_ns += 100 * us) {
    Post post;
    post.last_beat_ns = post.clock.now_ns() + 100 * ms + offset_ns;
    post.pass(500 * ms);
    const std::int64_t silent_ns = post.when("end guard") - post.last_beat_ns;
    CAPTURE(offset_ns, silent_ns);
    CHECK(silent_ns >= limit_ns);
    CHECK(silent_ns < limit_ns + look_period_ns);
    CHECK(post.standby.acted());
  }
}

TEST_CASE("a guard that was silent for the limit less 1 ns still has time until the next look") {
  Post post(limit_ns + 1);
  post.last_beat_ns = post.clock.now_ns() + 100 * ms;
  post.pass(500 * ms);
  CHECK(post.when("end guard") == post.last_beat_ns + limit_ns + look_period_ns);
}

TEST_CASE("the silence of a guard that beats again is forgotten") {
  Post post;
  for (int i = 0; i < 10; ++i) {
    post.last_beat_ns = post.clock.now_ns();
    post.pass(limit_ns - look_period_ns);
    post.last_beat_ns = INT64_MAX;
    post.pass(look_period_ns);
  }
  CHECK(post.story.empty());
}

TEST_CASE("a pause of the whole computer is no silence of the guard") {
  Post post;
  post.pass(50 * ms);
  post.clock.jump(10'000 * ms);
  post.pass(50 * ms);
  CHECK(post.story.empty());
  CHECK_FALSE(post.standby.over());
}

TEST_CASE("a pause counts as two look periods if the guard is silent after it") {
  Post post;
  post.pass(50 * ms);
  post.last_beat_ns = post.clock.now_ns();
  post.clock.jump(10'000 * ms);
  const std::int64_t resumed_ns = post.clock.now_ns();
  post.pass(500 * ms);
  CHECK(post.when("end guard") == resumed_ns + limit_ns - 2 * look_period_ns);
}

TEST_CASE("a guard that waits for its board may be silent for one second, or for the limit if that is longer") {
  const std::int64_t silence_ns = GENERATE(as<std::int64_t>{}, limit_ns, 1'500 * ms);
  Post post(silence_ns);
  post.page.accesses_board = true;
  post.last_beat_ns = post.clock.now_ns() + 100 * ms;
  post.pass(3'000 * ms);
  const std::int64_t most_ns = std::max(silence_ns, 1'000 * ms);
  CHECK(post.when("end guard") == post.last_beat_ns + most_ns);
}

TEST_CASE("the standby acts at the first look after the guard's process is gone, even if it waited for its board") {
  Post post;
  post.page.accesses_board = GENERATE(false, true);
  post.pass(50 * ms);
  const std::int64_t found_ns = post.lose_guard();
  post.pass(500 * ms);
  CHECK(post.story == Story{"end guard", "write"});
  CHECK(post.when("write") == found_ns);
  CHECK(post.standby.acted());
  CHECK(post.standby.over());
}

TEST_CASE("when the service ends in order, the standby ends too and writes nothing") {
  Post post;
  post.page.holder = run_process;
  post.page.over = true;
  post.pass(50 * ms);
  CHECK_FALSE(post.standby.over());  // not before the guard has ended
  const std::int64_t found_ns = post.lose_guard();
  post.pass(500 * ms);
  CHECK(post.standby.over());
  CHECK_FALSE(post.standby.acted());
  CHECK(post.looks.back() == found_ns);
  CHECK(post.story.empty());
}

TEST_CASE("the standby ends a guard that stands still, and writes nothing before it is gone") {
  Post post;
  post.processes.dying_takes_ns = 50 * ms;
  post.last_beat_ns = post.clock.now_ns() + 100 * ms;
  post.pass(500 * ms);
  CHECK(post.story == Story{"end guard", "write"});
  const std::int64_t ended_ns = post.when("end guard");
  CHECK(ended_ns == post.last_beat_ns + limit_ns);
  CHECK(post.when("write") == ended_ns + 50 * ms);
}

TEST_CASE("a guard that beats again after it was found silent does not stop the standby") {
  Post post;
  post.processes.dying_takes_ns = 50 * ms;
  post.last_beat_ns = post.clock.now_ns() + 100 * ms;
  post.pass(120 * ms);
  REQUIRE(post.story == Story{"end guard"});
  post.last_beat_ns = INT64_MAX;
  post.pass(500 * ms);
  CHECK(post.standby.acted());
}

TEST_CASE("a run that ends by itself in its time is not ended, and zeros are verified once it is gone") {
  Post post;
  post.drives = true;
  const std::int64_t found_ns = post.lose_guard_of_run();
  post.processes.dies_at_ns[0] = found_ns + 12'300 * us;
  post.pass(500 * ms);
  CHECK(post.story == Story{"end guard", "write"});
  CHECK(post.when("write") == found_ns + 13 * ms);
  CHECK(post.board.duty == 0.0);
  CHECK(post.standby.acted());
}

TEST_CASE("a run that has noticed may live for a second while the standby looks at its outputs") {
  Post post;
  const std::int64_t found_ns = post.lose_guard_of_run();
  post.processes.dies_at_ns[0] = found_ns + run_needs_ns + 900 * ms;
  post.pass(2'000 * ms);
  CHECK(post.when("end 4711") == -1);
  CHECK(post.when("write") == found_ns + run_needs_ns);
  CHECK(post.when("look") == found_ns + run_needs_ns + try_period_ns);
  CHECK(std::count(post.story.begin(), post.story.end(), "look") == 899);
  CHECK(std::count(post.story.begin(), post.story.end(), "write") == 2);
  CHECK(post.story.back() == "write");
  CHECK(post.looks.back() == found_ns + run_needs_ns + 900 * ms);
  CHECK(post.standby.acted());
}

TEST_CASE("a run that drives on after its time is ended at once, and zeros are written again once it is gone") {
  Post post;
  post.drives = true;
  const std::int64_t found_ns = post.lose_guard_of_run();
  post.pass(2'000 * ms);
  CHECK(post.story == Story{"end guard", "write", "look", "end 4711", "write"});
  CHECK(post.when("write") == found_ns + run_needs_ns);
  CHECK(post.when("end 4711") == found_ns + run_needs_ns + try_period_ns);
  CHECK(post.looks.back() == found_ns + run_needs_ns + 2 * try_period_ns);
  CHECK(post.board.duty == 0.0);
  CHECK(post.standby.acted());
}

TEST_CASE("a run that still lives a second after its time is ended, and 100 ms after it with a board of one owner") {
  Post post;
  post.board.shared = GENERATE(true, false);
  const std::int64_t found_ns = post.lose_guard_of_run();
  post.pass(3'000 * ms);
  const std::int64_t ended_ns = found_ns + run_needs_ns + (post.board.shared ? run_lives_ns : owner_lives_ns);
  CHECK(post.when("end 4711") == ended_ns);
  CHECK(std::count(post.story.begin(), post.story.end(), "end 4711") == 1);
  CHECK(post.story.back() == "write");
  CHECK(post.looks.back() == ended_ns + try_period_ns);
  CHECK(post.standby.acted());
}

TEST_CASE("a board that does not answer is no reason to end a run within its second") {
  Post post;
  post.board.fails_first = 1'000'000;
  const std::int64_t found_ns = post.lose_guard_of_run();
  post.pass(2'000 * ms);
  CHECK(post.when("end 4711") == found_ns + run_needs_ns + run_lives_ns);
  CHECK_FALSE(post.standby.over());
}

TEST_CASE("zeros are written every millisecond until they are verified") {
  Post post;
  post.pass(50 * ms);
  post.board.duty = 0.5;
  post.board.fails_first = 3;
  const std::int64_t found_ns = post.lose_guard();
  post.pass_until(found_ns + 2 * try_period_ns);
  CHECK_FALSE(post.standby.over());
  CHECK_FALSE(post.standby.acted());
  post.pass(500 * ms);
  CHECK(post.story == Story{"end guard", "write", "write", "write", "write"});
  CHECK(post.looks.back() == found_ns + 3 * try_period_ns);
  CHECK(post.board.duty == 0.0);
  CHECK(post.standby.acted());
  CHECK(post.standby.over());
}

TEST_CASE("the standby keeps a handle on the holder of the lease alone, and opens it once") {
  Post post;
  post.pass(50 * ms);
  CHECK(post.story.empty());
  post.page.holder = run_process;
  post.pass(50 * ms);
  CHECK(post.story == Story{"open 4711"});
  post.page.holder = other_process;
  post.pass(50 * ms);
  CHECK(post.story == Story{"open 4711", "close 4711", "open 4712"});
  post.page.holder = 0;
  post.pass(50 * ms);
  CHECK(post.story == Story{"open 4711", "close 4711", "open 4712", "close 4712"});
  const std::int64_t found_ns = post.lose_guard();  // nobody is left to wait for
  post.pass(50 * ms);
  CHECK(post.when("write") == found_ns);
  CHECK(post.standby.acted());
}

TEST_CASE("the standby does without a holder that is gone before it could open it") {
  Post post;
  post.processes.dies_at_ns[0] = 0;
  post.page.holder = run_process;
  post.pass(50 * ms);
  post.page.holder = 0;
  post.pass(50 * ms);
  CHECK(post.story == Story{"open 4711"});
}

TEST_CASE("the standby waits for the present holder and not for a former one") {
  Post post;
  post.page.holder = run_process;
  post.pass(50 * ms);
  post.page.holder = other_process;
  const std::int64_t found_ns = post.lose_guard();  // before a look has seen the new holder
  post.pass(3'000 * ms);
  CHECK(post.story.front() == "close 4711");
  CHECK(post.when("end 4711") == -1);
  CHECK(post.when("end 4712") == found_ns + run_needs_ns + run_lives_ns);
  CHECK(post.standby.acted());
}

TEST_CASE("a holder that is named after the guard was lost changes nothing") {
  Post post;
  const std::int64_t found_ns = post.lose_guard_of_run();
  post.pass_until(found_ns);
  post.page.holder = GENERATE(as<pid_t>{}, 0, other_process);
  post.pass(3'000 * ms);
  CHECK(post.when("end 4711") == found_ns + run_needs_ns + run_lives_ns);
  CHECK(post.when("close 4711") == -1);
  CHECK(post.when("open 4712") == -1);
  CHECK(post.standby.acted());
}
