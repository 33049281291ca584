#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "abs_hil/rig/scalar.hpp"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

/// Packs of doubles: a scalar of rig/scalar.hpp that computes lane by lane. A pack has several vectors of the machine,
/// because the operations of one wait for each other. Each instruction set has types of its own, so that a program can
/// hold code for several: a source that uses `Pack<Avx512, 2>` is compiled for this set alone.
namespace abs_hil::rig {

/// Vectors of two doubles, which every compiler knows for every machine.
struct Portable {
  using Vector [[gnu::vector_size(16)]] = double;
  using Bits [[gnu::vector_size(16)]] = std::int64_t;
  using Mask = Bits;
  static constexpr std::size_t lanes = 2;

  static Vector all(double x) noexcept { return Vector{x, x}; }
  static Mask less(Vector a, Vector b) noexcept { return a < b; }
  static Mask less_equal(Vector a, Vector b) noexcept { return a <= b; }
  static Mask equal(Vector a, Vector b) noexcept { return a == b; }
  static Mask both(Mask a, Mask b) noexcept { return a & b; }
  static Mask either(Mask a, Mask b) noexcept { return a | b; }
  static Mask neither(Mask a) noexcept { return ~a; }
  static bool any(Mask a) noexcept { return (a[0] | a[1]) != 0; }
  static std::uint32_t bits(Mask a) noexcept {
    return static_cast<std::uint32_t>(a[0] & 1) | static_cast<std::uint32_t>(a[1] & 2);
  }
  static Vector blend(Mask m, Vector a, Vector b) noexcept { return (Vector)((m & (Bits)a) | (~m & (Bits)b)); }
#if defined(__SSE2__)
  // The instructions give their second operand where neither is larger.
  static Vector larger(Vector a, Vector b) noexcept { return _mm_max_pd(b, a); }
  static Vector smaller(Vector a, Vector b) noexcept { return _mm_min_pd(b, a); }
  static Vector root(Vector a) noexcept { return _mm_sqrt_pd(a); }
#else
  static Vector larger(Vector a, Vector b) noexcept { return blend(less(a, b), b, a); }
  static Vector smaller(Vector a, Vector b) noexcept { return blend(less(b, a), b, a); }
  static Vector root(Vector a) noexcept { return Vector{__builtin_sqrt(a[0]), __builtin_sqrt(a[1])}; }
#endif
  /// By the 52 bits of the fraction; for numbers >= 0.
  static Bits shifted_right(Bits a) noexcept { return a >> 52; }
  static Vector floor(Vector a) noexcept { return Vector{__builtin_floor(a[0]), __builtin_floor(a[1])}; }
};

#if defined(__AVX2__)
struct Avx2 {
  using Vector = __m256d;
  using Bits = __m256i;
  using Mask = __m256d;
  static constexpr std::size_t lanes = 4;

  static Vector all(double x) noexcept { return _mm256_set1_pd(x); }
  static Mask less(Vector a, Vector b) noexcept { return _mm256_cmp_pd(a, b, _CMP_LT_OQ); }
  static Mask less_equal(Vector a, Vector b) noexcept { return _mm256_cmp_pd(a, b, _CMP_LE_OQ); }
  static Mask equal(Vector a, Vector b) noexcept { return _mm256_cmp_pd(a, b, _CMP_EQ_OQ); }
  static Mask both(Mask a, Mask b) noexcept { return _mm256_and_pd(a, b); }
  static Mask either(Mask a, Mask b) noexcept { return _mm256_or_pd(a, b); }
  static Mask neither(Mask a) noexcept { return _mm256_xor_pd(a, _mm256_castsi256_pd(_mm256_set1_epi64x(-1))); }
  static bool any(Mask a) noexcept { return _mm256_movemask_pd(a) != 0; }
  static std::uint32_t bits(Mask a) noexcept { return static_cast<std::uint32_t>(_mm256_movemask_pd(a)); }
  static Vector blend(Mask m, Vector a, Vector b) noexcept { return _mm256_blendv_pd(b, a, m); }
  // The instructions give their second operand where neither is larger.
  static Vector larger(Vector a, Vector b) noexcept { return _mm256_max_pd(b, a); }
  static Vector smaller(Vector a, Vector b) noexcept { return _mm256_min_pd(b, a); }
  static Bits shifted_right(Bits a) noexcept { return _mm256_srli_epi64(a, 52); }
  static Vector floor(Vector a) noexcept { return _mm256_floor_pd(a); }
  static Vector root(Vector a) noexcept { return _mm256_sqrt_pd(a); }
};
#endif

#if defined(__AVX512F__) && defined(__AVX512DQ__)
struct Avx512 {
  using Vector = __m512d;
  using Bits = __m512i;
  using Mask = __mmask8;
  static constexpr std::size_t lanes = 8;

