#include "guardian/linux_process.hpp"

#include <poll.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <ctime>
#include <fstream>

#include "abs_hil/rig/time_units.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::guardian {

int open_pidfd(pid_t process) noexcept {
  constexpr unsigned int no_flags = 0;  // a pidfd is always close-on-exec
  return static_cast<int>(::syscall(SYS_pidfd_open, process, no_flags));
}

int LinuxProcesses::open(pid_t pid) noexcept {
  const int pidfd = open_pidfd(pid);
  if (pidfd < 0 || send_signal(pidfd, 0)) return pidfd;
  ::close(pidfd);
  return -1;
}

void LinuxProcesses::close(int handle) noexcept { ::close(handle); }

bool LinuxProcesses::gone(int handle) noexcept { return has_ended(handle); }

void LinuxProcesses::end(int handle) noexcept { static_cast<void>(send_signal(handle, SIGKILL)); }

bool has_ended(int pidfd, int timeout_ms) noexcept {
  pollfd ended{pidfd, POLLIN, 0};
  int ready = 0;
  do {
    ready = ::poll(&ended, 1, timeout_ms);  // POLLNVAL: there is no process
  } while (ready < 0 && errno == EINTR);
  return ready > 0;
}

void wait_for_guard(const BoardGuard& guard, int orders) noexcept {
  runtime::MonotonicClock clock;
  const std::int64_t left_ns = std::max<std::int64_t>(0, guard.next_ns() - clock.now_ns());
  const timespec left{.tv_sec = static_cast<time_t>(left_ns / rig::ns_per_s), .tv_nsec = left_ns % rig::ns_per_s};
  std::array<pollfd, 2> files{pollfd{orders, POLLIN, 0}, pollfd{guard.holder(), POLLIN, 0}};
  static_cast<void>(::ppoll(files.data(), files.size(), &left, nullptr));
}

bool send_signal(int pidfd, int signal) noexcept {
  return ::syscall(SYS_pidfd_send_signal, pidfd, signal, nullptr, 0) == 0;
}

std::string name_of_process(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/comm");
  std::string name;
  std::getline(file, name);
  return "process " + std::to_string(pid) + (name.empty() ? "" : " (" + rig::printable(name, 64) + ")");
}

pid_t process_of(int pidfd) {
  std::ifstream info("/proc/self/fdinfo/" + std::to_string(pidfd));
  std::string field;
  while (info >> field) {
    pid_t pid = 0;
    if (field == "Pid:" && info >> pid) return std::max(pid, 0);
  }
  return 0;
}

int text_in_memory(const std::string& text) {
  const int fd = ::memfd_create("abs_hil launch config", MFD_CLOEXEC);
  if (fd < 0) return -1;
  if (::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size())) return fd;
  ::close(fd);
  errno = EIO;
  return -1;
}

std::string text_behind(int fd) {
  constexpr std::size_t longest = std::size_t{1} << 20U;
  std::string text;
  std::array<char, 4096> part{};
  for (ssize_t got = 0;
       text.size() < longest && (got = ::pread(fd, part.data(), part.size(), static_cast<off_t>(text.size()))) > 0;) {
    text.append(part.data(), static_cast<std::size_t>(got));
  }
  return text;
}

}  // namespace abs_hil::guardian
