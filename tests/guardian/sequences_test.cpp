// All orders in which up to three clients connect, speak, ask, get a lease covered, end, close and die. Guard, talker,
// mailbox, sockets and shared memory are the real ones; processes, board and time are scripted. After every step the
// world must satisfy what the guard promises.

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "catch.hpp"
#include "guardian/linux_process.hpp"
#include "guardian/talker.hpp"
#include "scripted_parts.hpp"
#include "temporary_folder.hpp"

using namespace abs_hil;
using namespace abs_hil::guardian;
using namespace abs_hil::guardian::test;

namespace {

constexpr int clients = 3;
enum class Act : std::uint8_t {
  connect,
  chatter,
  garbage,
  state,
  ask,
  cover,
  drive,
  done,
  make_safe,
  close,
  die,
  count
};
constexpr std::array<const char*, static_cast<std::size_t>(Act::count)> act_names{
    "connect", "chatter", "garbage", "state", "ask", "cover", "drive", "done", "make_safe", "close", "die"};

struct Step {
  int client;
  Act act;
};

/// The service and its clients.
class World {
 public:
  World() {
    listener_ = driver::FileDescriptor(listen_at(path()));
    REQUIRE(listener_.get() >= 0);
    TalkerParts parts{.clock = clock_,
                      .mail = mail_,
                      .page = page_,
                      .listener = listener_.get(),
                      .board = "board",
                      .identify =
                          [](int, int pidfd) {
                            return Peer{pid_behind(pidfd), 0, 0};
                          },
                      .read_terms = [](const std::string& text,
                                       const Peer&) { return LeaseTerms{.timeout_ns = 20 * ms, .board = text}; },
                      .tell = [](const std::string&) {},
                      .status = [](const std::string&) {}};
    talker_.emplace(std::move(parts));
    guard_.begin();
    settle();
  }

  void play(const Step& step) {
    Client& c = clients_[static_cast<std::size_t>(step.client)];
    if (c.died) return;
    switch (step.act) {
      case Act::connect:
        if (c.socket.get() < 0) c.socket = driver::FileDescriptor(connect_to(path()));
        break;
      case Act::chatter: say(c, {.word = LeaseWord::granted, .text = "chatter"}); break;
      case Act::garbage: static_cast<void>(::send(c.socket.get(), "x", 1, MSG_NOSIGNAL | MSG_DONTWAIT)); break;
      case Act::state: say(c, {.word = LeaseWord::state}); break;
      case Act::make_safe: say(c, {.word = LeaseWord::make_safe, .text = "board"}); break;
      case Act::ask: {
        const driver::FileDescriptor handle(text_in_memory(std::to_string(step.client + 1)));
        static_cast<void>(send_message(c.socket.get(), {.word = LeaseWord::ask, .text = "board"}, {handle.get()}));
        break;
      }
      case Act::cover: {
        if (!c.pages) break;
        c.pages->run().cycle_beats.store(0);
        c.pages->run().stage.store(Stage::guarded);
        const driver::FileDescriptor config(text_in_memory("board"));
        static_cast<void>(
            send_message(c.socket.get(), {.word = LeaseWord::cover}, {recorder_.descriptor(), config.get()}));
        break;
      }
      case Act::drive: c.drives = c.covered(); break;
      case Act::done:
        if (!c.pages) break;
        c.drives = false;
        board_.duty = 0.0;
        c.pages->run().stage.store(Stage::closed);
        break;
      case Act::close: c.leave(); break;
      case Act::die: die(step.client); break;
      case Act::count: break;
    }
    settle();
  }

  /// Lets the world run for longer than any bound of the guard but the holder's ten seconds.
  void settle() {
    for (int n = 0; n < 8; ++n) {
      talker_->step(0);
      guard_.look();
      talker_->step(0);
      for (int client = 0; client < clients; ++client) live(client);
      clock_.sleep_until(clock_.now_ns() + 5 * ms);
      for (int client = 0; client < clients; ++client) cycle(client);
      check();
    }
  }

  /// However the clients leave it: nobody is left with a lease, and a new one gets one.
  void ends_well() {
    for (int client = 0; client < clients; ++client) die(client);
    settle();
    CHECK(board_.duty == 0.0);
    CHECK(guard_.safe());
    const driver::FileDescriptor newcomer(connect_to(path()));
    const driver::FileDescriptor handle(text_in_memory("9"));
    REQUIRE(send_message(newcomer.get(), {.word = LeaseWord::ask, .text = "board"}, {handle.get()}));
    settle();
    const auto answer = receive_message(newcomer.get(), 0);
    REQUIRE(answer);
    CHECK(answer->word == LeaseWord::granted);
  }

 private:
  struct Client {
    driver::FileDescriptor socket{-1};
    std::optional<Pages> pages{};
    std::uint64_t beats{0};
    bool drives{false};
    bool died{false};
    [[nodiscard]] bool covered() const {
      return pages && pages->run().stage.load() == Stage::guarded &&
             pages->guard().covers.load() != pages->guard().ends.load() &&
             pages->guard().taken_back_for.load() == rig::Reason::none;
    }
    void leave() { socket = driver::FileDescriptor(-1); }
  };

  [[nodiscard]] std::string path() const { return folder_.path / "s"; }
  /// A client's handle is a file that holds the number of its process.
  [[nodiscard]] static pid_t pid_behind(int fd) { return std::atoi(text_behind(fd).c_str()); }

