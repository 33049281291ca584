#pragma once

#include <cstdint>

#include "abs_hil/control/controller_context.hpp"
#include "abs_hil/control/slip_controller.hpp"

namespace abs_hil::control {

/// State of the cycle of FivePhaseController.
enum class BrakePhase : std::uint8_t {
  apply,    ///< first application: the torque rises fast
  hold,     ///< the wheel decelerates more than a car can: the torque is held
  release,  ///< it decelerates even more: the torque falls
  recover,  ///< the wheel accelerates: the torque is held until it has recovered
  reapply,  ///< the torque rises slowly until the next instability
};

/// Anti-lock logic on thresholds of the braked wheel's acceleration a = r1 omega1', as in production systems (the cycle
/// of the Bosch Automotive Handbook; five-phase algorithms after Pasillas-Lepine, 2006). It measures no slip:
/// apply -> hold (a < hold_below) -> release (a < release_below) -> recover (a > recover_above) -> re-apply (a, once
/// above reapply_below, < reapply_below) -> hold ... From hold it re-applies when a is back above hold_below, or
/// after hold_limit_s without a transition. A standing wheel counts as one that decelerates without bound, because
/// nothing else distinguishes a locked wheel from a free one here. The controller reads alpha1, omega1 and the torque's
/// limit only. It reports the slip velocity error for the record. theta_est_N is NaN.
class FivePhaseController final : public SlipController {
 public:
  /// Throws std::invalid_argument if thresholds are out of order or a ramp or limit is not > 0.
  explicit FivePhaseController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

  [[nodiscard]] BrakePhase phase() const noexcept { return phase_; }

 private:
  [[nodiscard]] BrakePhase next_phase(double acceleration_m_s2) const noexcept;
  [[nodiscard]] double ramp_Nm_s() const noexcept;

  rig::WheelParameters wheels_;
  rig::BrakeParameters brake_;
  FivePhaseOptions options_;
  double period_s_;
  BrakePhase phase_{BrakePhase::apply};
  double in_phase_s_{0.0};
  double at_zero_s_{0.0};    ///< since the torque reached 0 in `release`
  bool accelerated_{false};  ///< in `recover`: the acceleration has been above reapply_below
  double torque_Nm_{0.0};
};

}  // namespace abs_hil::control
