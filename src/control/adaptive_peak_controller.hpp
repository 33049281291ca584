#pragma once

#include "abs_hil/control/slip_error_dynamics.hpp"
#include "control/slip_error_integral.hpp"
#include "control/slip_peak_estimator.hpp"
#include "control/wheel_force_observer.hpp"
#include "control/wheel_motion.hpp"

namespace abs_hil::control {

/// Brakes at the slip of the largest tyre force. It needs neither theta, B and C nor a slip reference
/// (docs/theory-beyond.md). WheelForceObserver estimates speeds and tyre force from encoders and brake.
/// SlipPeakEstimator estimates the peak from slip and force. The slip loop follows this peak plus a small sinusoidal
/// search. The loop is (16) with the observed force in place of theta phi. It compensates the brake's lag as
/// AdaptiveActuatorController does. It does not use `rig.tyre`. theta_est_N is the estimated peak force, and slip_ref
/// is the controller's own reference.
class AdaptivePeakController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit AdaptivePeakController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;

 private:
  /// The slip reference now, and its rate.
  struct Reference {
    double slip;
    double rate_per_s;
  };

  void learn(double dt_s, double slip) noexcept;
  [[nodiscard]] Reference next_reference(double dt_s) noexcept;
  [[nodiscard]] double command_Nm(const SlipInput& input, double slip, const Reference& reference,
                                  double error_m_s) const noexcept;

  AdaptivePeakOptions options_;
  rig::WheelParameters wheels_;
  BrakeLag lag_;
  double v_min_m_s_;
  double period_s_;
  WheelForceObserver observer_;
  SlipPeakEstimator peak_;
  SlipErrorIntegral integral_;
  double centre_{0.0};  ///< of the search
  double time_s_{0.0};  ///< since the start of braking
  /// Slip after two equal lags. Together they delay it as long as the force estimate is delayed.
  double half_late_slip_{0.0};
  double late_slip_{0.0};
};

}  // namespace abs_hil::control
