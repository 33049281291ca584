#pragma once

#include "control/sliding_surface.hpp"

namespace abs_hil::control {

/// Sliding-mode slip control, the type of the paper's own baseline:
///   Tb = (J1/r1) xi_1 of (18), with nu = -K sign(e_v) in place of -ks0 I - ks1 e_v,
///   theta_hat' = -gamma k(slip_ref) phi(slip) sign(e_v), projected.
/// The law and the gains of the paper's baseline are not public. This is the textbook law for the error (13), not a
/// copy. The sign is held for a period, so e_v chatters around 0 with an amplitude of about K times the period. The
/// chatter belongs to the law.
class SlidingModeController final : public SlipController {
 public:
  /// Throws std::invalid_argument for options out of range.
  explicit SlidingModeController(const ControllerContext& context);

  void reset(const SlipInput& input) noexcept override { surface_.reset(input); }
  [[nodiscard]] SlipOutput step(const SlipInput& input) noexcept override;
  [[nodiscard]] bool take_over(const SlipController& before) noexcept override;

 private:
  SlidingSurface surface_;
  double gain_m_s2_;
};

}  // namespace abs_hil::control
