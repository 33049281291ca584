// Starts the process of foreign code, passes each call on by a socket, and says how the process ended.
#include "interchange/hosted_code.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "abs_hil/driver/io_result.hpp"
#include "abs_hil/rig/option.hpp"
#include "driver/spawn.hpp"
#include "interchange/confinement.hpp"
#include "rig/formatted_text.hpp"
#include "rig/parse_json.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::interchange {

namespace {

constexpr int step_limit_ms = 2'000;
constexpr int start_limit_ms = 20'000;
/// All steps of a run may take this long and this many times as long as the time that they simulate.
constexpr std::int64_t run_grace_ns = 10'000'000'000;
constexpr double run_slowness_max = 100.0;
constexpr const char* not_allowed =
    "a controller from a file may start no process, touch no other process and take no priority";
/// What foreign code prints is passed on up to this many bytes.
constexpr std::size_t printed_max = 65'536;

/// Empty: the running program.
std::filesystem::path& program_of_the_host() {
  static std::filesystem::path program;
  return program;
}

/// Path of the host's program, beside the running program, otherwise the installed one: abs_controller_host, for a
/// class in Python abs_python_host of the Python package.
std::string host_program(const std::filesystem::path& file) {
  std::error_code error;
  const std::filesystem::path& told = program_of_the_host();
  const std::filesystem::path self = told.empty() ? std::filesystem::read_symlink("/proc/self/exe", error) : told;
  const char* name = rig::FileEndings::is_python_class(file.native()) ? "abs_python_host" : "abs_controller_host";
  const std::filesystem::path beside = self.parent_path() / name;
  // An installation may have been moved as a whole. A program that embeds the library uses the installed one.
  const std::filesystem::path moved = self.parent_path().parent_path() / ABS_HIL_HOST_DIR / name;
  const std::filesystem::path installed = std::filesystem::path(ABS_HIL_INSTALLED_HOST_DIR) / name;
  for (const std::filesystem::path& path : {beside, moved, installed}) {
    if (std::filesystem::exists(path, error)) return path.string();
  }
  return beside.string();
}

}  // namespace

void set_host_beside(const std::string& program) { program_of_the_host() = program; }

void HostedCode::start(const std::string& program) {
  std::array<int, 2> ends{-1, -1};
  std::array<int, 2> pipe{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw driver::Unavailable("socketpair: " + rig::refusal(errno, "", rig::starting));
  }
  socket_ = driver::FileDescriptor(ends[0]);
  const driver::FileDescriptor their_socket(ends[1]);
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0)
    throw driver::Unavailable("pipe: " + rig::refusal(errno, "", rig::starting));
  prints_ = driver::FileDescriptor(pipe[0]);
  const driver::FileDescriptor their_prints(pipe[1]);
  ::fcntl(prints_.get(), F_SETFL, O_NONBLOCK);
  // Not the run's own stderr: nothing of the code's may hold that.
  const int error = driver::spawn(
      pid_, program,
      {{their_prints.get(), STDOUT_FILENO}, {their_prints.get(), STDERR_FILENO}, {their_socket.get(), host_socket}});
  if (error == 0) return;
  pid_ = 0;
  throw driver::Unavailable(
      fmt::format("{}, in which controllers from files run: {}", program, rig::refusal(error, program, rig::starting)));
}

