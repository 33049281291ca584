#pragma once

#include <cstdint>

#include "abs_hil/driver/pwm.hpp"
#include "abs_hil/rig/command.hpp"
#include "abs_hil/rig/duty_grid.hpp"

namespace abs_hil::driver {

/// What a board's outputs make of a command: the resolution of their duties, and the driver's own caps.
struct OutputGrid {
  std::uint32_t duty_steps{0};  ///< > 0; steps from duty 0 to duty 1
  double motor_duty_max{1.0};
  double brake_duty_max{1.0};
  bool any_brake_duty{false};  ///< the brake is not rounded (`plant.ideal_actuator`)

  [[nodiscard]] std::uint32_t motor_width(const rig::Command& command) const noexcept {
    return command.motor_enable ? rig::width_for(duty_steps, command.motor_duty, motor_duty_max) : 0;
  }
  [[nodiscard]] std::uint32_t brake_width(const rig::Command& command) const noexcept {
    return rig::width_for(duty_steps, command.brake_duty, brake_duty_max);
  }
  /// The command as it goes out. Its duties are in [0, 1]. Real-time safe.
  [[nodiscard]] rig::Command as_sent(const rig::Command& command) const noexcept {
    rig::Command sent = command;
    sent.motor_duty = rig::duty_of(motor_width(command), duty_steps);
    if (!any_brake_duty) sent.brake_duty = rig::duty_of(brake_width(command), duty_steps);
    return sent;
  }
};

/// The grid of a board whose options have `pwm_mode` and the two caps.
template <typename Options>
[[nodiscard]] OutputGrid pwm_grid(const Options& options) noexcept {
  return {.duty_steps = full_width(pwm_mode_named(options.pwm_mode)),
          .motor_duty_max = options.motor_duty_max,
          .brake_duty_max = options.brake_duty_max};
}

}  // namespace abs_hil::driver
