#include "control/brake_actuator.hpp"

namespace abs_hil::control {

template <class S>
BasicBrakeActuator<S>::BasicBrakeActuator(const rig::BrakeParameters& brake, bool ideal, double max_duty,
                                          std::uint32_t duty_steps) noexcept
  requires std::is_same_v<S, double>
    : brake_{brake},
      ideal_{ideal ? 1.0 : 0.0},
      duties_{brake, max_duty, ideal ? 0 : duty_steps},
      max_torque_Nm_{ideal ? std::numeric_limits<double>::infinity()
                           : rig::brake_torque_at(brake, rig::duty_at_most(max_duty, duty_steps))},
      half_step_Nm_{ideal || duty_steps == 0 ? 0.0 : 0.5 * brake.b1_Nm / static_cast<double>(duty_steps)} {
  if (ideal) return;
  least_.duty = rig::duty_at_least(brake.u0, duty_steps);
  least_.torque_Nm = rig::brake_torque_at(brake, least_.duty);
}

template class BasicBrakeActuator<double>;

}  // namespace abs_hil::control
