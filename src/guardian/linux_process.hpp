#pragma once

#include <sys/types.h>

#include "guardian/guardian_loop.hpp"

namespace abs_hil::guardian {

/// A process behind a pidfd, which names this very process however soon it ends and its number is used again.
class LinuxProcess final : public ControllerProcess {
 public:
  /// @param pidfd  stays the caller's
  explicit LinuxProcess(int pidfd) noexcept : pidfd_(pidfd) {}

  [[nodiscard]] bool gone_by(std::int64_t time_ns) noexcept override;
  void end() noexcept override;

 private:
  int pidfd_;
};

/// A pidfd of a process; -1 and errno if there is none.
[[nodiscard]] int open_pidfd(pid_t process) noexcept;

}  // namespace abs_hil::guardian
