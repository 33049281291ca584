// The dead-man beside a run on a board (docs/dead-man.md): looks at the controller's signs of life, and when they end
// it brings the outputs into the safe state through its own handle. Started by abs_hil, never by hand.

#include <fcntl.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "config/config_json.hpp"
#include "config/key_table.hpp"
#include "driver/factory.hpp"
#include "guardian/guardian_loop.hpp"
#include "guardian/guardian_process.hpp"
#include "guardian/launch_config.hpp"
#include "guardian/linux_process.hpp"
#include "runtime/realtime_setup.hpp"
#include "telemetry/flight_record.hpp"

namespace {

using namespace abs_hil;

constexpr int exit_verified = 0;
constexpr int exit_not_verified = 1;
constexpr int exit_not_started = 3;

/// What ends programs from a terminal, a service manager or a closed pipe is not for the guardian: it ends when the
/// controller is done.
void ignore_signals() {
  for (const int signal :
       {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGXFSZ}) {
    std::signal(signal, SIG_IGN);
  }
}

/// Best effort: it needs CAP_SYS_RESOURCE. The guardian is small, and the last that should go when memory runs out.
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
  // Above the controller: one that runs wild must not keep its guardian from the processor.
  constexpr int highest = 99;
  runtime::RealtimeOptions options{.priority = std::min(s.realtime.priority + 1, highest)};
  options.mode = mode == "off"       ? runtime::RealtimeMode::off
                 : mode == "require" ? runtime::RealtimeMode::require
                                     : runtime::RealtimeMode::prefer;
  return options;
}

/// Everything that a guardian on duty needs, made before the controller goes on.
struct Post {
  guardian::LaunchConfig brief{};
  config::Settings settings{};
  std::unique_ptr<driver::SafeStateWriter> writer{};
  std::unique_ptr<runtime::RealtimeScope> realtime{};
};

Post take_post() {
  Post post{.brief = guardian::parse_launch_config(inherited_text(guardian::inherited_launch_config))};
  config::KeyTable keys(post.settings);
  // No more than it needs: whatever else the controller knows, names of its own controllers say, may be unknown here.
  const auto config = nlohmann::ordered_json::parse(post.brief.config_json);
  for (const char* table : {"driver", "guardian", "realtime", "telemetry"}) {
    const nlohmann::ordered_json part{{table, config.at(table)}};
    static_cast<void>(config::load_json(part, keys, "the controller's configuration"));
  }
  post.writer = driver::make_safe_state_writer(post.settings.driver);
  post.writer->prepare();
  const runtime::RealtimeOptions realtime = realtime_options(post.settings, post.brief.realtime);
  post.realtime = std::make_unique<runtime::RealtimeScope>(realtime);
  if (realtime.mode == runtime::RealtimeMode::require && !post.realtime->report().realtime()) {
    throw driver::Unavailable("real time is required and not to be had\n" + post.realtime->report().shortcomings());
  }
  return post;
}

void leave_record(const Post& post, const guardian::SharedRegion& region, const guardian::GuardianReport& report,
                  std::string account) {
  if (post.brief.record_prefix.empty()) return;
  const config::Settings& s = post.settings;
  const auto records = region.recorder().contents();
  std::vector<std::string> problems;
  const auto files = telemetry::write_flight_record(post.brief.record_prefix,
                                                    {.records = records,
                                                     .reason = report.reason,
                                                     .reason_value = static_cast<double>(report.silence_ns) * 1e-9,
                                                     .account = std::move(account)},
                                                    {.experiment = post.brief.experiment,
                                                     .controller = post.brief.controller,
                                                     .plant = post.brief.plant,
                                                     .backend = post.brief.backend,
                                                     .config_json = post.brief.config_json,
                                                     .version = post.brief.version},
                                                    s.telemetry.channel_prefix, problems);
  for (const auto& file : files) std::fprintf(stderr, "abs_guardian: wrote %s\n", file.c_str());
  for (const auto& problem : problems) std::fprintf(stderr, "abs_guardian: %s\n", problem.c_str());
}

int stand_guard() {
  guardian::SharedRegion region = guardian::SharedRegion::attach(guardian::inherited_region);
  const pid_t controller_pid = ::getppid();
  guardian::LinuxProcess controller(guardian::inherited_controller);
  const Post post = take_post();
  runtime::MonotonicClock clock;
  guardian::GuardianLoop duty(clock, controller, region, *post.writer, post.settings.guardian);
  const bool prefers = post.brief.realtime == "prefer" && !post.realtime->report().realtime();
  tell_controller("ready " + (prefers ? post.realtime->report().shortcomings() : std::string()));

  const guardian::GuardianReport report = duty.run();
  if (report.reason == rig::Reason::none) return exit_verified;
  // From here on nothing is urgent any more.
  const std::string account = guardian::to_text(report, controller_pid);
  std::fprintf(stderr, "abs_guardian: %s", account.c_str());
  leave_record(post, region, report, account);
  return !report.acted || report.verified ? exit_verified : exit_not_verified;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == "--help") {
    std::puts(
        "Usage: abs_guardian\n\n"
        "The dead-man beside a run of abs_hil on a board: when the controller dies, stops or hangs, it brings the "
        "outputs into the safe state.\nabs_hil starts it by itself; there is nothing to be typed "
        "(docs/dead-man.md).");
    return 0;
  }
  if (argc != 1 || ::fcntl(guardian::inherited_launch_config, F_GETFD) < 0) {
    std::fputs("abs_guardian: the dead-man beside a run; abs_hil starts it by itself (docs/dead-man.md)\n", stderr);
    return 2;
  }
  ignore_signals();
  spare_from_oom();
  try {
    return stand_guard();
  } catch (const std::exception& error) {
    tell_controller(std::string("error ") + error.what());
    return exit_not_started;
  }
}
