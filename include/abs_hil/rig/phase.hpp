#pragma once

#include <cstdint>
#include <string_view>

namespace abs_hil::rig {

/// Phase of an experiment. The names appear in the CSV's `phase` column, the numbers in the LCM types.
enum class Phase : std::uint8_t { idle, accelerate, coast, brake, hold, stopped, fault };

[[nodiscard]] constexpr std::string_view name_of(Phase phase) noexcept {
  switch (phase) {
    case Phase::idle: return "idle";
    case Phase::accelerate: return "accelerate";
    case Phase::coast: return "coast";
    case Phase::brake: return "brake";
    case Phase::hold: return "hold";
    case Phase::stopped: return "stopped";
    case Phase::fault: return "fault";
  }
  return "fault";
}

}  // namespace abs_hil::rig
