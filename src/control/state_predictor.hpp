// The wheels' state when a torque that is sent now begins to act: what the torques on their way lead to.
//
// Smith (1957) and Artstein (1982): behind a dead time Td the law for the plant without it is fed with the state at
// t + Td, which follows from the state now and from the torques sent in the last Td. For each part g of Td, in which
// the static torque b acts:
//
//   Tm    = b + (Tb - b) (1 - e^(-c31 g)) / (c31 g),  Tb <- b + (Tb - b) e^(-c31 g)       mean and end of (6)
//   e'    = -k(l) F(l) - delta(l) + (r1/J1) (Tm + D)           (14) with the slip l for lambda_ref, so that l' = e'/v
//   l    <- l + g (e^x - 1)/x e'/v,  x = -k(l) F'(l) g/v       the exact step of l' linearised at l
//   w2   <- w2 + g (-r2 F - d2 w2 - M20)/J2,  w1 = (1 - l) v/r1,  v = r2 w2
//
// l: slip, F: force of the law's own curve, N, F': its slope over the slip, D: error of the brake's model, N m.
// Euler's step would overshoot where |x| is large: on a steep tyre at low speed x is -3 in 3 ms.
#pragma once

#include "abs_hil/control/paper_laws.hpp"
#include "abs_hil/control/slip_controller.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control {

/// How fast a law may be that acts on the predicted state. If the model's Td is wrong by d, the error returns through
/// |g / (jw + g)| |e^(-jw d) - 1| <= g d, so that a gain g stays stable while g d < 1 (small gain; Palmor 1980). With a
/// Td that is wrong by 30 % the slip's gain uses a third of that and the torque's, which is inside it, four fifths.
/// These two shares were chosen on the shipped plants at 24 and 27 ms, not derived.
struct PredictedGains {
  double slip_most_per_s;
  double torque_most_per_s;
};
[[nodiscard]] constexpr PredictedGains predicted_gains(double dead_time_s) noexcept {
  const double wrong_s = 0.3 * dead_time_s;
  return {.slip_most_per_s = 1.0 / (3.0 * wrong_s), .torque_most_per_s = 0.8 / wrong_s};
}

/// Force of a curve at a slip.
template <class S>
struct CurvePoint {
  S N{0.0};
  S slope_N{0.0};  ///< over the slip
};

/// What a law acts on.
template <class S>
struct ActingState {
  rig::BasicWheelSpeeds<S> speeds{};
  S brake_torque_Nm{0.0};
};

/// The prediction by the equations above. Real-time safe.
template <class S>
class BasicStatePredictor {
 public:
  BasicStatePredictor() = default;
  /// @param v_min_m_s  the slip divides by at least this speed, > 0
  BasicStatePredictor(const rig::RigParameters& rig, double v_min_m_s) noexcept
      : laws_{paper::laws(rig.wheels)}, c31_per_s_{rig.brake.c31_per_s}, v_min_m_s_{v_min_m_s} {}

  /// The state at the end of `ahead`, from the one now; without dead time that one itself.
  /// @param brake_error_Nm  D
  /// @param curve  called as curve(slip), gives a CurvePoint
  template <class Curve>
  [[nodiscard]] ActingState<S> operator()(const BasicBrakeAhead<S>& ahead, ActingState<S> now, const S& brake_error_Nm,
                                          const Curve& curve) const noexcept {
    for (const S& b : ahead.torques_Nm) advance(b, S(ahead.part_s), brake_error_Nm, curve, now);
    return now;
  }

 private:
  template <class Curve>
  void advance(const S& static_Nm, const S& time_s, const S& brake_error_Nm, const Curve& curve,
               ActingState<S>& x) const noexcept {
    constexpr double small = 1e-6;  // the quotient of two numbers below it loses its digits
    const auto& w = laws_;
    const S covered = -rig::exponential_less_one(S(-c31_per_s_ * time_s));
    const S change_Nm = (static_Nm - x.brake_torque_Nm) * covered;
    const S mean_Nm = static_Nm - change_Nm / (c31_per_s_ * time_s);
    x.brake_torque_Nm += change_Nm;

    S& omega2 = x.speeds.omega2_rad_s;
    const S v = rig::larger(S(w.r2 * omega2), v_min_m_s_);
    const S slip = 1.0 - w.r1 * x.speeds.omega1_rad_s / v;
    const CurvePoint<S> here = curve(slip);
    const paper::Reading<S> y{.omega1 = x.speeds.omega1_rad_s, .omega2 = omega2, .lambda_ref = slip, .phi = S(1.0)};
    const S rate_m_s2 = w.e_v_dot(y, here.N, S(mean_Nm + brake_error_Nm));
    const S exponent = -w.k(y) * here.slope_N * time_s / v;
    const auto straight = rig::magnitude(exponent) < small;
    const S grown = rig::select(straight, S(1.0), S(rig::exponential_less_one(exponent) / exponent));
    const S slip_after = rig::clamped(S(slip + time_s * grown * rate_m_s2 / v), S(-1.0), S(1.0));
    omega2 = rig::larger(S(0.0), S(omega2 - time_s * (w.r2 * here.N + w.d2 * omega2 + w.M20) / w.J2));
    x.speeds.omega1_rad_s = (1.0 - slip_after) * rig::larger(S(w.r2 * omega2), v_min_m_s_) / w.r1;
  }

  paper::Laws<S> laws_{};
  S c31_per_s_{0.0};
  S v_min_m_s_{0.0};
};

}  // namespace abs_hil::control
