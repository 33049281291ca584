// Random numbers that depend on a counter alone, so that any point can be drawn without those before it.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace abs_hil::study {

/// Philox 4x64 with 10 rounds (Salmon, Moraes, Dror, Shaw 2011): four random words that depend on counter and key
/// alone, so that any point of a design can be drawn without those before it. NumPy's `Philox` is the same generator.
[[nodiscard]] std::array<std::uint64_t, 4> philox(std::array<std::uint64_t, 4> counter,
                                                  std::array<std::uint64_t, 2> key) noexcept;

/// A number in (0, 1), from the upper 52 bits. Neither end occurs, so that every distribution has its quantile.
[[nodiscard]] constexpr double open_unit(std::uint64_t bits) noexcept {
  return (static_cast<double>(bits >> 12U) + 0.5) * 0x1p-52;
}

/// FNV-1a, 64 bits: the same on every computer.
[[nodiscard]] constexpr std::uint64_t hash_of(std::string_view text) noexcept {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  return hash;
}

/// A permutation of 0 to count - 1 that needs no memory: a Feistel network over the next larger power of four, walked
/// until it falls below `count` (Black, Rogaway 2002). @param index  < count
[[nodiscard]] std::uint64_t permuted(std::uint64_t index, std::uint64_t count,
                                     std::array<std::uint64_t, 2> key) noexcept;

}  // namespace abs_hil::study