  static Vector all(double x) noexcept { return _mm512_set1_pd(x); }
  static Mask less(Vector a, Vector b) noexcept { return _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ); }
  static Mask less_equal(Vector a, Vector b) noexcept { return _mm512_cmp_pd_mask(a, b, _CMP_LE_OQ); }
  static Mask equal(Vector a, Vector b) noexcept { return _mm512_cmp_pd_mask(a, b, _CMP_EQ_OQ); }
  static Mask both(Mask a, Mask b) noexcept { return static_cast<Mask>(a & b); }
  static Mask either(Mask a, Mask b) noexcept { return static_cast<Mask>(a | b); }
  static Mask neither(Mask a) noexcept { return static_cast<Mask>(~a); }
  static bool any(Mask a) noexcept { return a != 0; }
  static std::uint32_t bits(Mask a) noexcept { return a; }
  static Vector blend(Mask m, Vector a, Vector b) noexcept { return _mm512_mask_blend_pd(m, b, a); }
  static Vector larger(Vector a, Vector b) noexcept { return _mm512_maskz_max_pd(0xff, b, a); }
  static Vector smaller(Vector a, Vector b) noexcept { return _mm512_maskz_min_pd(0xff, b, a); }
  static Bits shifted_right(Bits a) noexcept { return _mm512_maskz_srli_epi64(0xff, a, 52); }
  static Vector floor(Vector a) noexcept {
    return _mm512_maskz_roundscale_pd(0xff, a, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
  }
  static Vector root(Vector a) noexcept { return _mm512_maskz_sqrt_pd(0xff, a); }
};
#endif

#define ABS_HIL_LANE_WISE [[gnu::always_inline]] friend inline
/// Returns the pack or mask whose vector i is `vector`.
#define ABS_HIL_EACH(Result, vectors, vector)                        \
  Result r;                                                          \
  for (std::size_t i = 0; i < Vectors; ++i) r.vectors[i] = (vector); \
  return r

/// A condition for each lane.
template <class Isa, std::size_t Vectors>
struct PackMask {
  typename Isa::Mask m[Vectors];

  ABS_HIL_LANE_WISE PackMask operator&&(const PackMask& a, const PackMask& b) noexcept {
    ABS_HIL_EACH(PackMask, m, Isa::both(a.m[i], b.m[i]));
  }
  ABS_HIL_LANE_WISE PackMask operator||(const PackMask& a, const PackMask& b) noexcept {
    ABS_HIL_EACH(PackMask, m, Isa::either(a.m[i], b.m[i]));
  }
  ABS_HIL_LANE_WISE PackMask operator!(const PackMask& a) noexcept { ABS_HIL_EACH(PackMask, m, Isa::neither(a.m[i])); }
  ABS_HIL_LANE_WISE bool any_lane(const PackMask& a) noexcept {
    typename Isa::Mask some = a.m[0];
    for (std::size_t i = 1; i < Vectors; ++i) some = Isa::either(some, a.m[i]);
    return Isa::any(some);
  }
  /// Bit n is lane n.
  ABS_HIL_LANE_WISE std::uint32_t lane_bits(const PackMask& a) noexcept {
    std::uint32_t r = 0;
    for (std::size_t i = 0; i < Vectors; ++i) r |= Isa::bits(a.m[i]) << (i * Isa::lanes);
    return r;
  }
};

template <class Isa, std::size_t Vectors>
struct Pack {
  using Mask = PackMask<Isa, Vectors>;
  using Vector = typename Isa::Vector;
  using Bits = typename Isa::Bits;
  static constexpr std::size_t lanes = Isa::lanes * Vectors;

  Vector v[Vectors];

  Pack() = default;
  // Each constant of a law means all lanes. NOLINTNEXTLINE(google-explicit-constructor)
  [[gnu::always_inline]] Pack(double x) noexcept {
    for (Vector& vector : v) vector = Isa::all(x);
  }

#define ABS_HIL_ARITHMETIC(op)                                                \
  ABS_HIL_LANE_WISE Pack operator op(const Pack& a, const Pack& b) noexcept { \
    ABS_HIL_EACH(Pack, v, a.v[i] op b.v[i]);                                  \
  }                                                                           \
  ABS_HIL_LANE_WISE Pack& operator op##=(Pack& a, const Pack& b) noexcept { return a = a op b; }
  ABS_HIL_ARITHMETIC(+)
  ABS_HIL_ARITHMETIC(-)
  ABS_HIL_ARITHMETIC(*)
  ABS_HIL_ARITHMETIC(/)
#undef ABS_HIL_ARITHMETIC
#define ABS_HIL_COMPARISON(op, call) \
  ABS_HIL_LANE_WISE Mask operator op(const Pack& a, const Pack& b) noexcept { ABS_HIL_EACH(Mask, m, call); }
  ABS_HIL_COMPARISON(<, Isa::less(a.v[i], b.v[i]))
  ABS_HIL_COMPARISON(<=, Isa::less_equal(a.v[i], b.v[i]))
  ABS_HIL_COMPARISON(>, Isa::less(b.v[i], a.v[i]))
  ABS_HIL_COMPARISON(>=, Isa::less_equal(b.v[i], a.v[i]))
  ABS_HIL_COMPARISON(==, Isa::equal(a.v[i], b.v[i]))
  ABS_HIL_COMPARISON(!=, Isa::neither(Isa::equal(a.v[i], b.v[i])))
#undef ABS_HIL_COMPARISON

