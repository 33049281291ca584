// The curves of FrictionBank, phi(s) = sin(C atan(s / knee)) of (4) over the slip s: numbers, value and slope. Numbers
// that a solver or the C library gave stand here as such: their rounding depends on the platform, and every platform
// computes the same bits.
#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::control::friction_curves {

inline constexpr std::size_t peaks = 8;   ///< different slips of the peak
inline constexpr std::size_t shapes = 3;  ///< different shape factors C
inline constexpr std::size_t terms = 10;

template <class S>
[[nodiscard, gnu::always_inline]] constexpr S square(const S& x) noexcept {
  return x * x;
}

/// A number for each peak, in whole vectors of any machine.
struct alignas(64) OfPeaks : std::array<double, peaks> {};

/// Slips of the peak in a geometric row, 0.02 12.5^(j / 7). The plants have 0.03 to 0.25.
inline constexpr OfPeaks peak{{0x1.47ae147ae147bp-6, 0x1.d60ed332dc69bp-6, 0x1.512653e35d90ep-5, 0x1.e3a46a533e111p-5,
                               0x1.5ae4a268047ap-4, 0x1.f19e816b430a5p-4, 0x1.64eb0658ab2dfp-3, 0.25}};
/// C in an even row. The plants have 1.27 to 1.9.
inline constexpr std::array<double, shapes> shape{1.15, 1.525, 1.9};
/// tan(pi / (2 C)): the slip of the peak over the knee.
inline constexpr std::array<double, shapes> peak_over_knee{0x1.33fc22fa97c4ep+2, 0x1.aa54f13d10739p+0,
                                                           0x1.161712d7187f5p+0};

/// For each C the coefficients of the polynomial in u = B s / (1 + B s) that meets sin(C atan(B s)) / u at the
/// Chebyshev nodes of (0, 1).
inline constexpr std::array<std::array<double, terms>, shapes> curves{
    {{0x1.266ccf142c2cbp+0, 0x1.216f5725c5018p+0, 0x1.204329cf3fc6dp+0, -0x1.fdee1083627cp+2, 0x1.3477b71ff3cd3p+5,
      -0x1.f1c11634415f9p+6, 0x1.7fb3a7b1bc924p+7, -0x1.23170ca85a028p+7, 0x1.980a58609c7dcp+5, -0x1.796fac91ff7fbp+2},
     {0x1.867653c51eb33p+0, 0x1.7a0a1d8dc779ep+0, 0x1.f714160d4583dp+0, -0x1.4349359013b5p+4, 0x1.9cb2f0fdf044p+6,
      -0x1.54d4d85d30d4cp+8, 0x1.205d725e2fd6bp+9, -0x1.fe061f658e3efp+8, 0x1.c6451b596b1cdp+7, -0x1.42235fd0c3f34p+5},
     {0x1.e687537b974ecp+0, 0x1.ccd046493bb27p+0, 0x1.aa8ba6554ba69p+1, -0x1.52d38b75ba953p+5, 0x1.c07c56891cc48p+7,
      -0x1.79462da21ea11p+9, 0x1.50532cbdd5c16p+10, -0x1.3fbac82564e1bp+10, 0x1.36d1ca7a234ddp+9,
      -0x1.e8f3987e65308p+6}}};

/// What follows for each curve: its knee 1/B, -phi'' at its peak, and the coefficients of the slope over u.
struct Derived {
  std::array<OfPeaks, shapes> knee{};
  std::array<OfPeaks, shapes> bent{};
  std::array<std::array<double, terms>, shapes> slope{};
};
inline constexpr Derived derived = [] {
  Derived d;
  for (std::size_t k = 0; k < shapes; ++k) {
    const double at_peak = peak_over_knee[k];
    const double curvature = square(shape[k] * at_peak / (1.0 + square(at_peak)));  // slip in units of the peak's
    for (std::size_t j = 0; j < peaks; ++j) {
      d.knee[k][j] = peak[j] / at_peak;
      d.bent[k][j] = curvature / square(peak[j]);
    }
    for (std::size_t i = 0; i < terms; ++i) d.slope[k][i] = static_cast<double>(i + 1) * curves[k][i];
  }
  return d;
}();

template <class Row>
[[nodiscard, gnu::always_inline]] inline Row horner(const std::array<double, terms>& c, const Row& x) noexcept {
  Row sum = c.back();
  for (std::size_t i = c.size() - 1; i-- > 0;) sum = sum * x + c[i];
  return sum;
}

/// phi at the slip, of curves of the k-th shape with these knees.
template <class Row>
[[nodiscard, gnu::always_inline]] inline Row value(std::size_t k, const Row& knee, const Row& slip) noexcept {
  const Row size = rig::magnitude(slip);
  const Row u = size / (knee + size);
  return rig::with_sign(u * horner(curves[k], u), slip);
}

/// Its slope over the slip.
template <class Row>
[[nodiscard, gnu::always_inline]] inline Row slope(std::size_t k, const Row& knee, const Row& slip) noexcept {
  const Row size = rig::magnitude(slip);
  const Row share = 1.0 / (knee + size);
  return horner(derived.slope[k], size * share) * knee * share * share;
}

}  // namespace abs_hil::control::friction_curves
