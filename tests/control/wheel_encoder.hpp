#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace bench {

/// A wheel's encoder for the tests: floor of the angle in counts, wrapping at 32 bits like the board's counter.
inline std::int32_t encoder_reading(double angle_rad, std::int32_t counts_per_rev, std::int64_t offset = 0) {
  const auto counts = static_cast<std::int64_t>(std::floor(angle_rad / (2 * std::numbers::pi) * counts_per_rev));
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(counts + offset));
}

/// So fine that quantisation has no effect.
inline constexpr std::int32_t fine_counts_per_rev = 1 << 24;

}  // namespace bench
