#pragma once

#include <sys/types.h>

#include <string>

#include "guardian/guardian_loop.hpp"

namespace abs_hil::guardian {

/// A process identified by a pidfd. A pidfd never refers to another process, even when the process id is reused.
class LinuxProcess final : public ControllerProcess {
 public:
  /// @param pidfd  the caller keeps ownership
  explicit LinuxProcess(int pidfd) noexcept : pidfd_(pidfd) {}

  [[nodiscard]] bool gone_by(std::int64_t time_ns) noexcept override;
  void end() noexcept override;

 private:
  int pidfd_;
};

/// Opens a pidfd of a process; -1 and errno on failure.
[[nodiscard]] int open_pidfd(pid_t process) noexcept;
/// The process id behind a pidfd, as this process sees it; 0 if it has ended or is not a pidfd.
[[nodiscard]] pid_t process_of(int pidfd);
/// Sends a signal through a pidfd; signal 0 only asks whether this process may. False and errno on failure.
[[nodiscard]] bool send_signal(int pidfd, int signal) noexcept;

/// A file in memory that holds the text; -1 and errno on failure.
[[nodiscard]] int text_in_memory(const std::string& text);
/// The text of such a file, from its start, at most 16 MB.
[[nodiscard]] std::string text_behind(int fd);

}  // namespace abs_hil::guardian
