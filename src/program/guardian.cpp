// The guardian of a run on a board (docs/dead-man.md). It reads the controller's heartbeat. When the heartbeat stops it
// brings the outputs into the safe state through its own handle. abs_hil starts it; it is never started by hand.

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "abs_hil/program/program.hpp"
#include "config/config_json.hpp"
#include "config/key_table.hpp"
#include "driver/factory.hpp"
#include "guardian/guardian_loop.hpp"
#include "guardian/guardian_process.hpp"
#include "guardian/launch_config.hpp"
#include "guardian/linux_process.hpp"
#include "runtime/board_policy.hpp"
#include "runtime/realtime_setup.hpp"
#include "telemetry/flight_record.hpp"

namespace abs_hil {

namespace {

constexpr int exit_verified = 0;
constexpr int exit_not_verified = 1;
constexpr int exit_not_started = 3;

/// A person has said with SIGUSR1 that the rig is switched off: nothing is left to make safe.
std::atomic<bool> released_by_person{false};
static_assert(std::atomic<bool>::is_always_lock_free);

/// Signals from a terminal, a service manager or a closed pipe must not end the guardian. It ends after the controller.
void ignore_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR2, SIGXFSZ}) {
    std::signal(signal, SIG_IGN);
  }
  std::signal(SIGUSR1, [](int) { released_by_person.store(true, std::memory_order_relaxed); });
}

/// Exempts the guardian from the kernel's out-of-memory killer. This needs CAP_SYS_RESOURCE; failure is ignored.
void spare_from_oom() {
  const int file = ::open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (file < 0) return;
  [[maybe_unused]] const auto written = ::write(file, "-1000", 5);
  ::close(file);
}

void tell_controller(const std::string& text) {
  [[maybe_unused]] const auto written = ::write(guardian::inherited_ready, text.data(), text.size());
  ::close(guardian::inherited_ready);
}

std::string inherited_text(int fd) {
  std::string text;
  char part[4096];
  for (ssize_t got = 0; (got = ::pread(fd, part, sizeof part, static_cast<off_t>(text.size()))) > 0;) {
    text.append(part, static_cast<std::size_t>(got));
  }
  return text;
}

runtime::RealtimeOptions realtime_options(const config::Settings& s, const std::string& mode) {
  // One above the controller: a controller in an endless loop must not block its guardian.
  constexpr int highest = 99;
  runtime::RealtimeOptions options{.priority = std::min(s.realtime.priority + 1, highest)};
  options.mode = mode == "off"       ? runtime::RealtimeMode::off
                 : mode == "require" ? runtime::RealtimeMode::require
                                     : runtime::RealtimeMode::prefer;
  return options;
}

/// Everything that the guardian needs, ready before the controller continues.
struct GuardianSetup {
  guardian::LaunchConfig launch{};
  config::Settings settings{};
  std::unique_ptr<driver::SafeStateWriter> writer{};
  std::unique_ptr<runtime::RealtimeScope> realtime{};
};

GuardianSetup set_up() {
  GuardianSetup setup{.launch = guardian::parse_launch_config(inherited_text(guardian::inherited_launch_config))};
  config::KeyTable keys(setup.settings);
  // Only these tables: others may name things that the guardian does not know, such as a user's own controller.
  config::load_tables(setup.launch.config_json, {"driver", "guardian", "realtime", "telemetry"}, keys,
                      "the controller's configuration");
  constexpr double emulator_insist_s = 10.0;
  double& insist_s = setup.settings.guardian.insist_s;
  if (insist_s == 0.0 && !runtime::is_real_board(setup.settings.driver)) insist_s = emulator_insist_s;
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

void write_record(const GuardianSetup& setup, const guardian::SharedRegion& region,
                  const guardian::GuardianReport& report, std::string account) {
  if (setup.launch.record_prefix.empty()) return;
  const config::Settings& s = setup.settings;
  const auto records = region.recorder().contents();
  std::vector<std::string> problems;
  const auto files = telemetry::write_flight_record(setup.launch.record_prefix,
                                                    {.records = records,
                                                     .reason = report.reason,
                                                     .reason_value = static_cast<double>(report.silence_ns) * 1e-9,
                                                     .account = std::move(account)},
                                                    {.experiment = setup.launch.experiment,
                                                     .controller = setup.launch.controller,
                                                     .plant = setup.launch.plant,
                                                     .backend = setup.launch.backend,
                                                     .config_json = setup.launch.config_json,
                                                     .version = setup.launch.version},
                                                    s.telemetry.channel_prefix, problems);
  for (const auto& file : files) std::fprintf(stderr, "abs_guardian: wrote %s\n", file.c_str());
  for (const auto& problem : problems) std::fprintf(stderr, "abs_guardian: %s\n", problem.c_str());
}

int guard_run() {
  guardian::SharedRegion region = guardian::SharedRegion::attach(guardian::inherited_region);
  const pid_t controller_pid = ::getppid();
  guardian::LinuxProcess controller(guardian::inherited_controller);
  const GuardianSetup setup = set_up();
  runtime::MonotonicClock clock;
  guardian::GuardianLoop loop(clock, controller, region, *setup.writer, setup.settings.guardian, &released_by_person);
  const bool prefers = setup.launch.realtime == "prefer" && !setup.realtime->report().realtime();
  tell_controller("ready " + (prefers ? setup.realtime->report().shortcomings() : std::string()));

  const guardian::GuardianReport report = loop.run();
  if (report.reason == rig::Reason::none) return exit_verified;
  // The outputs are dealt with: the rest need not be real-time safe.
  const std::string account = guardian::to_text(report, controller_pid);
  std::fprintf(stderr, "abs_guardian: %s", account.c_str());
  write_record(setup, region, report, account);
  return !report.acted || report.verified ? exit_verified : exit_not_verified;
}

}  // namespace

int program::run_guardian(int argc, char** argv, std::span<const driver::Backend> boards) {
  if (argc == 2 && std::string_view(argv[1]) == "--help") {
    std::puts(
        "Usage: abs_guardian\n\n"
        "The guardian of a run of abs_hil on a board. When the controller dies, stops or hangs, the guardian brings "
        "the outputs into the safe state.\nabs_hil starts it automatically; do not start it by hand "
        "(docs/dead-man.md).");
    return 0;
  }
  if (argc != 1 || ::fcntl(guardian::inherited_launch_config, F_GETFD) < 0) {
    std::fputs("abs_guardian: only abs_hil can start this program, which is the guardian of a run (docs/dead-man.md)\n",
               stderr);
    return 2;
  }
  ignore_signals();
  spare_from_oom();
  try {
    for (const driver::Backend& board : boards) driver::register_backend(board);
    return guard_run();
  } catch (const std::exception& error) {
    tell_controller(std::string("error ") + error.what());
    return exit_not_started;
  }
}

}  // namespace abs_hil
