#pragma once

#include <sys/types.h>

#include <string>

#include "guardian/shared_region.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::guardian {

/// Descriptors that a guardian finds open, and no others beside stdin, stdout (both /dev/null) and stderr.
enum InheritedDescriptor : int {
  inherited_region = 3,         ///< SharedRegion
  inherited_controller = 4,     ///< pidfd of the controller
  inherited_ready = 5,          ///< pipe: "ready NOTES" or "error WHAT", once
  inherited_launch_config = 6,  ///< LaunchConfig as JSON, to be read from the start
};

/// The program of the guardian: abs_guardian beside the running one, else the installed one.
[[nodiscard]] std::string guardian_program();

/// The guardian as the controller sees it: a child process in a session of its own, so that a terminal's Ctrl-C or end
/// does not reach it. Used from one thread, `making_safe` and `outputs_released` excepted.
class GuardianProcess final : public runtime::RunGuard {
 public:
  /// @param region  must outlive it
  /// @param brief_json  what the guardian is told
  GuardianProcess(SharedRegion& region, std::string program, std::string brief_json);
  /// As end(), if that was not called.
  ~GuardianProcess() override;

  /// Starts it and waits until it has its own handle on the outputs, at most 5 s. Throws driver::Unavailable.
  void stand_guard() override;
  void making_safe() noexcept override;
  void outputs_released(bool safe) noexcept override;

  /// False once it has ended, for whatever cause. True before it was started.
  [[nodiscard]] bool alive() const noexcept;
  [[nodiscard]] pid_t pid() const noexcept { return pid_; }
  /// What it said when it was ready; empty if all was as it should be.
  [[nodiscard]] const std::string& notes() const noexcept { return notes_; }

  /// How the guardian left.
  enum class GuardianExit : std::uint8_t {
    none,      ///< there was none
    ended,     ///< in order, the outputs known to be safe
    failed,    ///< it died, or gave up
    insisting  ///< it goes on trying to verify the safe state, without us
  };
  /// The run is over, its files are written: dismisses the guardian and waits for its end, half a second at most.
  GuardianExit end() noexcept;

 private:
  void start();
  void wait_until_ready();
  [[nodiscard]] bool ended_within(int timeout_ms) const noexcept;

  SharedRegion& region_;
  std::string program_;
  std::string brief_;
  std::string notes_{};
  pid_t pid_{0};
  int pidfd_{-1};
  int ready_{-1};
};

}  // namespace abs_hil::guardian
