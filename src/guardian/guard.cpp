// Starts, arms and ends the guardian that a run has of its own, with the launch configuration that it passes on.
#include "guardian/guard.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "abs_hil/driver/io_result.hpp"
#include "driver/spawn.hpp"
#include "guardian/lease_wire.hpp"
#include "guardian/linux_process.hpp"
#include "rig/formatted_text.hpp"
#include "rig/parse_json.hpp"
#include "telemetry/flight_record.hpp"

namespace abs_hil::guardian {

namespace {

constexpr int ready_within_ms = 5000;
constexpr int ends_within_ms = 500;

[[noreturn]] void refuse_for(const std::string& what, int error, const std::filesystem::path& program = {}) {
  refuse_run(what + ": " + rig::refusal(error, program, rig::starting));
}

/// A copy numbered above the descriptors that the child inherits.
driver::FileDescriptor high_copy(int fd) {
  constexpr int above = 10;
  driver::FileDescriptor copy(::fcntl(fd, F_DUPFD_CLOEXEC, above));
  if (copy.get() < 0) refuse_for("cannot copy a file descriptor for it", errno);
  return copy;
}
/// The same of a descriptor that nobody needs besides.
driver::FileDescriptor high_copy(driver::FileDescriptor fd) {
  if (fd.get() < 0) refuse_for("cannot open a file descriptor for it", errno);
  return high_copy(fd.get());
}

}  // namespace

void refuse_run(const std::string& what) {
  throw driver::Unavailable("guardian: " + what +
                            ". The run does not start without a guardian: if this program died, nothing would stop the "
                            "motor (docs/dead-man.md)");
}

void Guard::making_safe() noexcept {
  pages().run().stage.store(Stage::making_safe, std::memory_order_release);
  // A failed write and the end of the run each make the outputs safe, without a cycle in between. Each beat restarts
  // the guardian's timeout.
  pages().run().safe_beats.fetch_add(1, std::memory_order_relaxed);
}

void Guard::outputs_released(bool safe) noexcept {
  pages().run().stage.store(safe ? Stage::released : Stage::handed_over, std::memory_order_release);
}

void Guard::reset_page() noexcept {
  RunPage& page = pages().run();
  page.cycle_beats.store(0, std::memory_order_relaxed);
  page.safe_beats.store(0, std::memory_order_relaxed);
  page.stage.store(Stage::guarded, std::memory_order_release);
}

bool Guard::close_page(Stage stage) noexcept {
  std::atomic<Stage>& now = pages().run().stage;
  // `handed_over` must stay: a delayed guardian has to read it, however late.
  const bool handed_over = now.load(std::memory_order_acquire) == Stage::handed_over;
  if (!handed_over) now.store(stage, std::memory_order_release);
  return handed_over;
}

void Guard::refuse_weaker(const runtime::Scheduling& guardian, const runtime::Scheduling& controller,
                          const std::string& program) {
  if (guardian.at_least(controller)) return;
  const auto in_words = [](const runtime::Scheduling& s) {
    const std::string policy = s.fifo_priority > 0 ? rig::formatted("SCHED_FIFO %d", s.fifo_priority) : "no SCHED_FIFO";
    return policy + (s.memory_locked ? ", locked memory" : ", no locked memory");
  };
  refuse_run("it has " + in_words(guardian) + ", but the controller has " + in_words(controller) +
             ": a controller in an endless loop would keep it from the processor. Give " + program +
             " the rights of abs_hil (the limits of docs/real-time.md, or sudo setcap cap_sys_nice,cap_ipc_lock+ep " +
             program + "), or set a lower realtime.priority");
}

std::string to_json(const LaunchConfig& config) {
  const telemetry::ExperimentInfo& run = config.run;
  return nlohmann::json{{"config_json", run.config_json},
                        {"experiment", run.experiment},
                        {"controller", run.controller},
                        {"plant", run.plant},
                        {"backend", run.backend},
                        {"version", run.version},
                        {"realtime", static_cast<int>(config.realtime)},
                        {"record_prefix", config.record_prefix},
                        {"signals", run.names.signals}}
      .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

LaunchConfig parse_launch_config(const std::string& json) try {
  const nlohmann::json object = rig::parse_json(json);
  LaunchConfig config{.realtime = static_cast<runtime::RealtimeMode>(object.at("realtime").get<int>()),
                      .record_prefix = object.at("record_prefix")};
  object.at("experiment").get_to(config.run.experiment);
  object.at("controller").get_to(config.run.controller);
  object.at("plant").get_to(config.run.plant);
  object.at("backend").get_to(config.run.backend);
  object.at("config_json").get_to(config.run.config_json);
  object.at("version").get_to(config.run.version);
  object.at("signals").get_to(config.run.names.signals);
  return config;
} catch (const nlohmann::json::exception& error) {
  throw std::runtime_error(std::string("guardian: not a launch configuration: ") + error.what());
}

void write_flight_files(const LaunchConfig& launch, const std::string& channel_prefix,
                        const runtime::FlightRing& recorder, const GuardianReport& report, std::string account) {
  if (launch.record_prefix.empty()) return;
  const auto records = recorder.contents();
  std::vector<std::string> problems;
  const auto files = telemetry::write_flight_record(launch.record_prefix,
                                                    {.records = records,
                                                     .reason = report.reason,
                                                     .reason_value = static_cast<double>(report.silence_ns) * 1e-9,
                                                     .account = std::move(account)},
                                                    launch.run, channel_prefix, problems);
  for (const auto& file : files) std::fprintf(stderr, "abs_guardian: wrote %s\n", file.c_str());
  for (const auto& problem : problems) std::fprintf(stderr, "abs_guardian: %s\n", problem.c_str());
}

std::string guardian_program() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path beside = self.parent_path() / "abs_guardian";
  // A program that embeds the library uses the installed guardian.
  const std::filesystem::path installed = std::filesystem::path(ABS_HIL_INSTALLED_BIN_DIR) / "abs_guardian";
  if (!std::filesystem::exists(beside, error) && std::filesystem::exists(installed, error)) return installed.string();
  return beside.string();
}

GuardianProcess::GuardianProcess(const SharedRecorder& recorder, std::string program, std::string launch_config_json)
    : Guard(Pages()), recorder_(recorder), program_(std::move(program)), launch_config_(std::move(launch_config_json)) {
  static_cast<void>(pages().leave_guard_page());
}

GuardianProcess::~GuardianProcess() { static_cast<void>(end()); }

void GuardianProcess::arm(const runtime::Scheduling& controller) {
  start();
  try {
    refuse_weaker(wait_until_ready(), controller, program_);
  } catch (...) {
    ::kill(pid_, SIGKILL);
    static_cast<void>(end());
    throw;
  }
}

void GuardianProcess::start() {
  std::array<int, 2> ends{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    refuse_for("cannot open a pair of sockets", errno);
  }
  ready_ = driver::FileDescriptor(ends[0]);
  const auto ready = high_copy(driver::FileDescriptor(ends[1]));
  reset_page();
  const auto recorder = high_copy(recorder_.descriptor());
  const auto run_page = high_copy(pages().descriptors().run);
  const auto guard_page = high_copy(pages().descriptors().guard);
  const auto controller = high_copy(driver::FileDescriptor(open_pidfd(::getpid())));
  const auto launch_config = high_copy(driver::FileDescriptor(text_in_memory(launch_config_)));

  const int error = driver::spawn(pid_, program_,
                                  {{recorder.get(), inherited_recorder},
                                   {controller.get(), inherited_controller},
                                   {ready.get(), inherited_ready},
                                   {launch_config.get(), inherited_launch_config},
                                   {run_page.get(), inherited_run_page},
                                   {guard_page.get(), inherited_guard_page}});
  if (error != 0) {
    pid_ = 0;
    refuse_for("cannot start " + program_, error, program_);
  }
  process_ = driver::FileDescriptor(open_pidfd(pid_));
  if (process_.get() < 0) {
    const int reason = errno;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
    pid_ = 0;
    refuse_for("cannot open a pidfd of its process", reason);
  }
}

runtime::Scheduling GuardianProcess::wait_until_ready() {
  if (!is_readable(ready_.get(), ready_within_ms)) {
    refuse_run(program_ + " was not ready within " + std::to_string(ready_within_ms / 1000) + " s");
  }
  char first = 0;
  if (::recv(ready_.get(), &first, 1, MSG_PEEK) <= 0) refuse_run(program_ + " ended before it was ready");
  const auto said = receive_message(ready_.get(), 0);
  if (said && said->word == LeaseWord::refused) refuse_run(said->text);
  if (!said || said->word != LeaseWord::ready) refuse_run(program_ + " comes from another build of abs_hil");
  notes_ = said->text;
  return said->scheduling;
}

bool GuardianProcess::alive() const noexcept { return pid_ == 0 || !has_ended(process_.get()); }

GuardEnd GuardianProcess::end(Stage stage) noexcept {
  ready_ = driver::FileDescriptor(-1);
  if (pid_ == 0) return GuardEnd::none;
  const bool handed_over = close_page(stage);
  const bool ended = has_ended(process_.get(), ends_within_ms);
  // A guardian that has taken the outputs over is not hung: it cannot see them yet.
  const bool acts =
      pages().guard().taken_back_for.load(std::memory_order_relaxed) == rig::Reason::safe_state_unverified;
  const bool insists = handed_over || acts;
  GuardEnd how = GuardEnd::insisting;
  if (!ended && !insists) ::kill(pid_, SIGKILL);  // the guardian is stopped or hung, and the outputs are already safe
  if (ended || !insists) {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    how = WIFEXITED(status) && WEXITSTATUS(status) == 0 ? GuardEnd::ended : GuardEnd::failed;
  }
  process_ = driver::FileDescriptor(-1);
  pid_ = 0;
  return how;
}

}  // namespace abs_hil::guardian
