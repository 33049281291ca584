// `abs_guardian serve`: sets up the guard, its talker and its standby, and runs until it is ended.
#include <fcntl.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/time_units.hpp"
#include "cli/command_line.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/key_table.hpp"
#include "driver/monotonic_time.hpp"
#include "guardian/board_owners.hpp"
#include "guardian/guard.hpp"
#include "guardian/guardian_lease.hpp"
#include "guardian/guardian_program.hpp"
#include "guardian/linux_process.hpp"
#include "guardian/machine.hpp"
#include "guardian/standby.hpp"
#include "guardian/talker.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

namespace {

std::atomic<bool> told_to_end{false};
static_assert(std::atomic<bool>::is_always_lock_free);

struct ServiceOptions {
  std::optional<std::string> socket{};
  std::optional<std::string> config_file{};
  std::vector<std::string> assignments{};
};

void say(const std::string& text) { std::fprintf(stderr, "abs_guardian: %s\n", text.c_str()); }

config::Settings read_settings(const ServiceOptions& options) {
  config::Settings settings;
  settings.backend = "rig";
  config::KeyTable keys(settings);
  if (options.config_file) config::load_file(*options.config_file, keys);
  for (const std::string& assignment : options.assignments) keys.set_text(assignment, "--set");
  if (options.socket) keys.set_text("guardian.socket=" + *options.socket, "--socket");
  return settings;
}

/// Throws driver::Unavailable.
driver::FileDescriptor open_listener(const std::string& path) {
  const auto refuse = [&path](const std::string& why) {
    throw driver::Unavailable("guardian.socket = " + path + ": " + why);
  };
  if (path.empty()) throw config::ConfigError("guardian.socket is empty; give the path of a socket");
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  const auto found = std::filesystem::symlink_status(path, error);
  if (std::filesystem::is_socket(found)) {
    const driver::FileDescriptor other(connect_to(path));
    if (other.get() >= 0 || errno == EAGAIN) {
      refuse("process " + std::to_string(other.get() >= 0 ? peer_of(other.get()).pid : 0) +
             " listens there already; end it first, or choose another socket");
    }
    ::unlink(path.c_str());  // of a service that died
  } else if (std::filesystem::exists(found)) {
    refuse("is there and is no socket; choose another path");
  }
  driver::FileDescriptor listener(listen_at(path));
  if (listener.get() < 0) refuse(rig::refusal(errno, path, rig::writing));
  open_for_group(path);
  return listener;
}

/// Runs `work` in a child process with the client's rights and without the service's descriptors: a slow disk does not
/// hold up the talker.
template <typename Work>
void in_child_of_client(const Peer& client, Work work) {
  std::fflush(stderr);
  const pid_t child = ::fork();
  if (child < 0) say(std::string("no flight record: ") + std::strerror(errno));
  if (child != 0) return;
  ::close_range(STDERR_FILENO + 1, ~0U, 0);
  if (become(client.uid, client.gid)) {  // gets no file through the service that it could not write itself
    work();
  } else {
    say(std::string("no flight record: cannot take on the rights of the client: ") + std::strerror(errno));
  }
  std::fflush(stderr);
  ::_exit(0);
}

LeaseTerms read_terms(const std::string& json, const Peer& client) {
  const LaunchConfig launch = parse_launch_config(json);
  config::Settings settings;
  config::KeyTable keys(settings);
  config::load_tables(launch.run.config_json, {"driver", "guardian", "telemetry"}, keys,
                      "the controller's configuration");
  const std::string prefix = settings.telemetry.channel_prefix;
  return {.timeout_ns = static_cast<std::int64_t>(settings.guardian.timeout_ms * rig::ns_per_ms),
          .board = kept_board(settings.driver),
          .write_record = [launch, client, prefix](const SharedRecorder& recorder, const GuardianReport& report,
                                                   const std::string& account) {
            in_child_of_client(client, [&] { write_flight_files(launch, prefix, recorder.ring(), report, account); });
          }};
}

/// The first zeros must not wait for a busy computer. The real-time set-up follows, with its report.
void be_quick() {
  constexpr sched_param first{.sched_priority = 1};
  if (::sched_getscheduler(0) == SCHED_OTHER) ::sched_setscheduler(0, SCHED_FIFO, &first);
}

/// A child process of the guard. `work` never returns.
template <typename Work>
pid_t start_companion(std::vector<int> keeps, Work work) {
  const pid_t guard = ::getpid();
  const pid_t child = ::fork();
  if (child != 0) return child;
  std::signal(SIGTERM, SIG_IGN);  // they end with the guard
  std::signal(SIGINT, SIG_IGN);
  close_all_but(std::move(keeps));
  try {
    work(guard);
  } catch (const std::exception& error) {
    say(error.what());
  }
  ::_exit(exit_not_started);
}

/// A process of the service beside the guard.
struct Companion {
  pid_t pid{0};
  driver::FileDescriptor process{-1};
  std::int64_t next_start_ns{0};
};

/// The guard's process with its two companions. The guard never waits for them.
class Service {
 public:
  explicit Service(const config::Settings& settings) : settings_(settings) {}

