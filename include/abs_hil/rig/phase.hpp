#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace abs_hil::rig {

/// Phase of an experiment. The names appear in the CSV's `phase` column, the numbers in the LCM types.
enum class Phase : std::uint8_t { idle, accelerate, coast, brake, hold, stopped, fault };

[[nodiscard]] constexpr std::string_view name_of(Phase phase) noexcept {
  constexpr std::array<std::string_view, 7> names{"idle", "accelerate", "coast", "brake", "hold", "stopped", "fault"};
  const auto number = static_cast<std::size_t>(phase);
  return number < names.size() ? names[number] : "fault";
}

}  // namespace abs_hil::rig
