// Braking without ABS: full torque throughout.
#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/full_torque.hpp"
#include "control/law_controller.hpp"

namespace abs_hil::control {

/// Full brake torque at any slip: braking without ABS, the reference for the slip controllers. The torque is the
/// actuator's largest, or b(1) of (7) if the actuator has no limit. theta_est_N is NaN.
template <class S>
class LockedLaw {
 public:
  static constexpr bool estimates_theta = false;

  LockedLaw() = default;
  explicit LockedLaw(const ControllerContext& context) noexcept
    requires std::is_same_v<S, double>
      : laws_{paper::laws(context.rig.wheels)}, brake_{context.rig.brake} {}

  void reset(const BasicSlipInput<S>& /*input*/) noexcept {}
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    return {.brake_torque_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm),
            .slip_velocity_error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref),
            .theta_est_N = rig::unknown};
  }
  void take_over(const LockedLaw& /*before*/) noexcept {}

 private:
  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
};

class LockedController final : public LawController<LockedLaw> {
 public:
  using LawController::LawController;
};

}  // namespace abs_hil::control
