#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

#include "guardian/shared_region.hpp"
#include "runtime/cycle_watch.hpp"

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
  [[nodiscard]] virtual Pages& pages() noexcept = 0;
  /// What the guardian could not obtain (real time), as text; empty if it lacks nothing.
  [[nodiscard]] const std::string& notes() const noexcept { return notes_; }

  void making_safe() noexcept final;
  void outputs_released(bool safe) noexcept final;

 protected:
  /// Throws driver::Unavailable if the guardian would be scheduled after the controller, or swapped out before it.
  static void refuse_weaker(const runtime::Scheduling& guardian, const runtime::Scheduling& controller,
                            const std::string& program);
  /// Before a guard takes up its watch: no beats yet, and the outputs may be driven once it has.
  void reset_page() noexcept;
  /// Says that the run is done, unless the outputs were handed over. Returns true if they were.
  bool close_page(Stage stage) noexcept;

  std::string notes_{};
};

/// "guardian: WHAT. The run does not start ..." as driver::Unavailable.
[[noreturn]] void refuse_run(const std::string& what);

}  // namespace abs_hil::guardian
