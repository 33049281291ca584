#pragma once

#include <cstdint>
#include <string>

#include "abs_hil/driver/safe_state_writer.hpp"
#include "guardian/options.hpp"
#include "guardian/shared_region.hpp"
#include "guardian/watchdog.hpp"
#include "runtime/clock.hpp"

namespace abs_hil::guardian {

/// The controller's process as its guardian sees it.
class ControllerProcess {
 public:
  ControllerProcess() = default;
  ControllerProcess(const ControllerProcess&) = delete;
  ControllerProcess& operator=(const ControllerProcess&) = delete;
  virtual ~ControllerProcess() = default;

  /// True once the process has ended with all its threads, so that nothing of it can write any more. Waits for that
  /// until `time_ns` of the guardian's clock at the latest.
  [[nodiscard]] virtual bool gone_by(std::int64_t time_ns) noexcept = 0;
  /// SIGKILL: stopped and hung processes end by it, too.
  virtual void end() noexcept = 0;
};

/// What the guardian did.
struct GuardianReport {
  rig::Reason reason{rig::Reason::none};  ///< `none`: dismissed after a run that ended in order
  bool acted{false};                      ///< it wrote the safe state
  bool verified{false};                   ///< and read it back
  driver::IoResult last_error{};          ///< of the last try that failed
  int tries{0};
  std::int64_t silence_ns{0};          ///< without a sign of life when it decided
  std::int64_t noticed_ns{0};          ///< monotonic clock
  std::int64_t controller_gone_ns{0};  ///< 0: not seen to end
  std::int64_t first_written_ns{0};    ///< after the first try
  std::int64_t verified_ns{0};
};

/// The guardian's whole life: look, and if need be make safe, in this order:
/// 1. end the controller, if it lives and may still write: otherwise one that was stopped between index and data would
///    finish its write when it goes on, and undo the safe state;
/// 2. wait until it has ended, all its threads and the accesses they were in: a little at first;
/// 3. write the safe state and read it back, again and again until it is verified with the controller gone, for
///    `insist_s` at the longest.
class GuardianLoop {
 public:
  GuardianLoop(runtime::Clock& clock, ControllerProcess& controller, SharedRegion& region,
               driver::SafeStateWriter& writer, const GuardianOptions& options) noexcept;
  [[nodiscard]] GuardianReport run() noexcept;
  [[nodiscard]] std::int64_t look_period_ns() const noexcept { return look_period_ns_; }

 private:
  void make_safe(GuardianReport& report, bool handed_over) noexcept;

  runtime::Clock& clock_;
  ControllerProcess& controller_;
  SharedRegion& region_;
  driver::SafeStateWriter& writer_;
  std::int64_t timeout_ns_;
  std::int64_t insist_ns_;
  std::int64_t look_period_ns_;
  Watchdog watchdog_;
};

/// In words, several lines, for log and file. `controller` is the process' id.
[[nodiscard]] std::string to_text(const GuardianReport& report, int controller);

}  // namespace abs_hil::guardian
