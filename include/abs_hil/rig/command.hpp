#pragma once

namespace abs_hil::rig {

/// Command to the rig in one cycle. The default is the safe state. Trivially copyable.
struct Command {
  double motor_duty{0.0};    ///< drive PWM of the lower wheel's motor, in [0, 1]
  double brake_duty{0.0};    ///< brake PWM, in [0, 1]
  bool motor_enable{false};  ///< the drive PWM is forced to 0 while false
  /// Torque from which `brake_duty` was computed, N m, >= 0. Only the simulator with `plant.ideal_actuator` applies it
  /// (no map, no lag, no saturation); hardware uses only the duty.
  double brake_torque_Nm{0.0};
};

/// Drive off, brake off, motor disabled.
inline constexpr Command safe_command{};

/// True if the command has an output on.
[[nodiscard]] constexpr bool acts(const Command& command) noexcept {
  return command.motor_duty > 0.0 || command.brake_duty > 0.0 || command.brake_torque_Nm > 0.0;
}

}  // namespace abs_hil::rig