  ABS_HIL_LANE_WISE Pack operator-(const Pack& a) noexcept {
    ABS_HIL_EACH(Pack, v, (Vector)((Bits)a.v[i] ^ (Bits)Isa::all(-0.0)));
  }
  ABS_HIL_LANE_WISE Pack blend(const Mask& m, const Pack& a, const Pack& b) noexcept {
    ABS_HIL_EACH(Pack, v, Isa::blend(m.m[i], a.v[i], b.v[i]));
  }
  ABS_HIL_LANE_WISE Pack lane_larger(const Pack& a, const Pack& b) noexcept {
    ABS_HIL_EACH(Pack, v, Isa::larger(a.v[i], b.v[i]));
  }
  ABS_HIL_LANE_WISE Pack lane_smaller(const Pack& a, const Pack& b) noexcept {
    ABS_HIL_EACH(Pack, v, Isa::smaller(a.v[i], b.v[i]));
  }
  ABS_HIL_LANE_WISE Pack lane_magnitude(const Pack& a) noexcept {
    ABS_HIL_EACH(Pack, v, (Vector)((Bits)a.v[i] & ~(Bits)Isa::all(-0.0)));
  }
  ABS_HIL_LANE_WISE Pack lane_with_sign(const Pack& a, const Pack& sign) noexcept {
    const Bits bit = (Bits)Isa::all(-0.0);
    ABS_HIL_EACH(Pack, v, (Vector)(((Bits)a.v[i] & ~bit) | ((Bits)sign.v[i] & bit)));
  }
  ABS_HIL_LANE_WISE Pack lane_round_down(const Pack& a) noexcept { ABS_HIL_EACH(Pack, v, Isa::floor(a.v[i])); }
  ABS_HIL_LANE_WISE Pack lane_square_root(const Pack& a) noexcept { ABS_HIL_EACH(Pack, v, Isa::root(a.v[i])); }
  ABS_HIL_LANE_WISE Pack lane_exponent_of(const Pack& a) noexcept {
    const Vector whole = Isa::all(0x1p52);
    ABS_HIL_EACH(Pack, v, ((Vector)(Isa::shifted_right((Bits)a.v[i]) | (Bits)whole) - whole) - Isa::all(1023.0));
  }
  ABS_HIL_LANE_WISE Pack lane_mantissa_of(const Pack& a) noexcept {
    // 0x1p-1022 less its last bit has exactly the bits of the fraction.
    ABS_HIL_EACH(Pack, v, (Vector)(((Bits)a.v[i] & (Bits)Isa::all(0x0.fffffffffffffp-1022)) | (Bits)Isa::all(1.0)));
  }
  ABS_HIL_LANE_WISE Pack lane_power_of_two(const Pack& shifted) noexcept {
    ABS_HIL_EACH(Pack, v, (Vector)(((Bits)shifted.v[i] << 52) + (Bits)Isa::all(1.0)));
  }
};

#undef ABS_HIL_EACH
#undef ABS_HIL_LANE_WISE

// Lanes in memory: a T<Pack> has the words of T<double>, each once for every lane.

/// Writes the `count` words of one run into lane `lane`.
template <class S>
inline void put_lane(void* packed, std::size_t count, std::size_t lane, const double* words) noexcept {
  auto* all = static_cast<unsigned char*>(packed);
  for (std::size_t i = 0; i < count; ++i)
    std::memcpy(all + (i * S::lanes + lane) * sizeof(double), words + i, sizeof(double));
}
template <class S>
inline void take_lane(const void* packed, std::size_t count, std::size_t lane, double* words) noexcept {
  const auto* all = static_cast<const unsigned char*>(packed);
  for (std::size_t i = 0; i < count; ++i)
    std::memcpy(words + i, all + (i * S::lanes + lane) * sizeof(double), sizeof(double));
}
/// The same with the words of a type.
template <class S, class Run>
inline void put_lane(Run& packed, std::size_t lane, const double* words) noexcept {
  put_lane<S>(static_cast<void*>(&packed), sizeof(Run) / sizeof(S), lane, words);
}
template <class S, class Run>
inline void take_lane(const Run& packed, std::size_t lane, double* words) noexcept {
  take_lane<S>(static_cast<const void*>(&packed), sizeof(Run) / sizeof(S), lane, words);
}

}  // namespace abs_hil::rig
