// The textbook sliding mode, with the sign of e_v.
#pragma once

#include "control/law_controller.hpp"
#include "control/sliding_surface.hpp"

namespace abs_hil::control {

/// Sliding-mode slip control, the type of the paper's own baseline:
///   Tb = (J1/r1) xi_1 of (18), with nu = -K sign(e_v) in place of -ks0 I - ks1 e_v,
///   theta_hat' = -gamma k(slip_ref) phi(slip) sign(e_v), projected.
/// The law and the gains of the paper's baseline are not public. This is the textbook law for the error (13), not a
/// copy. The sign is held for a period, so e_v chatters around 0 with an amplitude of about K times the period. The
/// chatter belongs to the law.
template <class S>
class SlidingModeLaw {
 public:
  static constexpr bool estimates_theta = true;

  SlidingModeLaw() = default;
  /// Throws std::invalid_argument for options out of range.
  explicit SlidingModeLaw(const ControllerContext& context)
    requires std::is_same_v<S, double>;

  void reset(const BasicSlipInput<S>& input) noexcept { surface_.reset(input); }
  [[nodiscard]] BasicSlipOutput<S> step(const BasicSlipInput<S>& input) noexcept {
    const S error_m_s = surface_.observe(input);
    const S sign = rig::select(error_m_s > 0.0, S(1.0), rig::select(error_m_s < 0.0, S(-1.0), S(0.0)));
    const S rate_m_s2 = -gain_m_s2_ * sign;
    const BasicWantedMotion<S> wanted{.mean_rate_m_s2 = rate_m_s2,
                                      .error_at_mid_m_s = error_m_s + 0.5 * surface_.period_s() * rate_m_s2};
    return surface_.drive(input, error_m_s, wanted, sign);
  }
  void take_over(const SlidingModeLaw& before) noexcept { surface_.take_over(before.surface_); }

 private:
  BasicSlidingSurface<S> surface_{};
  S gain_m_s2_{0.0};
};

class SlidingModeController final : public LawController<SlidingModeLaw> {
 public:
  using LawController::LawController;
};

}  // namespace abs_hil::control
