#include "guardian/linux_process.hpp"

#include <poll.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <ctime>

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

void LinuxProcess::end() noexcept { static_cast<void>(::syscall(SYS_pidfd_send_signal, pidfd_, SIGKILL, nullptr, 0)); }

}  // namespace abs_hil::guardian
