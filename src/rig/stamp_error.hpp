#pragma once

#include <algorithm>
#include <cstdint>

namespace abs_hil::rig {

/// Largest distance, ns, between a measurement's time stamp and the moment at which its counters were latched. The
/// latch lies somewhere within the reading, which began at `begin_ns` and took `took_ns` >= 0. A stamp outside the
/// reading counts as its nearer end. Real-time safe.
[[nodiscard]] constexpr std::int64_t stamp_error_ns(std::int64_t stamp_ns, std::int64_t begin_ns,
                                                    std::int64_t took_ns) noexcept {
  const std::int64_t into_ns = std::clamp(stamp_ns - begin_ns, std::int64_t{0}, took_ns);
  return std::max(into_ns, took_ns - into_ns);
}

}  // namespace abs_hil::rig