  int run() {
    // The first thing: zeros. Nothing that can fail or wait stands before it but the configuration.
    const auto board = driver::make_safe_state_writer(settings_.driver);
    void* const memory =
        ::mmap(nullptr, sizeof(ServicePage), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
    if (memory == MAP_FAILED) throw driver::Unavailable(std::string("guardian: no memory: ") + std::strerror(errno));
    page_ = new (memory) ServicePage;
    LinuxProcesses processes;
    const config::GuardianOptions& options = settings_.guardian;
    BoardGuard guard({.clock = clock_,
                      .board = *board,
                      .processes = processes,
                      .timeout_ns = static_cast<std::int64_t>(options.timeout_ms * rig::ns_per_ms),
                      .keep_ns = static_cast<std::int64_t>(options.keep_ms * rig::ns_per_ms),
                      .mail = &mail_,
                      .page = page_});
    guard.begin();
    listener_ = open_listener(options.socket);
    for (const int signal : {SIGTERM, SIGINT}) {
      std::signal(signal, [](int) { told_to_end.store(true, std::memory_order_relaxed); });
    }
    const runtime::RealtimeScope realtime(realtime_options(settings_, runtime::RealtimeMode::prefer));
    realtime_ = &realtime.report();
    if (!realtime_->realtime()) say("NOT IN REAL TIME: it may act late\n" + realtime_->shortcomings());
    guard_process_ = driver::FileDescriptor(open_pidfd(::getpid()));
    start_standby();
    start_talker();
    tell_systemd("READY=1");
    run_guard(guard, clock_, [&] {
      between_looks(guard);
      return Companions{talker_.process.get(), standby_.process.get()};
    });
    page_->over.store(true, std::memory_order_relaxed);
    ::unlink(options.socket.c_str());
    end_companions();
    return guard.safe() ? exit_verified : exit_not_verified;
  }

 private:
  /// One that ends is started again at once, but not one that cannot live, again and again.
  static constexpr std::int64_t start_again_ns = 50'000'000;
  static constexpr std::int64_t alive_ns = 100'000'000;
  static constexpr std::int64_t tale_ns = 1'000'000'000;
  /// So long a talker may stand still, for example in a write to a pipe that nobody reads.
  static constexpr std::int64_t talker_silent_ns = 10'000'000'000;

  void between_looks(BoardGuard& guard) {
    if (told_to_end.exchange(false, std::memory_order_relaxed)) guard.end();
    const std::int64_t now_ns = clock_.now_ns();
    if (now_ns >= next_alive_ns_) {
      tell_systemd("WATCHDOG=1");
      next_alive_ns_ = now_ns + alive_ns;
    }
    const std::uint64_t beats = page_->talker_beats.load(std::memory_order_relaxed);
    if (beats != talker_beats_) talker_beat_ns_ = now_ns;
    talker_beats_ = beats;
    if (talker_.pid > 0 && now_ns - talker_beat_ns_ > talker_silent_ns) ::kill(talker_.pid, SIGKILL);
    for (pid_t child = 0; (child = ::waitpid(-1, nullptr, WNOHANG)) > 0;) {
      if (child == talker_.pid) guard.lost_talker();
      for (Companion* const one : {&talker_, &standby_, &hunter_}) {
        if (child == one->pid) *one = {.next_start_ns = one->next_start_ns};
      }
    }
    // What fails for want of memory or processes is tried again: the guard does not depend on it.
    if (standby_.pid <= 0 && now_ns >= standby_.next_start_ns) start_standby();
    if (talker_.pid <= 0 && now_ns >= talker_.next_start_ns) restart_talker();
    if (guard.driven_by_others() && hunter_.pid <= 0 && now_ns >= hunter_.next_start_ns) {
      const bool tells = now_ns >= next_tale_ns_;
      if (tells) next_tale_ns_ = now_ns + tale_ns;
      start(hunter_, {}, [this, tells](pid_t /*guard*/) { hunt(tells); });
    }
  }

  void restart_talker() noexcept try {
    mail_ = Mail();
    start_talker();
  } catch (const std::exception&) {
    talker_ = {};
  }

  void start_talker() {
    talker_beat_ns_ = clock_.now_ns();
    start(talker_, {listener_.get(), mail_.order_end(), mail_.news_descriptor(), systemd_socket()},
          [this](pid_t guard) { talk(guard); });
  }
  void start_standby() {
    start(standby_, {guard_process_.get()}, [this](pid_t /*guard*/) { stand_by(); });
  }
  template <typename Work>
  void start(Companion& one, std::vector<int> keeps, Work work) {
    one.next_start_ns = clock_.now_ns() + start_again_ns;
    one.pid = start_companion(std::move(keeps), work);
    one.process = driver::FileDescriptor(one.pid > 0 ? open_pidfd(one.pid) : -1);
  }

  [[noreturn]] void hunt(bool tells) {
    constexpr sched_param below_guard{.sched_priority = 1};
    if (::sched_getscheduler(0) == SCHED_FIFO) ::sched_setscheduler(0, SCHED_FIFO, &below_guard);
    const pid_t holder = page_->holder.load(std::memory_order_relaxed);
    for (const std::string& done : end_unguarded(files_of_board(settings_.driver), holder)) {
      if (tells) say(done);
    }
    ::_exit(exit_verified);
  }
  [[noreturn]] void talk(pid_t guard) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != guard) ::_exit(exit_not_started);
    std::signal(SIGCHLD, SIG_IGN);
    // Its thread keeps the guard's scheduling and goes to the guard directly: the talker may have to wait.
    MachinePause pause([this] {
      static_cast<void>(mail_.order({.word = OrderWord::take_back, .reason = rig::Reason::machine_paused}));
    });
    constexpr sched_param normal{};
    ::sched_setscheduler(0, SCHED_OTHER, &normal);
    TalkerParts parts{.clock = clock_,
                      .mail = mail_,
                      .page = *page_,
                      .listener = listener_.get(),
                      .board = kept_board(settings_.driver),
                      .identify =
                          [](int socket, int pidfd) {
                            const Peer peer = peer_of(socket);
                            return process_of(pidfd) == peer.pid ? peer : Peer{};
                          },
                      .read_terms = read_terms,
                      .scheduling = realtime_->scheduling,
                      .shortcomings = realtime_->realtime() ? std::string() : realtime_->shortcomings(),
                      .tell =
                          [next_ns = INT64_MIN, left_out = 0](const std::string& text) mutable {
                            // 2,000 lines at once, then one a second: clients must not fill the log.
                            const std::int64_t now_ns = driver::monotonic_ns();
                            next_ns = std::max(next_ns, now_ns - 2'000 * rig::ns_per_s);
                            if (next_ns > now_ns) return static_cast<void>(++left_out);
                            next_ns += rig::ns_per_s;
                            if (left_out > 0) say("left out " + std::to_string(std::exchange(left_out, 0)) + " lines");
                            say(text);
                          },
                      .status =
                          [told = std::string()](const std::string& text) mutable {
                            if (std::exchange(told, text) != text) tell_systemd("STATUS=" + text);
                          }};
    if (pause.works()) {
      say("compares the real-time clock, to find pauses of this virtual machine");
      parts.pause = &pause;
    }
    Talker talker(std::move(parts));
    static_cast<void>(mail_.order({.word = OrderWord::look}));
    say("grants leases at " + settings_.guardian.socket);
    for (;;) {
      constexpr int step_ms = 100;
      talker.step(step_ms);
      if (page_->over.load(std::memory_order_relaxed)) ::_exit(exit_verified);
    }
  }

