#pragma once

#include <array>
#include <cstddef>

#include "abs_hil/plant_sim/plant.hpp"
#include "abs_hil/rig/brake_map.hpp"

namespace abs_hil::plant_sim {

/// The plant's state for Boost.odeint; the indices below name its elements.
using StateVector = std::array<double, 5>;
inline constexpr std::size_t omega1 = 0;
inline constexpr std::size_t omega2 = 1;
inline constexpr std::size_t brake_torque = 2;
inline constexpr std::size_t angle1 = 3;
inline constexpr std::size_t angle2 = 4;

/// Direction of sliding of each wheel in its bearing and brake: +1 forward, -1 backward, 0 held at standstill. It is
/// fixed within a substep, so that the right-hand side is smooth there.
struct Sliding {
  double upper{0.0};
  double lower{0.0};
};

/// The inputs of one `advance` in the form that the differential equations use.
struct HeldTorques {
  double brake_target_Nm{0.0};     ///< b(u) of (7), the target of the brake torque
  double brake_rate_per_s{0.0};    ///< c31 of (6); 0 for the ideal actuator, whose torque is constant
  double motor_stall_Nm{0.0};      ///< motor torque at standstill
  double motor_back_emf_Nms{0.0};  ///< decrease of the motor torque per rad/s of the lower wheel
};

[[nodiscard]] inline HeldTorques resolve(const PlantOptions& options, const PlantInput& input) noexcept {
  const rig::RigParameters& rig = options.rig;
  HeldTorques held;
  if (options.ideal_actuator) {
    held.brake_target_Nm = input.brake_torque_Nm;
  } else {
    held.brake_target_Nm = rig::brake_torque_at(rig.brake, input.brake_duty);
    held.brake_rate_per_s = rig.brake.c31_per_s;
  }
  held.motor_stall_Nm = rig.motor.stall_torque_Nm * input.motor_duty;
  held.motor_back_emf_Nms = held.motor_stall_Nm / rig.motor.no_load_speed_rad_s;
  return held;
}

/// Torque of the drive motor on the lower wheel, N m; exactly 0 at duty 0.
[[nodiscard]] inline double motor_torque_Nm(const HeldTorques& held, double omega2_rad_s) noexcept {
  return held.motor_stall_Nm - held.motor_back_emf_Nms * omega2_rad_s;
}

/// The right-hand side of (1), (2) and (6) for a fixed direction of sliding and one piece of the friction profile. The
/// tyre force is odd in the slip; the factor s(r2 omega2 - r1 omega1) printed in (1) is left out, because it would
/// reverse the force in traction (docs/theory.md).
struct TorqueBalance {
  const WheelModel& model;
  const HeldTorques& held;
  PresentFactor friction;
  Sliding sliding;

  /// @param time_s  time since `friction` holds
  [[nodiscard]] double tyre_force_N(const StateVector& x, double time_s) const noexcept {
    return model.tyre_force_N(
        {x[omega1], x[omega2], x[brake_torque], sliding.upper, friction.after(time_s, x[angle2])});
  }

  void operator()(const StateVector& x, StateVector& dxdt, double time_s) const noexcept {
    const rig::WheelParameters& wheels = model.wheels();
    const double force_N = tyre_force_N(x, time_s);
    const double dry1_Nm = wheels.M10_Nm + x[brake_torque];
    dxdt[omega1] =
        sliding.upper == 0.0
            ? 0.0
            : (wheels.r1_m * force_N - wheels.d1_Nms_rad * x[omega1] - sliding.upper * dry1_Nm) / wheels.J1_kg_m2;
    dxdt[omega2] = sliding.lower == 0.0 ? 0.0
                                        : (motor_torque_Nm(held, x[omega2]) - wheels.r2_m * force_N -
                                           wheels.d2_Nms_rad * x[omega2] - sliding.lower * wheels.M20_Nm) /
                                              wheels.J2_kg_m2;
    dxdt[brake_torque] = held.brake_rate_per_s * (held.brake_target_Nm - x[brake_torque]);
    dxdt[angle1] = x[omega1];
    dxdt[angle2] = x[omega2];
  }
};

}  // namespace abs_hil::plant_sim
