#pragma once

#include <sys/types.h>

#include <string>

#include "guardian/guard.hpp"
#include "guardian/shared_region.hpp"

namespace abs_hil::guardian {

/// The file descriptors that the guardian inherits. Besides these it has only stdin, stdout (both /dev/null) and
/// stderr.
enum InheritedDescriptor : int {
  inherited_recorder = 3,    ///< SharedRecorder
  inherited_controller = 4,  ///< pidfd of the controller
  inherited_ready = 5,  ///< pipe to the controller: the guardian writes once what `ready_text` makes, or "error WHAT"
  inherited_launch_config = 6,  ///< LaunchConfig as JSON, read from offset 0
  inherited_run_page = 7,       ///< both of Pages
  inherited_guard_page = 8,
};

/// What a guardian that stands by tells its controller.
[[nodiscard]] std::string ready_text(const runtime::Scheduling& guardian, const std::string& notes);

/// Path of the guardian's program: abs_guardian in the folder of the running program, otherwise the installed one.
[[nodiscard]] std::string guardian_program();

/// The guardian's process, as seen from the controller: a child process in its own session, so that Ctrl-C or the end
/// of the terminal does not reach it.
class GuardianProcess final : public Guard {
 public:
  /// @param recorder  must outlive this object
  /// @param launch_config_json  LaunchConfig as JSON (`to_json`)
  GuardianProcess(const SharedRecorder& recorder, std::string program, std::string launch_config_json);
  /// Calls end() unless the caller did.
  ~GuardianProcess() override;

  /// Starts the guardian and waits until it has its own handle on the outputs, at most 5 s. Throws driver::Unavailable.
  void arm(const runtime::Scheduling& controller) override;
  [[nodiscard]] bool alive() const noexcept override;
  [[nodiscard]] bool armed() const noexcept override { return pid_ != 0; }
  [[nodiscard]] pid_t pid() const noexcept override { return pid_; }
  GuardEnd end(Stage stage = Stage::closed) noexcept override;
  [[nodiscard]] Pages& pages() noexcept override { return pages_; }

 private:
  void start();
  /// Returns what the guardian has of the real-time set-up.
  [[nodiscard]] runtime::Scheduling wait_until_ready();

  const SharedRecorder& recorder_;
  Pages pages_{};
  std::string program_;
  std::string launch_config_;
  pid_t pid_{0};
  int pidfd_{-1};
  int ready_{-1};
};

}  // namespace abs_hil::guardian
