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

/// Throws std::invalid_argument, naming the keys, if both wheels have the same encoder channel.
/// @param board prefix of the keys, "driver.pci."
inline void check_channels(const std::string& board, std::int32_t lower, std::int32_t upper) {
  if (lower != upper) return;
  throw std::invalid_argument(board + "lower_channel = " + board + "upper_channel = " + std::to_string(upper) +
                              ": each wheel has an encoder of its own");
}

}  // namespace abs_hil::driver
