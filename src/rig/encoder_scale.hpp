#pragma once

#include <algorithm>
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

/// Largest distance, ns, between a measurement's time stamp and the moment at which its counters were latched. The
/// latch lies somewhere within the reading, which began at `begin_ns` and took `took_ns` >= 0. A stamp outside the
/// reading counts as its nearer end. Real-time safe.
[[nodiscard]] constexpr std::int64_t stamp_error_ns(std::int64_t stamp_ns, std::int64_t begin_ns,
                                                    std::int64_t took_ns) noexcept {
  const std::int64_t into_ns = std::clamp(stamp_ns - begin_ns, std::int64_t{0}, took_ns);
  return std::max(into_ns, took_ns - into_ns);
}

}  // namespace abs_hil::rig
