#pragma once

#include "abs_hil/control/sliding_surface.hpp"

namespace abs_hil::control {

/// One period of the super-twisting algorithm e' = -k1 sqrt|e| sign(e) + z, z' = -k2 sign(e).
struct SuperTwistingStep {
  double error_m_s{0.0};      ///< e at the end of the period
  double integral_m_s2{0.0};  ///< z at the end of the period
  double sign{0.0};           ///< the value of the set-valued sign(e) taken, in [-1, 1]
};

/// Backward Euler step, with e, z and the set-valued sign at the period's end: does not chatter at any rate, reaches
/// (0, 0) exactly and is continuous in (e, z) (docs/theory-rivals.md). Real-time safe.
[[nodiscard]] SuperTwistingStep super_twisting_step(double error_m_s, double integral_m_s2, double k1, double k2,
                                                    double period_s) noexcept;

/// Super-twisting slip control: the equivalent control of SlidingModeController, but with the continuous
///   -k1 sqrt|e_v| sign(e_v) + z,  z' = -k2 sign(e_v)
/// in the place of -K sign(e_v). A mismatch rho of the model with |rho'| <= L is overcome in finite time if k2 > L and
/// k1 > sqrt(k2 + L). z stands while the torque asked for lies outside what the actuator can give and z would drive it
/// further out.
class SuperTwistingController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit SuperTwistingController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override;
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;

 private:
  SlidingSurface surface_;
  double k1_;
  double k2_;
  double integral_m_s2_{0.0};
};

}  // namespace abs_hil::control
