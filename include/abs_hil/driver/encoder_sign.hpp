#pragma once

#include <bit>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace abs_hil::driver {

/// The counter as a signed number, negated if `sign` is -1. Real-time safe.
[[nodiscard]] inline std::int32_t with_sign(std::uint32_t raw, std::int32_t sign) noexcept {
  return std::bit_cast<std::int32_t>(sign < 0 ? 0U - raw
                                              : raw);  // unsigned arithmetic: the most negative count has no negative
}

/// Throws std::invalid_argument, naming the key, unless `sign` is 1 or -1.
inline void check_sign(const char* key, std::int32_t sign) {
  if (sign == 1 || sign == -1) return;
  throw std::invalid_argument(std::string(key) + " = " + std::to_string(sign) + ": give 1 or -1");
}

}  // namespace abs_hil::driver