  /// Its first look finds a guard that has died meanwhile, too.
  [[noreturn]] void stand_by() {
    const auto board = driver::make_safe_state_writer(settings_.driver, true);
    LinuxProcesses processes;
    Standby standby({.clock = clock_,
                     .board = *board,
                     .processes = processes,
                     .page = *page_,
                     .guard = guard_process_.get(),
                     .silence_ns = static_cast<std::int64_t>(settings_.guardian.standby_ms * rig::ns_per_ms)});
    standby.look();  // before a lease can be granted, if possible: it opens the board
    const runtime::RealtimeScope realtime(realtime_options(settings_, runtime::RealtimeMode::prefer));
    while (!standby.over()) {
      standby.look();
      clock_.sleep_until(standby.next_ns());
    }
    if (standby.acted()) say("standby: the guard died or stood still; drive 0 and brake 0 written and read back");
    ::_exit(standby.acted() ? exit_not_verified : exit_verified);
  }

  /// They end by themselves; one that stands still is ended.
  void end_companions() {
    constexpr std::int64_t patience_ns = 500'000'000;
    const std::int64_t until_ns = clock_.now_ns() + patience_ns;
    std::vector<pid_t> left{talker_.pid, standby_.pid};
    while (!left.empty() && clock_.now_ns() < until_ns) {
      std::erase_if(left, [](pid_t child) { return child <= 0 || ::waitpid(child, nullptr, WNOHANG) != 0; });
      clock_.sleep_until(clock_.now_ns() + 2'000'000);
    }
    for (const pid_t child : left) {
      if (child > 0) ::kill(child, SIGKILL);
    }
  }

