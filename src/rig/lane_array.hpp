#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "abs_hil/rig/scalar.hpp"

/// Arrays whose index is a scalar: each lane of a pack has its own place. An index is a whole number in [0, N).
/// Real-time safe.
namespace abs_hil::rig {

template <class S, std::size_t N>
[[nodiscard, gnu::always_inline]] inline S element(const std::array<S, N>& array, const S& index) noexcept {
  if constexpr (Lanes<S>) {
    double places[S::lanes];
    double taken[S::lanes];
    std::memcpy(places, &index, sizeof(S));
    const auto* all = reinterpret_cast<const unsigned char*>(&array);
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      const auto word = static_cast<std::size_t>(static_cast<std::int32_t>(places[lane])) * S::lanes + lane;
      std::memcpy(&taken[lane], all + word * sizeof(double), sizeof(double));
    }
    S result;
    std::memcpy(&result, taken, sizeof(S));
    return result;
  } else {
    return array[static_cast<std::size_t>(index)];
  }
}

template <class S, std::size_t N>
[[gnu::always_inline]] inline void put_element(std::array<S, N>& array, const S& index, const S& value) noexcept {
  if constexpr (Lanes<S>) {
    double places[S::lanes];
    double values[S::lanes];
    std::memcpy(places, &index, sizeof(S));
    std::memcpy(values, &value, sizeof(S));
    auto* all = reinterpret_cast<unsigned char*>(&array);
    for (std::size_t lane = 0; lane < S::lanes; ++lane) {
      const auto word = static_cast<std::size_t>(static_cast<std::int32_t>(places[lane])) * S::lanes + lane;
      std::memcpy(all + word * sizeof(double), &values[lane], sizeof(double));
    }
  } else {
    array[static_cast<std::size_t>(index)] = value;
  }
}

}  // namespace abs_hil::rig
