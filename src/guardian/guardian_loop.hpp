#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "guardian/options.hpp"
#include "guardian/shared_region.hpp"
#include "guardian/watchdog.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::guardian {

/// The process of the controller, as seen from the guardian.
class ControllerProcess {
 public:
  ControllerProcess() = default;
  ControllerProcess(const ControllerProcess&) = delete;
  ControllerProcess& operator=(const ControllerProcess&) = delete;
  virtual ~ControllerProcess() = default;

  /// True once the process and all its threads have ended, so that none of them can write any more. Waits for this
  /// until `time_ns` (guardian's clock) at the latest.
  [[nodiscard]] virtual bool gone_by(std::int64_t time_ns) noexcept = 0;
  /// Sends SIGKILL, which also ends stopped and hung processes.
  virtual void end() noexcept = 0;
  /// Why the controller must give the outputs back, for a cause outside of the run; `none`: it may keep them.
  [[nodiscard]] virtual rig::Reason must_give_back_for() noexcept { return rig::Reason::none; }
};

/// What the guardian did.
struct GuardianReport {
  rig::Reason reason{rig::Reason::none};  ///< `none`: the run ended in order and the guardian was dismissed
  bool acted{false};                      ///< the guardian wrote the safe state
  bool verified{false};                   ///< the guardian read the safe state back
  bool controller_lives{false};           ///< the controller was left alive: it drives nothing any more
  bool ended_controller{false};           ///< the guardian ended the controller
  bool released{false};                   ///< a person ended the guardian's tries
  driver::IoResult last_error{};          ///< error of the last failed try
  int tries{0};                           ///< number of attempts to write the safe state
  std::int64_t silence_ns{0};             ///< time without a heartbeat when the guardian decided to act
  std::int64_t noticed_ns{0};             ///< when the guardian decided to act, monotonic clock
  std::int64_t controller_gone_ns{0};     ///< when the controller was seen to have ended; 0: never
  std::int64_t first_written_ns{0};       ///< when the first try was over
  std::int64_t verified_ns{0};            ///< when the safe state had been read back
};

/// The main loop of the guardian. It reads the controller's heartbeat once per period. When the heartbeat stops it
/// makes the outputs safe in three steps:
/// 1. It ends the controller if that may still write. A controller that was stopped between index and data would
///    otherwise complete its write later and undo the safe state.
/// 2. It waits up to 5 ms until the controller, its threads and their register accesses have ended.
/// 3. It writes the safe state and reads it back. It repeats this until the safe state is verified and the controller
///    has ended, until a person releases the guardian, or for at most `insist_s` if that is not 0.
///
/// For a cause outside of the run, and after a pause of its own, it asks the controller to give the outputs back: it
/// leaves a mark in the shared memory, which every cycle looks at before it writes. The controller then ends its run as
/// after a fault, and the guardian verifies the safe state. If the controller does not do so within the timeout, the
/// guardian takes the three steps.
class GuardianLoop {
 public:
  /// @param released  becomes true when a person releases the guardian from its tries, which counts only while it makes
  ///                  them; null: nobody can
  GuardianLoop(runtime::Clock& clock, ControllerProcess& controller, SharedRegion& region,
               driver::SafeStateWriter& writer, const GuardianOptions& options,
               std::atomic<bool>* released = nullptr) noexcept;
  [[nodiscard]] GuardianReport run() noexcept;
  [[nodiscard]] std::int64_t look_period_ns() const noexcept { return look_period_ns_; }

 private:
  void make_safe(GuardianReport& report, bool writes_zeros_only) noexcept;
  [[nodiscard]] rig::Reason must_give_back_for(const HeartbeatReading& reading) noexcept;
  [[nodiscard]] bool must_give_up(GuardianReport& report, std::int64_t since_ns) const noexcept;

  runtime::Clock& clock_;
  ControllerProcess& controller_;
  SharedRegion& region_;
  driver::SafeStateWriter& writer_;
  std::atomic<bool>* released_;
  std::int64_t timeout_ns_;
  std::int64_t insist_ns_;
  std::int64_t look_period_ns_;
  Watchdog watchdog_;
  rig::Reason taken_back_for_{rig::Reason::none};
  std::int64_t last_look_ns_{0};
  std::int64_t suspended_ns_{0};
};

/// The report as several lines of text, for log and file. `controller` is the process id of the controller.
[[nodiscard]] std::string to_text(const GuardianReport& report, int controller);

}  // namespace abs_hil::guardian
