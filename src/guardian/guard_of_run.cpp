// The guardian of one run: a process that outlives the run and makes the board safe after its end.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <utility>

#include "abs_hil/rig/time_units.hpp"
#include "config/board_policy.hpp"
#include "config/key_table.hpp"
#include "guardian/board_guard.hpp"
#include "guardian/guard.hpp"
#include "guardian/guardian_program.hpp"
#include "guardian/lease_wire.hpp"
#include "guardian/linux_process.hpp"

namespace abs_hil::guardian {

namespace {

/// A person has said with SIGUSR1 that the rig is switched off: nothing is left to make safe.
std::atomic<bool> released_by_person{false};
static_assert(std::atomic<bool>::is_always_lock_free);

void tell_controller(const LeaseMessage& message) {
  static_cast<void>(send_message(inherited_ready, message));
  ::close(inherited_ready);
}

/// Everything that the guardian needs, ready before the controller continues.
struct GuardianSetup {
  LaunchConfig launch{};
  config::Settings settings{};
  std::unique_ptr<driver::SafeStateWriter> writer{};
  std::unique_ptr<runtime::RealtimeScope> realtime{};
};

GuardianSetup set_up() {
  GuardianSetup setup{.launch = parse_launch_config(text_behind(inherited_launch_config))};
  config::KeyTable keys(setup.settings);
  // Only these tables: others may name things that the guardian does not know, such as a user's own controller.
  config::load_tables(setup.launch.run.config_json, {"driver", "guardian", "realtime", "telemetry"}, keys,
                      "the controller's configuration");
  constexpr double emulator_insist_s = 10.0;
  double& insist_s = setup.settings.guardian.insist_s;
  if (insist_s == 0.0 && !config::is_real_board(setup.settings.driver)) insist_s = emulator_insist_s;
  setup.writer = driver::make_safe_state_writer(setup.settings.driver);
  setup.writer->prepare();
  const runtime::RealtimeOptions realtime = realtime_options(setup.settings, setup.launch.realtime);
  setup.realtime = std::make_unique<runtime::RealtimeScope>(realtime);
  if (realtime.mode == runtime::RealtimeMode::require && !setup.realtime->report().realtime()) {
    throw driver::Unavailable("real time is required, but the guardian cannot get it\n" +
                              setup.realtime->report().shortcomings());
  }
  return setup;
}

int guard() {
  Pages pages = Pages::as_guard({inherited_run_page, inherited_guard_page});
  const SharedRecorder recorder = SharedRecorder::attach(inherited_recorder);
  const pid_t controller_pid = ::getppid();
  const GuardianSetup setup = set_up();
  const runtime::RealtimeReport& realtime = setup.realtime->report();
  runtime::MonotonicClock clock;
  LinuxProcesses processes;
  const config::GuardianOptions& options = setup.settings.guardian;
  BoardGuard guard({.clock = clock,
                    .board = *setup.writer,
                    .processes = processes,
                    .timeout_ns = static_cast<std::int64_t>(options.timeout_ms * rig::ns_per_ms),
                    .keep_ns = static_cast<std::int64_t>(options.keep_ms * rig::ns_per_ms),
                    .insist_ns = static_cast<std::int64_t>(options.insist_s * rig::ns_per_s),
                    .released = &released_by_person});
  guard.cover_only(std::move(pages), inherited_controller);
  const bool lacks = setup.launch.realtime == runtime::RealtimeMode::prefer && !realtime.realtime();
  tell_controller({.word = LeaseWord::ready,
                   .scheduling = realtime.scheduling,
                   .text = lacks ? realtime.shortcomings() : std::string()});

  run_guard(guard, clock, [] { return Companions{-1, -1}; });
  const GuardianReport& report = guard.report();
  if (report.reason == rig::Reason::none) return exit_verified;
  // The outputs are dealt with: the rest need not be real-time safe.
  const std::string account = to_text(report, controller_pid);
  std::fprintf(stderr, "abs_guardian: %s", account.c_str());
  write_flight_files(setup.launch, setup.settings.telemetry.channel_prefix, recorder.ring(), report, account);
  return !report.acted || report.verified ? exit_verified : exit_not_verified;
}

}  // namespace

void ignore_signals(std::initializer_list<int> signals) {
  for (const int signal : signals) std::signal(signal, SIG_IGN);
}

void spare_from_oom() {
  const int file = ::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (file < 0) return;
  [[maybe_unused]] const auto written = ::write(file, "-1000", 5);
  ::close(file);
}

runtime::RealtimeOptions realtime_options(const config::Settings& settings, runtime::RealtimeMode mode) {
  constexpr int highest = 99;
  runtime::RealtimeOptions options{.priority = std::min(settings.realtime.priority + 1, highest)};
  options.mode = mode;
  return options;
}

bool started_by_a_run() { return ::fcntl(inherited_launch_config, F_GETFD) >= 0; }

int guard_one_run() {
  // It ends after the controller, whatever a terminal or a service manager sends.
  ignore_signals({SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR2, SIGXFSZ});
  std::signal(SIGUSR1, [](int) { released_by_person.store(true, std::memory_order_relaxed); });
  spare_from_oom();
  try {
    return guard();
  } catch (const std::exception& error) {
    tell_controller({.word = LeaseWord::refused, .text = error.what()});
    return exit_not_started;
  }
}

}  // namespace abs_hil::guardian