  void say(Client& c, const LeaseMessage& message) { static_cast<void>(send_message(c.socket.get(), message)); }

  void die(int client) {
    processes_.dies_at_ns[client + 1] = 0;
    clients_[static_cast<std::size_t>(client)].died = true;
    live(client);
  }

  /// A client reads its answers, and dies if its process was ended.
  void live(int client) {
    Client& c = clients_[static_cast<std::size_t>(client)];
    if (!processes_.lives(client + 1)) {
      c.drives = false;  // a dead process writes nothing; its last duty stays
      c.pages.reset();
      c.died = true;
      c.leave();
      return;
    }
    while (c.socket.get() >= 0) {
      pollfd readable{c.socket.get(), POLLIN, 0};
      if (::poll(&readable, 1, 0) <= 0) break;
      const auto said = receive_message(c.socket.get(), 0);
      if (!said) {
        c.leave();
        break;
      }
      if (said->word == LeaseWord::granted) {
        granted_ += 1;
        c.pages = Pages::as_run({said->files.at(0).get(), said->files.at(1).get()});
      }
    }
  }

  /// A cycle of a run: it beats, and drives while it may.
  void cycle(int client) {
    Client& c = clients_[static_cast<std::size_t>(client)];
    if (!c.pages || !processes_.lives(client + 1)) return;
    c.pages->run().cycle_beats.store(++c.beats);
    if (c.pages->guard().taken_back_for.load() != rig::Reason::none || !c.covered()) {
      if (std::exchange(c.drives, false)) {
        board_.duty = 0.0;
        c.pages->run().stage.store(Stage::released);
      }
    }
    if (c.drives) board_.duty = 0.5;
  }

  void check() {
    int driving = 0;
    for (int client = 0; client < clients; ++client) {
      const Client& c = clients_[static_cast<std::size_t>(client)];
      driving += c.drives && processes_.lives(client + 1) ? 1 : 0;
    }
    CHECK(driving <= 1);
    // A duty stays on only while a run that is watched drives; otherwise it is gone within 20 ms.
    on_without_run_ns_ = board_.duty != 0.0 && driving == 0 ? on_without_run_ns_ + 5 * ms : 0;
    CHECK(on_without_run_ns_ <= 20 * ms);
  }

  const abs_hil::test::TemporaryFolder folder_{};
  Story story_;
  ScriptedClock clock_;
  ScriptedProcesses processes_{clock_, story_};
  ScriptedBoard board_{story_};
  Mail mail_;
  ServicePage page_;
  SharedRecorder recorder_{1};
  BoardGuard guard_{resident_guard(clock_, board_, processes_, mail_, page_)};
  driver::FileDescriptor listener_{-1};
  std::optional<Talker> talker_{};
  std::array<Client, clients> clients_{};
  int granted_{0};
  std::int64_t on_without_run_ns_{0};
};

std::string text_of(const std::vector<Step>& steps) {
  std::string text;
  for (const Step& s : steps) {
    text += std::string(1, static_cast<char>('A' + s.client)) + ' ' + act_names[static_cast<std::size_t>(s.act)] + ", ";
  }
  return text;
}

void play(const std::vector<Step>& steps) {
  INFO(text_of(steps));
  World world;
  for (const Step& step : steps) world.play(step);
  world.ends_well();
}

}  // namespace

TEST_CASE("the word that killed the guardian: one waits silently, the lease ends, then it asks") {
  play({{0, Act::connect},
        {0, Act::ask},
        {0, Act::cover},
        {0, Act::drive},
        {1, Act::connect},
        {0, Act::die},
        {1, Act::ask},
        {1, Act::cover},
        {1, Act::drive},
        {1, Act::done},
        {1, Act::close}});
}

TEST_CASE("every order of four acts of two clients, one of which may have a lease, keeps the promises") {
  constexpr std::array acts{Act::connect, Act::garbage,   Act::ask,   Act::cover, Act::drive,
                            Act::done,    Act::make_safe, Act::close, Act::die};
  const std::vector<std::vector<Step>> begins{
      {{0, Act::connect}},
      {{0, Act::connect}, {0, Act::ask}, {1, Act::connect}},
      {{0, Act::connect}, {0, Act::ask}, {1, Act::connect}, {0, Act::cover}, {0, Act::drive}}};
  for (const auto& begin : begins) {
    for (std::size_t n = 0; n < acts.size() * acts.size() * acts.size() * 8; ++n) {
      std::vector<Step> steps = begin;
      std::size_t rest = n;
      for (int k = 0; k < 3; ++k) {
        const int client = static_cast<int>(rest % 2);
        rest /= 2;
        steps.push_back({client, acts[rest % acts.size()]});
        rest /= acts.size();
      }
      play(steps);
    }
  }
}

TEST_CASE("long random orders of three clients keep the promises") {
  std::mt19937 random(36);
  std::uniform_int_distribution<int> client(0, clients - 1);
  std::uniform_int_distribution<int> act(0, static_cast<int>(Act::count) - 1);
  for (int n = 0; n < 400; ++n) {
    std::vector<Step> steps;
    for (int k = 0; k < 40; ++k) steps.push_back({client(random), static_cast<Act>(act(random))});
    play(steps);
  }
}
