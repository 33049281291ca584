#pragma once

#include <cstdint>

#include "abs_hil/rig/reason.hpp"
#include "guardian/shared_region.hpp"

namespace abs_hil::guardian {

/// What the guardian sees when it looks.
struct HeartbeatReading {
  std::int64_t now_ns{0};        ///< its own clock
  std::uint64_t cycle_beats{0};  ///< signs of life of the cycle's thread; 0: no cycle has begun yet
  Stage stage{Stage::guarded};   ///< read before `controller_gone`
  bool controller_gone{false};   ///< the process has ended, all its threads
};

/// What to do about it.
enum class Verdict : std::uint8_t {
  wait,       ///< all is well
  make_safe,  ///< bring the outputs into the safe state; the reason is known
  dismissed   ///< the run is over and its outputs are safe
};

/// Decides from what the guardian sees. A sign of life is a change of the count of cycles; the time without one is that
/// which the guardian itself has watched: where it was held up, with the whole computer perhaps, it blames nobody for
/// more than two of its looks. The first reason stays.
class Watchdog {
 public:
  /// @param timeout_ns  without a sign of life, > 0
  /// @param look_period_ns  between two looks, > 0; the verdict comes at most one of them after the timeout
  /// @param making_safe_ns  how much more silence is due to a controller that waits for its board's word that it is
  ///                        safe, >= 0
  Watchdog(std::int64_t timeout_ns, std::int64_t look_period_ns, std::int64_t making_safe_ns = 0) noexcept
      : timeout_ns_(timeout_ns), look_period_ns_(look_period_ns), making_safe_ns_(making_safe_ns) {}

  [[nodiscard]] Verdict look(const HeartbeatReading& sight) noexcept;
  /// Why the safe state is needed; `none` while it is not. Also set when the controller died after it had released its
  /// outputs and before its files were written.
  [[nodiscard]] rig::Reason reason() const noexcept { return reason_; }
  /// Time without a sign of life up to the last look.
  [[nodiscard]] std::int64_t silence_ns() const noexcept { return silence_ns_; }
  /// Whether the controller may still write, and must be ended first.
  [[nodiscard]] bool must_end_controller() const noexcept { return reason_ == rig::Reason::controller_silent; }

 private:
  void listen(const HeartbeatReading& sight) noexcept;

  std::int64_t timeout_ns_;
  std::int64_t look_period_ns_;
  std::int64_t making_safe_ns_;
  std::int64_t last_look_ns_{0};
  std::uint64_t last_beats_{0};
  std::int64_t silence_ns_{0};
  rig::Reason reason_{rig::Reason::none};
};

}  // namespace abs_hil::guardian
