#include "guardian_program/service.hpp"

#include <grp.h>
#include <pwd.h>
#include <sched.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <utility>

#include "abs_hil/driver/io_result.hpp"
#include "cli/command_line.hpp"
#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "config/config_json.hpp"
#include "config/key_table.hpp"
#include "guardian/guardian_service.hpp"
#include "guardian/kept_board.hpp"
#include "guardian/launch_config.hpp"
#include "guardian_program/flight_files.hpp"
#include "guardian_program/machine_pause.hpp"
#include "guardian_program/process_set_up.hpp"
#include "guardian_program/service_manager.hpp"
#include "guardian_program/sleep_watch.hpp"

namespace abs_hil::guardian_program {

namespace {

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

/// Members of the group abs_hil may ask for leases, as they may open the boards.
void open_for_group(const std::string& path) {
  const group* const members = ::getgrnam("abs_hil");
  if (members != nullptr) {
    [[maybe_unused]] const int changed = ::chown(path.c_str(), static_cast<uid_t>(-1), members->gr_gid);
  }
  ::chmod(path.c_str(), S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP);
}

/// Throws driver::Unavailable.
driver::FileDescriptor open_listener(const std::string& path) {
  const auto refuse = [&path](const std::string& why) {
    throw driver::Unavailable("guardian.socket = " + path + ": " + why);
  };
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty()) std::filesystem::create_directories(folder, error);
  const auto found = std::filesystem::symlink_status(path, error);
  if (std::filesystem::is_socket(found)) {
    const driver::FileDescriptor other(guardian::connect_to(path));
    if (other.get() >= 0) {
      refuse("process " + std::to_string(guardian::peer_of(other.get()).pid) +
             " listens there already; end it first, or choose another socket");
    }
    ::unlink(path.c_str());  // of a service that died
  } else if (std::filesystem::exists(found)) {
    refuse("is there and is no socket; choose another path");
  }
  driver::FileDescriptor listener(guardian::listen_at(path));
  if (listener.get() < 0) refuse(std::strerror(errno));
  open_for_group(path);
  return listener;
}

/// Takes on the rights of the client for good, so that it gets no file through the service that it could not write
/// itself.
bool become(const guardian::Peer& client) {
  if (::geteuid() == client.uid) return true;
  const passwd* const user = ::getpwuid(client.uid);
  const bool groups = user != nullptr ? ::initgroups(user->pw_name, client.gid) == 0 : ::setgroups(1, &client.gid) == 0;
  return groups && ::setresgid(client.gid, client.gid, client.gid) == 0 &&
         ::setresuid(client.uid, client.uid, client.uid) == 0;
}

/// Runs `work` in a child process with the client's rights and without the service's priority and descriptors: a slow
/// disk does not hold up the service.
template <typename Work>
void in_child_of_client(const guardian::Peer& client, Work work) {
  std::fflush(stderr);
  const pid_t child = ::fork();
  if (child < 0) say(std::string("no flight record: ") + std::strerror(errno));
  if (child != 0) return;
  constexpr sched_param normal{};
  ::sched_setscheduler(0, SCHED_OTHER, &normal);
  ::close_range(STDERR_FILENO + 1, ~0U, 0);
  if (become(client)) {
    work();
  } else {
    say(std::string("no flight record: cannot take on the rights of the client: ") + std::strerror(errno));
  }
  std::fflush(stderr);
  ::_exit(0);
}

guardian::LeaseTerms read_terms(const std::string& json, const guardian::Peer& client) {
  const guardian::LaunchConfig launch = guardian::parse_launch_config(json);
  config::Settings settings;
  config::KeyTable keys(settings);
  config::load_tables(launch.config_json, {"driver", "guardian", "telemetry"}, keys, "the controller's configuration");
  const std::string prefix = settings.telemetry.channel_prefix;
  // The service goes on by itself after these tries.
  constexpr double insist_s = 10.0;
  if (settings.guardian.insist_s == 0.0) settings.guardian.insist_s = insist_s;
  return {.options = settings.guardian,
          .board = guardian::kept_board(settings.driver),
          .write_record = [launch, client, prefix](const guardian::SharedRegion& region,
                                                   const guardian::GuardianReport& report, const std::string& account) {
            in_child_of_client(client, [&] { write_flight_files(launch, prefix, region, report, account); });
          }};
}

/// SIGTERM and SIGINT as a descriptor.
driver::FileDescriptor end_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  ::sigprocmask(SIG_BLOCK, &signals, nullptr);
  return driver::FileDescriptor(::signalfd(-1, &signals, SFD_CLOEXEC | SFD_NONBLOCK));
}

