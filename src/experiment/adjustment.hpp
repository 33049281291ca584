#pragma once

#include <cstdint>
#include <memory>

#include "abs_hil/control/slip_controller.hpp"
#include "runtime/spsc_ring.hpp"

namespace abs_hil::experiment {

/// A change to a running run.
struct Adjustment {
  enum class Kind : std::uint8_t { start, slip_ref, controller, answer };
  Kind kind{Kind::start};
  double slip_ref{0.0};
  /// The same control law with other gains, constructed in advance; it takes over the state of the old one.
  std::unique_ptr<control::SlipController> controller{};
};

/// Hands adjustments from one slow thread to the real-time thread, and replaced controllers back. Neither thread waits
/// for the other, and only the slow thread allocates and frees memory.
class AdjustmentMailbox {
 public:
  ~AdjustmentMailbox() {
    Arrived waiting{};
    while (inbox_.pop(waiting)) delete waiting.controller;
    free_retired();
  }

  /// Slow thread. Returns the number of the change, from 1 on; 0 if too many changes wait.
  [[nodiscard]] std::uint32_t put(Adjustment adjustment) {
    free_retired();
    if (!inbox_.push({adjustment.kind, last_number_ + 1, adjustment.slip_ref, adjustment.controller.get()})) return 0;
    static_cast<void>(adjustment.controller.release());
    return ++last_number_;
  }

  /// A change as the real-time thread receives it.
  struct Arrived {
    Adjustment::Kind kind;
    std::uint32_t number;
    double slip_ref;
    control::SlipController* controller;  ///< the taker owns it
  };
  /// Real-time thread. Returns false if nothing waits.
  [[nodiscard]] bool take(Arrived& arrived) noexcept { return inbox_.pop(arrived); }
  /// Real-time thread. Returns a replaced controller to the slow thread.
  void retire(control::SlipController* controller) noexcept { static_cast<void>(retired_.push(controller)); }

 private:
  void free_retired() {
    control::SlipController* controller = nullptr;
    while (retired_.pop(controller)) delete controller;
  }

  static constexpr std::size_t most_waiting = 16;
  runtime::SpscRing<Arrived> inbox_{most_waiting};
  /// Room for all controllers that can be under way, so that none is lost.
  runtime::SpscRing<control::SlipController*> retired_{2 * most_waiting};
  std::uint32_t last_number_{0};
};

}  // namespace abs_hil::experiment