// A constructor that ends by an exception after the other one has returned calls the destructor.
HostedCode::HostedCode(const ForeignSetup& setup) : HostedCode(setup.period_s) {
  start(host_program(setup.file));
  ForeignSetup told = setup;
  if (!rig::FileEndings::is_python_class(setup.file.native())) told.file = std::filesystem::absolute(setup.file);
  if (!setup.mapping.empty()) told.mapping = std::filesystem::absolute(setup.mapping);
  const std::string text = nlohmann::json(told).dump();
  std::string answer(host_packet_max, '\0');
  const bool sent = ::send(socket_.get(), text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  const ssize_t size = sent ? receive(answer.data(), answer.size(), start_limit_ms) : 0;
  if (size <= static_cast<ssize_t>(sizeof(HostRefusal))) {
    throw std::invalid_argument(fmt::format("{}: while it was loaded and made, its code {}", setup.file.string(),
                                            how_it_ended(size, answer.data())));
  }
  try {
    const auto json = rig::parse_json(answer.substr(0, static_cast<std::size_t>(size)));
    if (json.contains("error"))
      throw std::invalid_argument(rig::clean_text(json.at("error").get<std::string>(), 2000, "\n"));
    json.at("signals").get_to(signals_);
    json.at("source").get_to(source_);
  } catch (const nlohmann::json::exception&) {
    throw std::invalid_argument(
        fmt::format("{}: while it was loaded and made, its code sent an answer of its own", setup.file.string()));
  }
}

void HostedCode::end() noexcept {
  if (pid_ != 0) {
    // The group as well: on a kernel that could not forbid it, the code may have started other processes.
    ::kill(-pid_, SIGKILL);
    ::kill(pid_, SIGKILL);
    static_cast<void>(::waitpid(std::exchange(pid_, 0), nullptr, 0));
  }
  if (prints_.get() >= 0) pass_on_prints();
  prints_ = driver::FileDescriptor();
  socket_ = driver::FileDescriptor();
}

void HostedCode::pass_on_prints() noexcept {
  std::array<char, 4096> text;
  constexpr int parts = 32;  // all that a pipe holds; one who prints without end must not keep the run here
  for (int part = 0; part < parts; ++part) {
    const ssize_t got = ::read(prints_.get(), text.data(), text.size());
    if (got <= 0) return;
    if (printed_ >= printed_max) continue;
    printed_ += static_cast<std::size_t>(got);
    // A full pipe behind stderr must not stop the run.
    pollfd room{STDERR_FILENO, POLLOUT, 0};
    if (::poll(&room, 1, 0) != 1) continue;
    const std::string shown = rig::clean_text({text.data(), static_cast<std::size_t>(got)}, text.size(), "\n\t");
    static_cast<void>(!::write(STDERR_FILENO, shown.data(), shown.size()));
    constexpr std::string_view enough = "\nabs_hil: the controller prints too much; the rest is left out\n";
    if (printed_ >= printed_max) static_cast<void>(!::write(STDERR_FILENO, enough.data(), enough.size()));
  }
}

bool HostedCode::too_many_threads() const noexcept {
  std::array<char, 32> path{};
  *fmt::format_to_n(path.data(), path.size() - 1, "/proc/{}/task", pid_).out = '\0';
  struct stat folder {};
  constexpr std::uint64_t links_of_a_folder = 2;
  return ::stat(path.data(), &folder) == 0 && folder.st_nlink > links_of_a_folder + host_threads_max;
}

ssize_t HostedCode::receive(void* data, std::size_t size, int limit_ms) noexcept {
  constexpr int slice_ms = 50;
  runtime::MonotonicClock clock;
  const std::int64_t until_ns = clock.now_ns() + std::int64_t{limit_ms} * 1'000'000;
  while (true) {
    std::array<pollfd, 2> ready{{{socket_.get(), POLLIN, 0}, {prints_.get(), POLLIN, 0}}};
    const int polled = ::poll(ready.data(), ready.size(), slice_ms);
    if (polled > 0 && ready[1].revents != 0) pass_on_prints();
    if (polled > 0 && ready[0].revents != 0) {
      const ssize_t got = ::recv(socket_.get(), data, size, MSG_TRUNC);
      return got < 0 ? 0 : got;
    }
    const bool closed_prints = polled > 0 && (ready[1].revents & POLLHUP) != 0;
    if (closed_prints) ::poll(nullptr, 0, 1);  // it closed them, and lives: wait for its answer without haste
    if (polled == 0 && too_many_threads()) return -1;
    if (clock.now_ns() > until_ns) return -1;
  }
}

std::string HostedCode::how_it_ended(ssize_t got, const void* answer) noexcept {
  if (got == static_cast<ssize_t>(sizeof(HostRefusal))) {
    HostRefusal refusal;
    std::memcpy(&refusal, answer, sizeof refusal);
    end();
    return fmt::format("was ended: it asked for the system call {} ({}); {}", refusal.system_call,
                       name_of_call(refusal.system_call), not_allowed);
  }
  if (got != 0) {
    const bool threads = too_many_threads();
    end();
    if (threads) return fmt::format("was ended: it has more than {} threads", host_threads_max);
    return got < 0 ? "did not answer in time" : fmt::format("was ended: it sent an answer of {} bytes", got);
  }
  // The end of a process closes its socket a moment before its status can be had.
  constexpr int tries = 100;
  int status = 0;
  pid_t ended = 0;
  for (int i = 0; i < tries && pid_ != 0 && (ended = ::waitpid(pid_, &status, WNOHANG)) == 0; ++i)
    ::poll(nullptr, 0, 2);
  if (ended <= 0) {
    end();
    return "was ended: it closed its connection to the run";
  }
  pid_ = 0;
  end();
  // The C library starts a process with all signals blocked, so the host cannot tell which call it was.
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGSYS) {
    return fmt::format("was ended: it asked for a system call that is not allowed, probably to start a process; {}",
                       not_allowed);
  }
  if (WIFSIGNALED(status)) {
    return fmt::format("crashed: {}{}", ::strsignal(WTERMSIG(status)),
                       WTERMSIG(status) == SIGBUS ? " (as of a file that was cut off: copy or build it again)" : "");
  }
  return fmt::format("ended its process with status {}", WEXITSTATUS(status));
}

