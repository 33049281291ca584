#pragma once

#include <cstdint>
#include <memory>

#include "abs_hil/control/slip_controller.hpp"
#include "runtime/spsc_ring.hpp"

namespace abs_hil::experiment {

/// A change to a run that goes on.
struct Adjustment {
  enum class Kind : std::uint8_t { start, slip_ref, controller };
  Kind kind{Kind::start};
  double slip_ref{0.0};
  /// The same law as before with other gains, ready made; it takes over where the old one stands.
  std::unique_ptr<control::SlipController> controller{};
};

/// Hands adjustments from one slow thread to the real-time thread, and controllers that have served their time back, so
/// that neither waits and only the slow thread allocates and frees.
class AdjustmentMailbox {
 public:
  AdjustmentMailbox() = default;
  AdjustmentMailbox(const AdjustmentMailbox&) = delete;
  AdjustmentMailbox& operator=(const AdjustmentMailbox&) = delete;
  ~AdjustmentMailbox();

  /// Slow thread. The number that the change will bear, from 1 on; 0 if too many wait.
  [[nodiscard]] std::uint32_t put(Adjustment adjustment);

  /// What arrives in the real-time thread.
  struct Arrived {
    Adjustment::Kind kind;
    std::uint32_t number;
    double slip_ref;
    control::SlipController* controller;  ///< owned by who takes it
  };
  /// Real-time thread. False if nothing waits.
  [[nodiscard]] bool take(Arrived& arrived) noexcept { return inbox_.pop(arrived); }
  /// Real-time thread: gives a controller back.
  void retire(control::SlipController* controller) noexcept { static_cast<void>(retired_.push(controller)); }

 private:
  void free_retired();

  static constexpr std::size_t most_waiting = 16;
  runtime::SpscRing<Arrived> inbox_{most_waiting};
  /// Room for all that may be under way, so that none is lost.
  runtime::SpscRing<control::SlipController*> retired_{2 * most_waiting};
  std::uint32_t last_number_{0};
};

}  // namespace abs_hil::experiment
