#pragma once

#include <sys/types.h>

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

}  // namespace abs_hil::guardian
