#pragma once

#include <cstdint>

#include "abs_hil/rig/reason.hpp"
#include "runtime/heartbeat.hpp"

namespace abs_hil::guardian {

using runtime::Stage;

/// One look of the guardian at the controller.
struct HeartbeatReading {
  std::int64_t now_ns{0};                         ///< guardian's clock
  std::uint64_t cycle_beats{0};                   ///< heartbeats of the cycle's thread; 0: no cycle has begun yet
  Stage stage{Stage::guarded};                    ///< read after `controller_gone`
  bool controller_gone{false};                    ///< the process and all its threads have ended
  rig::Reason taken_back_for{rig::Reason::none};  ///< why the controller was asked to make the outputs safe; none: not
};

/// What the guardian has to do.
enum class Verdict : std::uint8_t {
  wait,       ///< nothing: the run is in order
  make_safe,  ///< bring the outputs into the safe state; the reason is known
  dismissed   ///< the run is over and its outputs are safe
};

/// Decides from heartbeat and stage whether the outputs must be made safe. A heartbeat is a change of the cycle count.
/// Silence is measured in the guardian's own time: each look adds at most two look periods, so a pause of the guardian,
/// or of the whole computer, does not count as silence of the controller. The first reason stays.
///
/// A controller that was asked to give the outputs back has the timeout for it. After that it counts as silent.
class Watchdog {
 public:
  /// @param timeout_ns  longest silence of the controller, > 0
  /// @param look_period_ns  time between two looks, > 0; the verdict comes at most one period after the timeout
  /// @param making_safe_ns  added to the timeout while the controller waits for its board to confirm the safe state,
  ///                        >= 0
  Watchdog(std::int64_t timeout_ns, std::int64_t look_period_ns, std::int64_t making_safe_ns = 0) noexcept
      : timeout_ns_(timeout_ns), look_period_ns_(look_period_ns), making_safe_ns_(making_safe_ns) {}

  /// A run that is covered begins its first cycle within this time, ns.
  static constexpr std::int64_t first_beat_ns = 1'000'000'000;

  [[nodiscard]] Verdict look(const HeartbeatReading& reading) noexcept;
  /// Why the safe state is needed; `none` as long as it is not. Also set if the controller died after it had released
  /// its outputs and before its files were written.
  [[nodiscard]] rig::Reason reason() const noexcept { return reason_; }
  /// Time without a heartbeat up to the last look.
  [[nodiscard]] std::int64_t silence_ns() const noexcept { return silence_ns_; }

 private:
  void measure_silence(const HeartbeatReading& reading) noexcept;
  /// Longest silence at this stage.
  [[nodiscard]] std::int64_t patience_ns(const HeartbeatReading& reading) const noexcept;

  std::int64_t timeout_ns_;
  std::int64_t look_period_ns_;
  std::int64_t making_safe_ns_;
  std::int64_t last_look_ns_{-1};  ///< < 0: not looked yet
  std::uint64_t last_beats_{0};
  std::int64_t silence_ns_{0};
  std::int64_t asked_back_ns_{0};  ///< time since the controller was asked to give the outputs back
  bool died_released_{false};
  rig::Reason reason_{rig::Reason::none};
};

}  // namespace abs_hil::guardian
