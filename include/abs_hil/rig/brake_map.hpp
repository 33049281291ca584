#pragma once

#include <cstdint>
#include <limits>

#include "abs_hil/rig/duty_grid.hpp"
#include "abs_hil/rig/parameters.hpp"
#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::rig {

/// The brake's map (7) and lag (6) over a scalar (rig/scalar.hpp).
template <class S>
struct BasicBrake {
  S b1_Nm{0.0}, b2_Nm{0.0}, u0{0.0}, c31_per_s{0.0};

  BasicBrake() = default;
  explicit BasicBrake(const BrakeParameters& brake) noexcept
      : b1_Nm(brake.b1_Nm), b2_Nm(brake.b2_Nm), u0(brake.u0), c31_per_s(brake.c31_per_s) {}
};

/// Static brake torque b(u) of (7), N m, for a duty u in [0, 1]; 0 inside the dead zone. Real-time safe.
template <class Brake, class S>
[[nodiscard]] constexpr S brake_torque_at(const Brake& brake, const S& duty) noexcept {
  return select(duty >= brake.u0, larger(S(0.0), S(brake.b1_Nm * duty + brake.b2_Nm)), S(0.0));
}

/// The duties above 0 that a PWM and a cap leave for the brake.
template <class S>
struct BrakeDuties {
  S least{0.0};          ///< the first outside the dead zone
  S most{0.0};           ///< below `least`: the whole range lies inside the dead zone
  S half_least_Nm{0.0};  ///< half of the torque of `least`
  S steps{0.0};          ///< of the PWM, from duty 0 to duty 1; 0: any duty can be given

  BrakeDuties() = default;
  constexpr BrakeDuties(const BrakeParameters& brake, double max_duty, std::uint32_t duty_steps) noexcept
      : least(duty_at_least(brake.u0, duty_steps)),
        most(duty_at_most(max_duty, duty_steps)),
        half_least_Nm(0.5 * brake_torque_at(brake, least)),
        steps(static_cast<double>(duty_steps)) {}
};

/// Inverse of b(u) onto the duties that a PWM of `duty_steps` steps can give (0: any): the duty in [0, max_duty] whose
/// static torque is nearest to `torque_Nm`. It never lies inside the dead zone: torques between 0 and that of the first
/// duty at or above u0 are unreachable, and those nearer to 0 give duty 0. NaN for a torque that is not finite, so that
/// the command gate refuses it. Real-time safe.
template <class Brake, class S>
[[nodiscard]] constexpr S brake_duty_for(const Brake& brake, const S& torque_Nm,
                                         const BrakeDuties<S>& duties) noexcept {
  constexpr double largest = std::numeric_limits<double>::max();
  const auto finite = torque_Nm >= -largest && torque_Nm <= largest;
  const auto none = torque_Nm <= 0.0 || torque_Nm < duties.half_least_Nm || duties.most < duties.least;
  const S duty = select(finite, S((torque_Nm - brake.b2_Nm) / brake.b1_Nm), S(0.0));
  const S within = clamped(duty, duties.least, duties.most);
  // As `nearest_duty`, at once for every number of steps.
  const S nearest = select(duties.steps > 0.0, S(whole_part(S(within * duties.steps + 0.5)) / duties.steps), within);
  const S reachable = select(duty <= duties.least, duties.least, select(duty >= duties.most, duties.most, nearest));
  return select(finite, select(none, S(0.0), reachable), S(std::numeric_limits<double>::quiet_NaN()));
}
[[nodiscard]] constexpr double brake_duty_for(const BrakeParameters& brake, double torque_Nm, double max_duty = 1.0,
                                              std::uint32_t duty_steps = 0) noexcept {
  return brake_duty_for(brake, torque_Nm, BrakeDuties<double>(brake, max_duty, duty_steps));
}

}  // namespace abs_hil::rig
