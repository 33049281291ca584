#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "abs_hil/rig/parameters.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::rig {

/// The tyre's curve without its height.
template <class S>
struct TyreShape {
  S B{0.0}, C{0.0};

  TyreShape() = default;
  explicit TyreShape(const TyreParameters& tyre) noexcept : B(tyre.B), C(tyre.C) {}
};

/// sin(C atan(p / q)) for q > 0 with one division, C <= 2. Real-time safe.
template <class S>
[[nodiscard, gnu::always_inline]] inline S magic_formula(const S& C, const S& p, const S& q) noexcept {
  return with_sign(sine_of_positive(arctangent_of_positive(magnitude(p), q, C)), p);
}

/// Normalised tyre characteristic phi(slip) = sin(C atan(B slip)) of (10). It is odd in slip, so that the force has the
/// right sign in traction, too. The factor s(omega) printed in (1) would reverse that sign (docs/theory.md). C <= 2.
/// Real-time safe.
template <class Tyre, class S>
[[nodiscard]] inline S normalised_tyre_force(const Tyre& tyre, const S& slip) noexcept {
  return magic_formula(S(tyre.C), S(tyre.B * slip), S(1.0));
}

/// d phi / d slip of (10). Real-time safe.
template <class Tyre, class S>
[[nodiscard]] inline S normalised_tyre_force_slope(const Tyre& tyre, const S& slip) noexcept {
  const S stretched = tyre.B * slip;
  return tyre.B * tyre.C * cosine(S(tyre.C * arctangent(stretched))) / (1.0 + stretched * stretched);
}

/// Slip at which phi reaches its peak of 1: tan(pi / 2C) / B. For C <= 1 phi has no interior peak, and the result is 1
/// (a locked wheel).
[[nodiscard]] inline double peak_slip(const TyreParameters& tyre) noexcept {
  return tyre.C > 1.0 ? std::min(1.0, std::tan(std::numbers::pi / (2.0 * tyre.C)) / tyre.B) : 1.0;
}

/// Wheel slip (5), (v_x - v_w) / v_x, from the wheels' circumferential speeds. The quotient is undefined at v_x = 0.
/// Below `regularisation_m_s` (> 0) the denominator therefore keeps that value: the slip stays finite, and is 0 when
/// both wheels stand still. Real-time safe.
template <class S>
[[nodiscard]] inline S wheel_slip(const S& v_wheel_m_s, const S& v_x_m_s,
                                  const std::type_identity_t<S>& regularisation_m_s) noexcept {
  return (v_x_m_s - v_wheel_m_s) / larger(magnitude(v_x_m_s), regularisation_m_s);
}

}  // namespace abs_hil::rig
