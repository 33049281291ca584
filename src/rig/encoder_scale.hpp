#pragma once

#include <bit>
#include <cstdint>
#include <numbers>

namespace abs_hil::rig {

/// Angle of one count, rad. `counts_per_rev` > 0.
[[nodiscard]] constexpr double radians_per_count(std::int32_t counts_per_rev) noexcept {
  return 2.0 * std::numbers::pi / static_cast<double>(counts_per_rev);
}

/// Counts travelled between two readings. Correct across the counter's wrap-around if the true travel is less than 2^31
/// counts. Real-time safe.
[[nodiscard]] constexpr std::int32_t counts_between(std::int32_t before, std::int32_t after) noexcept {
  return std::bit_cast<std::int32_t>(std::bit_cast<std::uint32_t>(after) - std::bit_cast<std::uint32_t>(before));
}

}  // namespace abs_hil::rig
