#pragma once

#include <sys/types.h>

#include <string>

#include "guardian/shared_region.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::guardian {

/// The file descriptors that the guardian inherits. Besides these it has only stdin, stdout (both /dev/null) and
/// stderr.
enum InheritedDescriptor : int {
  inherited_region = 3,         ///< SharedRegion
  inherited_controller = 4,     ///< pidfd of the controller
  inherited_ready = 5,          ///< pipe to the controller: the guardian writes "ready NOTES" or "error WHAT" once
  inherited_launch_config = 6,  ///< LaunchConfig as JSON, read from offset 0
};

/// Path of the guardian's program: abs_guardian in the folder of the running program, otherwise the installed one.
[[nodiscard]] std::string guardian_program();

/// The guardian's process, as seen from the controller: a child process in its own session, so that Ctrl-C or the end
/// of the terminal does not reach it. Use it from one thread; any thread may call `making_safe` and `outputs_released`.
class GuardianProcess final : public runtime::RunGuard {
 public:
  /// @param region  must outlive this object
  /// @param launch_config_json  LaunchConfig as JSON (`to_json`)
  GuardianProcess(SharedRegion& region, std::string program, std::string launch_config_json);
  /// Calls end() unless the caller did.
  ~GuardianProcess() override;

  /// Starts the guardian and waits until it has its own handle on the outputs, at most 5 s. Throws driver::Unavailable.
  void arm() override;
  void making_safe() noexcept override;
  void outputs_released(bool safe) noexcept override;

  /// False once the guardian has ended, for any cause. True before it was started.
  [[nodiscard]] bool alive() const noexcept;
  [[nodiscard]] pid_t pid() const noexcept { return pid_; }
  /// What the guardian could not obtain (real time), as text; empty if it lacks nothing.
  [[nodiscard]] const std::string& notes() const noexcept { return notes_; }

  /// How the guardian ended.
  enum class GuardianExit : std::uint8_t {
    none,      ///< no guardian was started
    ended,     ///< it ended normally and the outputs are known to be safe
    failed,    ///< it died, or it could not verify the safe state
    insisting  ///< it still runs and tries to verify the safe state
  };
  /// Dismisses the guardian after the run, when all files are written. Waits at most half a second for its end.
  GuardianExit end() noexcept;

 private:
  void start();
  void wait_until_ready();
  [[nodiscard]] bool ended_within(int timeout_ms) const noexcept;

  SharedRegion& region_;
  std::string program_;
  std::string launch_config_;
  std::string notes_{};
  pid_t pid_{0};
  int pidfd_{-1};
  int ready_{-1};
};

}  // namespace abs_hil::guardian