  const config::Settings& settings_;
  runtime::MonotonicClock clock_;
  Mail mail_;
  ServicePage* page_{nullptr};
  driver::FileDescriptor listener_{-1};
  const runtime::RealtimeReport* realtime_{nullptr};
  driver::FileDescriptor guard_process_{-1};
  Companion talker_{};
  Companion standby_{};
  Companion hunter_{};
  std::int64_t next_tale_ns_{0};
  std::int64_t next_alive_ns_{0};
  std::int64_t talker_beat_ns_{0};
  std::uint64_t talker_beats_{0};
};

}  // namespace

int serve(int argc, const char* const* argv) {
  be_quick();
  ServiceOptions options;
  cli::Parser program("abs_guardian", "The guardian of the rig's outputs");
  cli::Parser parser = program.add_subcommand(
      "serve", "The resident guardian: keeps the board's outputs at zero and grants them to one run at a time");
  parser.add("--socket", &options.socket, "where it grants leases (guardian.socket)", {.type = "PATH"});
  parser.add("--config", &options.config_file, "configuration file", {.type = "FILE"});
  parser.add("--set", &options.assignments, "any configuration value, for example driver.kind=can", {.repeated = true});
  if (const auto status = program.parse(argc, argv)) return *status;
  ignore_signals({SIGHUP, SIGPIPE, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGXFSZ});
  spare_from_oom();
  try {
    const config::Settings settings = read_settings(options);
    return Service(settings).run();
  } catch (const config::ConfigError& error) {
    say(error.what());
    return exit_usage;
  } catch (const std::invalid_argument& error) {
    say(error.what());
    return exit_usage;
  } catch (const std::exception& error) {
    say(error.what());
    return exit_not_started;
  }
}

}  // namespace abs_hil::guardian
