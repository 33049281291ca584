#pragma once

#include <cstdint>
#include <limits>

#include "runtime/command_gate.hpp"

namespace abs_hil::runtime::test_bench {

inline constexpr GateInput moderate{{100.0, 100.0}, rig::Phase::brake, 0};
inline constexpr std::int64_t ms = 1'000'000;
inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
inline constexpr double infinite = std::numeric_limits<double>::infinity();

[[nodiscard]] inline bool is_safe(const rig::Command& command) {
  return command.motor_duty == 0.0 && command.brake_duty == 0.0 && !command.motor_enable &&
         command.brake_torque_Nm == 0.0;
}

}  // namespace abs_hil::runtime::test_bench
