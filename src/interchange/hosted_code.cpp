#include "interchange/hosted_code.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>

// NOLINTNEXTLINE(readability-redundant-declaration): POSIX wants it declared
extern char** environ;

namespace abs_hil::interchange {

namespace {

constexpr int step_limit_ms = 2'000;
constexpr int start_limit_ms = 20'000;

/// Waits for a packet. 0: the other end is closed; -1: none came in time.
ssize_t receive(int socket, void* data, std::size_t size, int limit_ms) noexcept {
  pollfd ready{socket, POLLIN, 0};
  int polled = 0;
  do {
    polled = ::poll(&ready, 1, limit_ms);
  } while (polled < 0 && errno == EINTR);
  if (polled == 0) return -1;
  const ssize_t got = ::recv(socket, data, size, 0);
  return got < 0 ? 0 : got;
}

pid_t spawn(const std::string& program, int socket) {
  posix_spawn_file_actions_t actions{};
  posix_spawnattr_t attributes{};
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_init(&attributes);
  sigset_t none{};
  sigset_t all{};
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  // A session of its own: Ctrl-C ends the run in order and must not kill its controller.
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, socket, host_socket);
  std::string name = "abs_controller_host";
  std::array<char*, 2> arguments{name.data(), nullptr};
  pid_t pid = 0;
  const int error = ::posix_spawn(&pid, program.c_str(), &actions, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0) {
    throw std::runtime_error(
        fmt::format("{}: {}: controllers from files run in it; install it in the folder of abs_hil", program,
                    std::strerror(error)));
  }
  return pid;
}

}  // namespace

std::string host_program() {
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  constexpr const char* name = "abs_controller_host";
  const std::filesystem::path beside = self.parent_path() / name;
  // An installation may have been moved as a whole. A program that embeds the library uses the installed one.
  const std::filesystem::path moved = self.parent_path().parent_path() / ABS_HIL_HOST_DIR / name;
  const std::filesystem::path installed = std::filesystem::path(ABS_HIL_INSTALLED_HOST_DIR) / name;
  for (const std::filesystem::path& path : {beside, moved, installed}) {
    if (std::filesystem::exists(path, error)) return path.string();
  }
  return beside.string();
}

HostedCode::HostedCode(const ForeignSetup& setup) {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw std::runtime_error(std::string("socketpair: ") + std::strerror(errno));
  }
  socket_ = ends[0];
  try {
    pid_ = spawn(host_program(), ends[1]);
    ::close(std::exchange(ends[1], -1));
    const std::string text = nlohmann::json{
        {"file", std::filesystem::absolute(setup.file).string()},
        {"folder", setup.folder.string()},
        {"mapping", setup.mapping.empty() ? std::string() : std::filesystem::absolute(setup.mapping).string()},
        {"period_s", setup.period_s},
        {"parameters",
         setup.parameters}}.dump();
    std::string answer(host_packet_max, '\0');
    const bool sent = ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
    const ssize_t size = sent ? receive(socket_, answer.data(), answer.size(), start_limit_ms) : 0;
    if (size <= 0) {
      throw std::invalid_argument(
          fmt::format("{}: while it was loaded and made, its code {}", setup.file.string(), obituary(size < 0)));
    }
    const auto json = nlohmann::json::parse(answer.substr(0, static_cast<std::size_t>(size)));
    if (json.contains("error")) throw std::invalid_argument(json.at("error").get<std::string>());
    signals_ = json.at("signals").get<std::vector<std::string>>();
  } catch (...) {
    if (ends[1] >= 0) ::close(ends[1]);
    end();
    throw;
  }
}

HostedCode::~HostedCode() { end(); }

void HostedCode::end() noexcept {
  if (socket_ >= 0) ::close(std::exchange(socket_, -1));
  if (pid_ == 0) return;
  ::kill(pid_, SIGKILL);
  static_cast<void>(::waitpid(std::exchange(pid_, 0), nullptr, 0));
}

std::string HostedCode::obituary(bool silent) noexcept {
  if (silent) {
    end();
    return "did not answer in time";
  }
  int status = 0;
  const pid_t pid = std::exchange(pid_, 0);
  if (pid == 0 || ::waitpid(pid, &status, 0) != pid) return "ended";
  if (WIFSIGNALED(status)) return fmt::format("crashed: {}", ::strsignal(WTERMSIG(status)));
  return fmt::format("ended its process with status {}", WEXITSTATUS(status));
}

bool HostedCode::ask(const HostRequest& request, HostAnswer& answer) noexcept {
  if (socket_ < 0 || !failure_.empty()) return false;
  const bool sent = ::send(socket_, &request, sizeof request, MSG_NOSIGNAL) == static_cast<ssize_t>(sizeof request);
  const ssize_t got = sent ? receive(socket_, &answer, sizeof answer, step_limit_ms) : 0;
  if (got == static_cast<ssize_t>(sizeof answer)) return true;
  failure_ = fmt::format("its code {} in step {}", obituary(got < 0), steps_);
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
  output = ask({.action = HostAction::step, .input = input}, answer) ? answer.output : no_output();
  step_ns_ = answer.step_ns;
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
