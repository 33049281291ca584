// PWM outputs of the maker's RT-DAC boards: modes, widths, frequency.

#pragma once

#include <cstdint>
#include <string_view>

#include "abs_hil/driver/backend.hpp"
#include "abs_hil/rig/duty_grid.hpp"

namespace abs_hil::driver {

/// Clock of the RT-DAC4/PCI's PWM and velocity periods.
inline constexpr double board_clock_Hz = 40e6;

/// Counter width of a PWM.
enum class PwmMode : std::uint32_t { bits_8 = 0, bits_12 = 1 };

/// The mode that the option pwm_mode names, "8-bit" or "12-bit".
[[nodiscard]] constexpr PwmMode pwm_mode_named(std::string_view name) noexcept {
  return name == "8-bit" ? PwmMode::bits_8 : PwmMode::bits_12;
}
/// Largest width, which is duty 1.
[[nodiscard]] constexpr std::uint32_t full_width(PwmMode mode) noexcept {
  return mode == PwmMode::bits_12 ? 4095 : 255;
}
/// PWM frequency, Hz: 40 MHz / ((prescaler + 1) full width).
[[nodiscard]] constexpr double pwm_frequency_Hz(PwmMode mode, std::uint32_t prescaler) noexcept {
  return board_clock_Hz / ((static_cast<double>(prescaler) + 1.0) * static_cast<double>(full_width(mode)));
}
/// The grid of a board whose options have `pwm_mode` and the two caps.
template <typename Options>
[[nodiscard]] OutputGrid pwm_grid(const Options& options) noexcept {
  return {.duty_steps = full_width(pwm_mode_named(options.pwm_mode)),
          .motor_duty_max = options.motor_duty_max,
          .brake_duty_max = options.brake_duty_max};
}

}  // namespace abs_hil::driver
