#pragma once

#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <span>
#include <string>
#include <vector>

#include "driver/file_descriptor.hpp"
#include "guardian/board_guard.hpp"

namespace abs_hil::guardian {

/// Opens a pidfd of a process; -1 and errno on failure.
[[nodiscard]] int open_pidfd(pid_t process) noexcept;
/// The process id behind a pidfd, as this process sees it; 0 if it has ended or is not a pidfd.
[[nodiscard]] pid_t process_of(int pidfd);
/// Sends a signal through a pidfd; signal 0 only asks whether this process may. False and errno on failure.
[[nodiscard]] bool send_signal(int pidfd, int signal) noexcept;
/// True once there is something to read, or never will be, `timeout_ms` later at the latest.
[[nodiscard]] bool is_readable(int fd, int timeout_ms) noexcept;
/// True once the process behind the pidfd has ended, `timeout_ms` later at the latest, and if there is no process.
[[nodiscard]] inline bool has_ended(int pidfd, int timeout_ms = 0) noexcept { return is_readable(pidfd, timeout_ms); }
/// Takes on the rights of this user for good.
[[nodiscard]] bool become(uid_t user, gid_t group);
/// Closes all descriptors behind stderr's but these.
void close_all_but(std::vector<int> kept) noexcept;
/// "process 17 (abs_hil)"
[[nodiscard]] std::string name_of_process(pid_t pid);

/// Processes identified by pidfds. A pidfd never refers to another process, even when the process id is reused.
class LinuxProcesses final : public Processes {
 public:
  [[nodiscard]] int open(pid_t pid) noexcept override;
  void close(int handle) noexcept override { ::close(handle); }
  [[nodiscard]] bool gone(int handle) noexcept override { return has_ended(handle); }
  void end(int handle) noexcept override { static_cast<void>(send_signal(handle, SIGKILL)); }
};

using Companions = std::array<int, 2>;  ///< pidfds; -1: none
/// Sleeps until the guard wants to look, or there is an order, or the holder or a companion has ended.
void wait_for_guard(const BoardGuard& guard, runtime::Clock& clock, Companions companions) noexcept;
/// Runs the guard until it is over. `between` is called after each look and tells the companions.
template <class Between>
void run_guard(BoardGuard& guard, runtime::Clock& clock, Between between) {
  while (!guard.over()) {
    guard.look();
    const Companions companions = between();
    if (!guard.over()) wait_for_guard(guard, clock, companions);
  }
}

/// Sends one packet, made of `parts` in a row, with copies of `files`, at most 4. False and errno if it could not be
/// sent whole, at once. Real-time safe.
[[nodiscard]] bool send_packet(int socket, std::span<const iovec> parts, std::span<const int> files) noexcept;
/// Receives the packet that waits: its bytes into `parts`, its descriptors into `files`. Returns its size; -1 and errno
/// if there is none.
[[nodiscard]] ssize_t receive_packet(int socket, std::span<iovec> parts, std::vector<driver::FileDescriptor>& files);

/// A file in memory that holds the text; -1 and errno on failure.
[[nodiscard]] int text_in_memory(const std::string& text);
/// The text of such a file, from its start, at most 1 MB.
[[nodiscard]] std::string text_behind(int fd);

}  // namespace abs_hil::guardian