guardian::Interruption told_to_end(const driver::FileDescriptor& signals) {
  return {.descriptor = signals.get(), .take = [&signals] {
            signalfd_siginfo got{};
            [[maybe_unused]] const auto size = ::read(signals.get(), &got, sizeof got);
            return rig::Reason::guardian_told_to_end;
          }};
}

int run_service(const config::Settings& settings) {
  const driver::FileDescriptor signals = end_signals();  // before any thread
  const std::string path = settings.guardian.socket;
  static_cast<void>(guardian::safe_state_writer_of(settings.driver));
  driver::FileDescriptor listener = open_listener(path);
  SleepWatch sleep(say);
  const runtime::RealtimeScope realtime(realtime_options(settings, runtime::RealtimeMode::prefer));
  if (!realtime.report().realtime()) say("NOT IN REAL TIME: it may act late\n" + realtime.report().shortcomings());
  MachinePause pause;  // its thread takes on this one's scheduling
  ServiceManager manager;
  guardian::ServiceParts parts{
      .listener = std::move(listener),
      .board = guardian::kept_board(settings.driver),
      .make_writer = [&settings] { return guardian::safe_state_writer_of(settings.driver); },
      .read_terms = read_terms,
      .scheduling = realtime.report().scheduling,
      .shortcomings = realtime.report().realtime() ? std::string() : realtime.report().shortcomings(),
      .keep_ns = static_cast<std::int64_t>(settings.guardian.keep_ms * rig::ns_per_ms),
      .tell = say,
      .status = [&manager](const std::string& text) { manager.status(text); },
      .alive = ServiceManager::alive};
  parts.interruptions.push_back(told_to_end(signals));
  parts.interruptions.push_back(sleep.interruption());
  if (pause.works()) {
    say("compares the real-time clock, to find pauses of this virtual machine");
    parts.interruptions.push_back(pause.interruption());
  }
  runtime::MonotonicClock clock;
  guardian::GuardianService service(clock, std::move(parts));
  service.start();
  say("grants leases at " + path);
  ServiceManager::ready();
  const bool safe = service.run();
  ::unlink(path.c_str());
  return safe ? exit_verified : exit_not_verified;
}

}  // namespace

int serve(int argc, const char* const* argv) {
  ServiceOptions options;
  cli::Parser program("abs_guardian", "The guardian of the rig's outputs");
  cli::Parser parser = program.add_subcommand(
      "serve", "The resident guardian: keeps the board's outputs at zero and grants them to one run at a time");
  parser.add(
      {.names = "--socket", .to = &options.socket, .help = "where it grants leases (guardian.socket)", .type = "PATH"});
  parser.add({.names = "--config", .to = &options.config_file, .help = "configuration file", .type = "FILE"});
  parser.add({.names = "--set",
              .to = &options.assignments,
              .help = "any configuration value, for example driver.kind=can",
              .repeated = true});
  if (const auto status = program.parse(argc, argv)) return *status;
  ignore_signals({SIGHUP, SIGPIPE, SIGTSTP, SIGTTIN, SIGTTOU, SIGUSR1, SIGUSR2, SIGXFSZ, SIGCHLD});
  spare_from_oom();
  try {
    return run_service(read_settings(options));
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

}  // namespace abs_hil::guardian_program
