#pragma once

#include "abs_hil/driver/backend.hpp"
#include "driver/pwm.hpp"

namespace abs_hil::driver {

/// The grid of a board whose options have `pwm_mode` and the two caps.
template <typename Options>
[[nodiscard]] OutputGrid pwm_grid(const Options& options) noexcept {
  return {.duty_steps = full_width(pwm_mode_named(options.pwm_mode)),
          .motor_duty_max = options.motor_duty_max,
          .brake_duty_max = options.brake_duty_max};
}

}  // namespace abs_hil::driver
