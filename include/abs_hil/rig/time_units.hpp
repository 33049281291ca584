#pragma once

#include <cstdint>

namespace abs_hil::rig {

/// Clock readings are integers in ns; dynamics use seconds in double.
inline constexpr std::int64_t ns_per_us = 1'000;
inline constexpr std::int64_t ns_per_ms = 1'000'000;
inline constexpr std::int64_t ns_per_s = 1'000'000'000;
inline constexpr double s_per_ns = 1e-9;

[[nodiscard]] constexpr double in_us(std::int64_t ns) noexcept {
  return static_cast<double>(ns) / static_cast<double>(ns_per_us);
}

}  // namespace abs_hil::rig