bool HostedCode::ask(const HostRequest& request, HostAnswer& answer) noexcept {
  if (socket_.get() < 0 || !failure_.empty()) return false;
  const bool sent =
      ::send(socket_.get(), &request, sizeof request, MSG_NOSIGNAL) == static_cast<ssize_t>(sizeof request);
  const ssize_t got = sent ? receive(&answer, sizeof answer, step_limit_ms) : 0;
  constexpr std::uint64_t steps_between_looks = 256;
  const bool crowded = all_steps_ % steps_between_looks == 0 && too_many_threads();
  if (got == static_cast<ssize_t>(sizeof answer) && !crowded) {
    answer.failure.back() = '\0';
    failure_ = rig::clean_text(answer.failure.data(), answer.failure.size());
    return failure_.empty();
  }
  failure_ = fmt::format("its code {} in step {}", how_it_ended(crowded ? -1 : got, &answer), steps_);
  return false;
}

void HostedCode::reset(const abs_hil_input& input) noexcept {
  HostAnswer answer;
  steps_ = 0;
  static_cast<void>(ask({.action = HostAction::reset, .input = input}, answer));
}

void HostedCode::step(const abs_hil_input& input, abs_hil_output& output) noexcept {
  HostAnswer answer;
  ++steps_;
  runtime::MonotonicClock clock;
  const std::int64_t before_ns = clock.now_ns();
  output = ask({.action = HostAction::step, .input = input}, answer) ? answer.output : no_output();
  spent_ns_ += clock.now_ns() - before_ns;
  ++all_steps_;
  const double simulated_ns = static_cast<double>(all_steps_) * period_s_ * 1e9;
  if (failure_.empty() && static_cast<double>(spent_ns_ - run_grace_ns) > run_slowness_max * simulated_ns) {
    failure_ = fmt::format(
        "its code is too slow: {} steps of {} s took {:.1f} s together; at most 10 s and {} times the simulated time",
        all_steps_, period_s_, static_cast<double>(spent_ns_) * 1e-9, run_slowness_max);
    output = no_output();
    end();
  }
}

StepTimes HostedCode::warm_up_there(double period_s, std::uint32_t steps) {
  HostAnswer answer;
  static_cast<void>(ask({.action = HostAction::warm_up, .count = steps, .period_s = period_s}, answer));
  return answer.times;
}

Offences HostedCode::probe(double period_s, std::uint32_t steps) {
  HostAnswer answer;
  static_cast<void>(ask({.action = HostAction::probe, .count = steps, .period_s = period_s}, answer));
  return answer.offences;
}

}  // namespace abs_hil::interchange
