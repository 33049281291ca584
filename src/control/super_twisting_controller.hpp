#pragma once

#include "control/sliding_surface.hpp"

namespace abs_hil::control {

/// One period of the super-twisting algorithm e' = -k1 sqrt|e| sign(e) + z, z' = -k2 sign(e).
struct SuperTwistingStep {
  double root_rate_m_s2{0.0};  ///< -k1 sqrt|e| sign(e), mean over the period
  double integral_m_s2{0.0};   ///< z for the period
  double sign{0.0};            ///< substitute for sign(e), in [-1, 1]
};

/// Semi-implicit step. sqrt|e| is taken at the period's end, where e+ = e - h k1 sqrt|e+| sign(e+). The sign is
/// sat(e/(h^2 k2)), so that the change of z never takes e beyond 0. The step is continuous in e and z. Close to 0 it
/// becomes the deadbeat pair u = z - 2 e/h, z+ = z - e/h. This ends the chatter at any rate and leaves e = O(h^2) under
/// a perturbation of bounded slope (docs/theory-baselines.md). Real-time safe.
[[nodiscard]] SuperTwistingStep super_twisting_step(double error_m_s, double integral_m_s2, double k1, double k2,
                                                    double period_s) noexcept;

/// Super-twisting slip control: the equivalent control of SlidingModeController, but with the continuous
///   -k1 sqrt|e_v| sign(e_v) + z,  z' = -k2 sign(e_v)
/// in place of -K sign(e_v). The law overcomes a model error rho with |rho'| <= L in finite time if k2 > L and
/// k1 > sqrt(k2 + L). z is held while the reference torque is outside the actuator's range and z would drive it further
/// out.
class SuperTwistingController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit SuperTwistingController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  BasicSlidingSurface<double> surface_;
  double k1_;
  double k2_;
  double integral_m_s2_{0.0};
};

}  // namespace abs_hil::control
