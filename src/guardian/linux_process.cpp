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

namespace abs_hil::guardian {

int open_pidfd(pid_t process) noexcept {
  constexpr unsigned int no_flags = 0;  // a pidfd is always close-on-exec
  return static_cast<int>(::syscall(SYS_pidfd_open, process, no_flags));
}

bool LinuxProcess::gone_by(std::int64_t time_ns) noexcept {
  runtime::MonotonicClock clock;
  for (;;) {
    const std::int64_t left_ns = std::max<std::int64_t>(0, time_ns - clock.now_ns());
    const timespec left{.tv_sec = static_cast<time_t>(left_ns / rig::ns_per_s), .tv_nsec = left_ns % rig::ns_per_s};
    pollfd ended{pidfd_, POLLIN, 0};
    const int ready = ::ppoll(&ended, 1, &left, nullptr);
    if (ready > 0) return true;  // POLLIN: the process has ended. POLLNVAL: there is no process to guard
    if (ready == 0 || errno != EINTR) return false;
  }
}

void LinuxProcess::end() noexcept { static_cast<void>(send_signal(pidfd_, SIGKILL)); }

bool send_signal(int pidfd, int signal) noexcept {
  return ::syscall(SYS_pidfd_send_signal, pidfd, signal, nullptr, 0) == 0;
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
  constexpr std::size_t longest = std::size_t{16} << 20U;
  std::string text;
  std::array<char, 4096> part{};
  for (ssize_t got = 0;
       text.size() < longest && (got = ::pread(fd, part.data(), part.size(), static_cast<off_t>(text.size()))) > 0;) {
    text.append(part.data(), static_cast<std::size_t>(got));
  }
  return text;
}

}  // namespace abs_hil::guardian
