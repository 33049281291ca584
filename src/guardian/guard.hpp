#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>
#include <utility>

#include "guardian/mail.hpp"
#include "guardian/shared_region.hpp"
#include "runtime/heartbeat.hpp"
#include "runtime/realtime_setup.hpp"
#include "telemetry/message_stream.hpp"

namespace abs_hil::guardian {

/// How a guard's duty for one run ended.
enum class GuardEnd : std::uint8_t {
  none,      ///< it was not armed
  ended,     ///< it ended normally and the outputs are known to be safe
  failed,    ///< it died, or it could not verify the safe state
  insisting  ///< it still tries to verify the safe state
};

/// What guards a run's outputs, as seen from the controller: a process of the run's own, or a lease of the resident
/// service. Use it from one thread; any thread may call `making_safe` and `outputs_released`.
class Guard : public runtime::RunGuard {
 public:
  /// False once the guard's process has ended, for any cause. True before it was armed.
  [[nodiscard]] virtual bool alive() const noexcept = 0;
  [[nodiscard]] virtual bool armed() const noexcept = 0;
  [[nodiscard]] virtual pid_t pid() const noexcept = 0;
  /// Dismisses the guard after the run, when all files are written. Waits at most half a second.
  /// @param stage  `closed`: the driver is gone; `resting`: it stays active and sends zeros
  virtual GuardEnd end(Stage stage = Stage::closed) noexcept = 0;
  /// The pages that the run shares with its guard.
  [[nodiscard]] const Pages& pages() const noexcept { return pages_; }
  /// What the guardian could not obtain (real time), as text; empty if it lacks nothing.
  [[nodiscard]] const std::string& notes() const noexcept { return notes_; }

  void making_safe() noexcept final;
  void outputs_released(bool safe) noexcept final;

 protected:
  explicit Guard(Pages pages) noexcept : pages_(std::move(pages)) {}
  /// Throws driver::Unavailable if the guardian would be scheduled after the controller, or swapped out before it.
  static void refuse_weaker(const runtime::Scheduling& guardian, const runtime::Scheduling& controller,
                            const std::string& program);
  /// Before a guard takes up its watch: no beats yet, and the outputs may be driven once it has.
  void reset_page() noexcept;
  /// Says that the run is done, unless the outputs were handed over. Returns true if they were.
  bool close_page(Stage stage) noexcept;

  std::string notes_{};

 private:
  Pages pages_;
};

/// "guardian: WHAT. The run does not start ..." as driver::Unavailable.
[[noreturn]] void refuse_run(const std::string& what);

/// What the controller passes to the guardian when it starts it.
struct LaunchConfig {
  telemetry::ExperimentInfo run{};  ///< for the flight recorder's files; without names of phases
  runtime::RealtimeMode realtime{runtime::RealtimeMode::prefer};
  std::string record_prefix{};  ///< path prefix of the files that the guardian writes; empty: it writes none
};

[[nodiscard]] std::string to_json(const LaunchConfig& config);
/// Throws std::runtime_error if `json` is not a launch configuration.
[[nodiscard]] LaunchConfig parse_launch_config(const std::string& json);

/// Writes the flight record of a run to the files that its launch config names, if it names any. Tells on stderr.
void write_flight_files(const LaunchConfig& launch, const std::string& channel_prefix,
                        const runtime::FlightRing& recorder, const GuardianReport& report, std::string account);

/// The file descriptors that the guardian inherits. Besides these it has only stdin, stdout (both /dev/null) and
/// stderr.
enum InheritedDescriptor : int {
  inherited_recorder = 3,       ///< SharedRecorder
  inherited_controller = 4,     ///< pidfd of the controller
  inherited_ready = 5,          ///< socket to the controller: the guardian sends one LeaseMessage, `ready` or `refused`
  inherited_launch_config = 6,  ///< LaunchConfig as JSON, read from offset 0
  inherited_run_page = 7,       ///< both of Pages
  inherited_guard_page = 8,
};

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

 private:
  void start();
  /// Returns what the guardian has of the real-time set-up.
  [[nodiscard]] runtime::Scheduling wait_until_ready();

  const SharedRecorder& recorder_;
  std::string program_;
  std::string launch_config_;
  pid_t pid_{0};
  driver::FileDescriptor process_{-1};  ///< pidfd
  driver::FileDescriptor ready_{-1};
};

}  // namespace abs_hil::guardian
