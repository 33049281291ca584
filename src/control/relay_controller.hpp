// The rig maker's relay on a slip threshold.
#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/full_torque.hpp"
#include "control/law_controller.hpp"

namespace abs_hil::control {

/// Relay as in the rig maker's demonstration: no torque while the slip is above a threshold, otherwise full torque (as
/// LockedLaw). It has no state and so no hysteresis. theta_est_N is NaN.
template <class S>
class RelayLaw {
 public:
  static constexpr bool estimates_theta = false;

  RelayLaw() = default;
  /// Throws std::invalid_argument for a threshold outside [0, 1).
  explicit RelayLaw(const ControllerContext& context)
    requires std::is_same_v<S, double>;

  void reset(const BasicSlipInput<S>& /*input*/) noexcept {}
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S threshold = rig::select(threshold_ > 0.0, threshold_, input.slip_ref);
    const S full_Nm = full_torque_Nm(brake_, input.max_brake_torque_Nm);
    return {.brake_torque_Nm = rig::select(input.slip > threshold, S(0.0), full_Nm),
            .slip_velocity_error_m_s = slip_velocity_error_m_s(laws_, input.speeds, input.slip_ref),
            .theta_est_N = rig::unknown};
  }
  void take_over(const RelayLaw& /*before*/) noexcept {}

 private:
  paper::Laws<S> laws_{};
  rig::BasicBrake<S> brake_{};
  S threshold_{0.0};
};

class RelayController final : public LawController<RelayLaw> {
 public:
  using LawController::LawController;
};

}  // namespace abs_hil::control
