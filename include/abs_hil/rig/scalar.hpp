#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

/// What plant, laws and metrics need of a real number, so that one source computes both a run of its own (`double`) and
/// many runs side by side (a pack, rig/pack.hpp). Each function gives a lane of a pack the bits that it gives a
/// `double`: it consists of operations that IEEE 754 rounds correctly, always in the same order and never contracted.
/// So the elementary functions are polynomials and not those of the C library. All functions are real-time safe.
namespace abs_hil::rig {

/// A pack of doubles. It has the primitives `blend`, `any_lane`, `lane_magnitude` and so on.
template <class S>
concept Lanes = !std::is_same_v<S, double> && requires { typename S::Mask; };

/// `condition ? a : b`, for each lane. Both are computed.
template <class Condition, class S>
[[nodiscard, gnu::always_inline]] constexpr S select(const Condition& condition, const S& a, const S& b) noexcept {
  if constexpr (std::is_same_v<Condition, bool>) {
    return condition ? a : b;
  } else {
    return blend(condition, a, b);
  }
}
/// The same with a constant.
template <class Condition, class S>
  requires(!std::is_same_v<S, double>)
[[nodiscard, gnu::always_inline]] constexpr S select(const Condition& condition, double a, const S& b) noexcept {
  return select(condition, S(a), b);
}
template <class Condition, class S>
  requires(!std::is_same_v<S, double>)
[[nodiscard, gnu::always_inline]] constexpr S select(const Condition& condition, const S& a, double b) noexcept {
  return select(condition, a, S(b));
}

/// True if the condition holds in any lane.
[[nodiscard]] constexpr bool any(bool condition) noexcept { return condition; }
template <class Condition>
  requires(!std::is_same_v<Condition, bool>)
[[nodiscard, gnu::always_inline]] inline bool any(const Condition& condition) noexcept {
  return any_lane(condition);
}

/// std::max and std::min, also for what they do with NaN and zeros.
template <class S>
[[nodiscard, gnu::always_inline]] constexpr S larger(const S& a, const std::type_identity_t<S>& b) noexcept {
  if constexpr (Lanes<S>) {
    return lane_larger(a, b);
  } else {
    return a < b ? b : a;
  }
}
template <class S>
[[nodiscard, gnu::always_inline]] constexpr S smaller(const S& a, const std::type_identity_t<S>& b) noexcept {
  if constexpr (Lanes<S>) {
    return lane_smaller(a, b);
  } else {
    return b < a ? b : a;
  }
}
/// std::clamp.
template <class S>
[[nodiscard, gnu::always_inline]] constexpr S clamped(const S& x, const std::type_identity_t<S>& least,
                                                      const std::type_identity_t<S>& most) noexcept {
  return select(x < least, least, select(most < x, most, x));
}
template <class S>
[[nodiscard, gnu::always_inline]] constexpr auto is_nan(const S& x) noexcept {
  return x != x;
}
template <class S>
[[nodiscard, gnu::always_inline]] constexpr auto is_finite(const S& x) noexcept {
  return x - x == S(0.0);
}

[[nodiscard, gnu::always_inline]] inline double magnitude(double x) noexcept { return std::fabs(x); }
[[nodiscard, gnu::always_inline]] inline double with_sign(double x, double sign) noexcept {
  return std::copysign(x, sign);
}
[[nodiscard, gnu::always_inline]] inline double square_root(double x) noexcept { return std::sqrt(x); }
[[nodiscard, gnu::always_inline]] inline double round_down(double x) noexcept { return std::floor(x); }
/// The whole part of x in [0, 2^31).
[[nodiscard, gnu::always_inline]] constexpr double whole_part(double x) noexcept {
  return static_cast<double>(static_cast<std::int32_t>(x));
}
template <Lanes S>
[[nodiscard, gnu::always_inline]] inline S magnitude(const S& x) noexcept {
  return lane_magnitude(x);
}
template <Lanes S>
[[nodiscard, gnu::always_inline]] inline S with_sign(const S& x, const S& sign) noexcept {
  return lane_with_sign(x, sign);
}
template <Lanes S>
[[nodiscard, gnu::always_inline]] inline S square_root(const S& x) noexcept {
  return lane_square_root(x);
}
template <Lanes S>
[[nodiscard, gnu::always_inline]] inline S round_down(const S& x) noexcept {
  return lane_round_down(x);
}
template <Lanes S>
[[nodiscard, gnu::always_inline]] inline S whole_part(const S& x) noexcept {
  return lane_round_down(x);
}
template <class S>
[[nodiscard, gnu::always_inline]] inline S round_up(const S& x) noexcept {
  return -round_down(S(-x));
}

namespace detail {

/// 2^n for a whole n in [-1022, 1023]. `shifted` is n + 0x1.8p52, which has n in its lowest bits.
[[nodiscard, gnu::always_inline]] inline double power_of_two(double shifted) noexcept {
  const auto n = std::bit_cast<std::uint64_t>(shifted);
  return std::bit_cast<double>((n << 52U) + std::bit_cast<std::uint64_t>(1.0));
}

/// The exponent of x > 0 as a number, and x / 2^exponent in [1, 2).
[[nodiscard, gnu::always_inline]] inline double exponent_of(double x) noexcept {
  constexpr double whole = 0x1p52;  // whose lowest bits hold a whole number
  const std::uint64_t biased = std::bit_cast<std::uint64_t>(x) >> 52U;
  return (std::bit_cast<double>(biased | std::bit_cast<std::uint64_t>(whole)) - whole) - 1023.0;
}
[[nodiscard, gnu::always_inline]] inline double mantissa_of(double x) noexcept {
  constexpr std::uint64_t fraction = (std::uint64_t{1} << 52U) - 1U;
  return std::bit_cast<double>((std::bit_cast<std::uint64_t>(x) & fraction) | std::bit_cast<std::uint64_t>(1.0));
}
template <Lanes S>
[[nodiscard, gnu::always_inline]] inline S exponent_of(const S& x) noexcept {
  return lane_exponent_of(x);
}
template <Lanes S>
[[nodiscard, gnu::always_inline]] inline S mantissa_of(const S& x) noexcept {
  return lane_mantissa_of(x);
}
template <Lanes S>
[[nodiscard, gnu::always_inline]] inline S power_of_two(const S& shifted) noexcept {
  return lane_power_of_two(shifted);
}

/// c[First] + c[First + 1] x + ... with `Count` terms by Estrin's scheme, whose steps depend on each other less than
/// Horner's. `powers` holds x, x^2, x^4, ...
template <std::size_t First, std::size_t Count, class S, std::size_t N, std::size_t M>
[[nodiscard, gnu::always_inline]] constexpr S estrin(const std::array<double, N>& c,
                                                     const std::array<S, M>& powers) noexcept {
  if constexpr (Count == 1) {
    return S(c[First]);
  } else {
    constexpr std::size_t half = std::bit_floor(Count - 1);
    return estrin<First, half>(c, powers) +
           powers[std::countr_zero(half)] * estrin<First + half, Count - half>(c, powers);
  }
}

template <class S, std::size_t N>
[[nodiscard, gnu::always_inline]] constexpr S polynomial(const std::array<double, N>& c, const S& x) noexcept {
  std::array<S, static_cast<std::size_t>(std::bit_width(N - 1))> powers{};
  powers[0] = x;
  for (std::size_t i = 1; i < powers.size(); ++i) powers[i] = powers[i - 1] * powers[i - 1];
  return estrin<0, N>(c, powers);
}

// Each polynomial P was fitted to the rest of its function at the Chebyshev nodes, with 50 digits.
inline constexpr double pi = 0x1.921fb54442d18p+1;
inline constexpr double pi_low = 1.2246467991473532e-16;  ///< the rest of pi
/// sin x = x + x^3 P(x^2) for |x| <= pi/2, within 9e-19 of x.
inline constexpr std::array sine{-0.16666666666666666,   0.008333333333333316,    -0.00019841269841254974,
                                 2.7557319219163234e-06, -2.5052107616996182e-08, 1.6058977312464087e-10,
                                 -7.643970296798572e-13, 2.7314447669863995e-15};
/// atan t = t + t^3 P(t^2) for |t| <= tan(pi/8), within 6e-18 of t.
inline constexpr std::array arctangent{-0.3333333333333333,  0.1999999999999552,   -0.14285714284666542,
                                       0.11111111015256361,  -0.09090904578123903, 0.07692183190826087,
                                       -0.06664511447381948, 0.0585814891280221,   -0.0508544973794026,
                                       0.03923165829558719,  -0.01917688711906226};
/// expm1 r = r + r^2 P(r) for |r| <= ln(2)/2, within 5e-19 of r.
inline constexpr std::array exponential{0.5,
                                        0.1666666666666667,
                                        0.04166666666666667,
                                        0.008333333333326136,
                                        0.0013888888888883748,
                                        0.00019841269874820627,
                                        2.4801587325547743e-05,
                                        2.7557255400206422e-06,
                                        2.75572736431103e-07,
                                        2.5105217004720745e-08,
                                        2.0914686968086876e-09};

/// log m = 2 f + f^3 P(f^2) with f = (m - 1)/(m + 1), for m in [1/sqrt 2, sqrt 2], within 7e-20 of f.
inline constexpr std::array logarithm{0.6666666666666666,  0.4000000000000088,  0.2857142857080323,
                                      0.2222222239180047,  0.18181795630884753, 0.15386240205813478,
                                      0.13268759668560612, 0.13086767009948175};

/// e^x in two parts that add up to it: 2^n, and 2^n expm1(r).
template <class S>
struct Exponential {
  S power;
  S rest;
};
template <class S>
[[nodiscard, gnu::always_inline]] inline Exponential<S> exponential_of(const S& argument) noexcept {
  constexpr double shift = 0x1.8p52;
  constexpr double per_ln2 = 1.4426950408889634;
  constexpr double ln2_high = 0x1.62e42feep-1;
  constexpr double ln2_low = 1.9082149292705877e-10;
  const S x = clamped(argument, S(-700.0), S(700.0));
  const S shifted = x * per_ln2 + shift;
  const S n = shifted - shift;
  const S r = (x - n * ln2_high) - n * ln2_low;
  const S power = power_of_two(shifted);
  return {power, power * (r + r * r * polynomial(exponential, r))};
}

template <class S>
[[nodiscard, gnu::always_inline]] inline S sine_up_to_half_pi(const S& x) noexcept {
  const S square = x * x;
  return x + x * square * polynomial(sine, square);
}

}  // namespace detail

/// sin x for 0 <= x <= pi, within 3 units of the last place.
template <class S>
[[nodiscard, gnu::always_inline]] inline S sine_of_positive(const S& x) noexcept {
  const S reflected = (detail::pi - x) + detail::pi_low;
  return detail::sine_up_to_half_pi(select(x > S(0.5 * detail::pi), reflected, x));
}
/// The same for |x| <= pi.
template <class S>
[[nodiscard, gnu::always_inline]] inline S sine(const S& x) noexcept {
  return with_sign(sine_of_positive(magnitude(x)), x);
}

/// cos x for |x| <= pi, within 2e-16.
template <class S>
[[nodiscard, gnu::always_inline]] inline S cosine(const S& x) noexcept {
  return detail::sine_up_to_half_pi(S((0.5 * detail::pi - magnitude(x)) + 0.5 * detail::pi_low));
}

namespace detail {

/// A ratio as an angle and the tangent of the rest.
template <class S>
struct TurnedRatio {
  S angle;
  S t;  ///< |t| <= tan(pi/8)
};
/// p / q turned by 0, -pi/4 or -pi/2, for p >= 0 and q > 0, with one division: atan(p / q) = angle + atan t.
template <class S>
[[nodiscard, gnu::always_inline]] inline TurnedRatio<S> turned_ratio(const S& p, const S& q) noexcept {
  constexpr double tan_pi_8 = 0.41421356237309503;
  constexpr double tan_3_pi_8 = 2.414213562373095;
  const auto middle = p > q * tan_pi_8;
  const auto steep = p > q * tan_3_pi_8;
  if constexpr (Lanes<S>) {
    return {select(steep, S(0.5 * pi), select(middle, S(0.25 * pi), S(0.0))),
            select(steep, S(-q), select(middle, S(p - q), p)) / select(steep, p, select(middle, S(p + q), q))};
  } else {
    // The processor predicts the branch, so the division does not wait for the comparisons.
    if (steep) return {0.5 * pi, -q / p};
    if (middle) return {0.25 * pi, (p - q) / (p + q)};
    return {0.0, p / q};
  }
}

}  // namespace detail

/// atan(p / q) for p >= 0 and q > 0 with one division, within 2 units of the last place.
template <class S>
[[nodiscard, gnu::always_inline]] inline S arctangent_of_positive(const S& p, const S& q) noexcept {
  const auto [angle, t] = detail::turned_ratio(p, q);
  const S square = t * t;
  return angle + (t + t * square * detail::polynomial(detail::arctangent, square));
}
/// `factor` times that, within 4 units of the last place. The polynomial takes longest, so it is added last.
template <class S>
[[nodiscard, gnu::always_inline]] inline S arctangent_of_positive(const S& p, const S& q, const S& factor) noexcept {
  const auto [angle, t] = detail::turned_ratio(p, q);
  const S square = t * t;
  const S scaled = factor * t;
  return (factor * angle + scaled) + scaled * square * detail::polynomial(detail::arctangent, square);
}
/// The same for p of either sign.
template <class S>
[[nodiscard, gnu::always_inline]] inline S arctangent_of_ratio(const S& p, const S& q) noexcept {
  return with_sign(arctangent_of_positive(magnitude(p), q), p);
}
template <class S>
[[nodiscard, gnu::always_inline]] inline S arctangent(const S& x) noexcept {
  return arctangent_of_ratio(x, S(1.0));
}

/// e^x - 1 for x <= 700, within 2 units of the last place; -1 for x far below 0.
template <class S>
[[nodiscard, gnu::always_inline]] inline S exponential_less_one(const S& x) noexcept {
  const auto e = detail::exponential_of(x);
  return (e.power - 1.0) + e.rest;
}
/// ln x for a normal x > 0, within 2e-16 of max(1, |ln x|).
template <class S>
[[nodiscard, gnu::always_inline]] inline S logarithm(const S& x) noexcept {
  constexpr double root_2 = 1.4142135623730951;
  constexpr double ln2_high = 0x1.62e42feep-1;
  constexpr double ln2_low = 1.9082149292705877e-10;
  const S mantissa = detail::mantissa_of(x);
  const auto upper = mantissa > root_2;
  const S m = select(upper, S(0.5 * mantissa), mantissa);
  const S e = select(upper, S(detail::exponent_of(x) + 1.0), detail::exponent_of(x));
  const S f = (m - 1.0) / (m + 1.0);
  const S square = f * f;
  return e * ln2_high + (e * ln2_low + (2.0 * f + f * square * detail::polynomial(detail::logarithm, square)));
}
/// e^x for -700 <= x <= 700, within 2 units of the last place.
template <class S>
[[nodiscard, gnu::always_inline]] inline S exponential(const S& x) noexcept {
  const auto e = detail::exponential_of(x);
  return e.power + e.rest;
}

/// x^p for x >= 0 and p > 0, within 1e-15 (1 + |p ln x|) of it; 0 where it is far below 1e-300.
template <class S>
[[nodiscard, gnu::always_inline]] inline S power(const S& x, const S& p) noexcept {
  constexpr double least = 1e-300;
  return select(x > least, exponential(S(p * logarithm(larger(x, S(least))))), S(0.0));
}

}  // namespace abs_hil::rig
