// Option rows that every board has, and the options of the simulated one.

#pragma once

#include <string>

#include "abs_hil/rig/option.hpp"

namespace abs_hil::driver {

// Options that every board has.

inline constexpr rig::OptionFacts motor_duty_cap{
    .meaning = "largest drive PWM the driver sends", .range = rig::positive(1), .safety = rig::commissioned};
inline constexpr rig::OptionFacts brake_duty_cap{
    .meaning = "largest brake PWM the driver sends; caps gate.brake_duty_max",
    .range = rig::positive(1),
    .safety = rig::commissioned};
/// Far above what the motor reaches.
inline constexpr rig::OptionFacts plausible_speed{.unit = "rad/s",
                                                  .meaning = "a counter that goes faster is a fault",
                                                  .range = rig::between(10, 100'000),
                                                  .safety = rig::weaker_above(1000)};
inline constexpr rig::OptionFacts pwm_width{
    .meaning = "counting width of the PWMs", .allowed = {"8-bit", "12-bit"}, .safety = rig::commissioned};
inline constexpr rig::OptionFacts encoder_sign{.meaning = "1, or -1 if the channel counts down going forward",
                                               .range = rig::between(-1, 1),
                                               .safety = rig::commissioned};

/// Everything below `driver.sim.` in the configuration: the board of the simulated rig.
struct SimOptions {
  ABS_HIL_OPTIONS(SimOptions);
  /// As the RT-DAC4/PCI in the vendor's demos.
  ABS_HIL_OPTION(std::string, pwm_mode, "12-bit", .meaning = pwm_width.meaning, .allowed = pwm_width.allowed,
                 .safety = rig::no_effect_on_safety);
};

}  // namespace abs_hil::driver
