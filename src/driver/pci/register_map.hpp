// The registers of the RT-DAC4/PCI with ABS logic as one table, with their conversions and open questions.

#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string_view>

#include "driver/board_kit.hpp"
#include "driver/pwm.hpp"

namespace abs_hil::driver::pci {

// Register map of the RT-DAC4/PCI with ABS logic, from the maker's driver sources. It has not been tested on hardware.

inline constexpr std::uint32_t vendor_id = 0x10B5;       ///< PLX
inline constexpr std::uint32_t device_id = 0x2497;       ///< PCI 9030 as the maker programs it
inline constexpr std::uint32_t window_bytes = 256;       ///< BAR 2, I/O ports, 32-bit accesses
inline constexpr std::uint32_t all_ones = ~0U;           ///< value that a bus returns without a card
inline constexpr std::uint32_t low_16_bits = 0xFFFF;     ///< what a 16-bit register has of an access
inline constexpr double encoder_lines_per_rev = 1024.0;  ///< the velocity registers count lines, not quadrature edges

/// Offsets in the window, bytes.
namespace reg {
inline constexpr std::uint32_t bitstream_version = 0x00;
inline constexpr std::uint32_t channel_counts = 0x04;
inline constexpr std::uint32_t supply = 0x38;
inline constexpr std::uint32_t velocity_period = 0x50;
inline constexpr std::uint32_t velocity_lower = 0x54;
inline constexpr std::uint32_t velocity_upper = 0x58;
inline constexpr std::uint32_t velocity_limit = 0x5C;
inline constexpr std::uint32_t pwm_index = 0x60;
inline constexpr std::uint32_t pwm_mode = 0x64;
inline constexpr std::uint32_t pwm_prescaler = 0x68;
inline constexpr std::uint32_t pwm_width = 0x6C;
inline constexpr std::uint32_t encoder_index = 0x80;
inline constexpr std::uint32_t encoder_reset = 0x84;
inline constexpr std::uint32_t encoder_counter = 0x88;
inline constexpr std::uint32_t start_resistors = 0x90;
inline constexpr std::uint32_t supply_min = 0xA4;
inline constexpr std::uint32_t temperature_max = 0xA8;
inline constexpr std::uint32_t trip_flags = 0xAC;
inline constexpr std::uint32_t temperature_high = 0xB4;
inline constexpr std::uint32_t temperature_low = 0xB8;
}  // namespace reg

using driver::name_of;
using driver::Standing;

struct Register {
  std::uint32_t offset;
  std::string_view name;
  std::string_view unit;     ///< unit of the converted value; empty for numbers and bits
  std::string_view meaning;  ///< bits, conversion
  Standing standing;         ///< how well offset and meaning are known
  std::string_view use;      ///< what this driver does with it
  std::string_view open{};   ///< open questions about it, if any
};
/// Every register of the ABS logic, in order of offset, from the maker's driver sources. `open` has the contradictions
/// of these sources.
[[nodiscard]] std::span<const Register> registers() noexcept;
/// Name of the register at an offset; "unknown register" if there is none.
[[nodiscard]] std::string_view register_name(std::uint32_t offset) noexcept;

/// Index of a PWM channel (register 60).
enum class Pwm : std::uint32_t { drive = 0, brake = 1 };
// Register 64 is a PwmMode.
using driver::board_clock_Hz;
using driver::full_width;
using driver::pwm_frequency_Hz;
using driver::PwmMode;

/// The bits of a PWM register that count: the sources give these registers 16 bits and say nothing of those above,
/// which the card may fill with anything.
[[nodiscard]] constexpr std::uint32_t pwm_bits(std::uint32_t offset, std::uint32_t value) noexcept {
  return offset >= reg::pwm_index && offset <= reg::pwm_width ? value & low_16_bits : value;
}

/// Number of encoder counters that register 04 gives (bits 15:12).
[[nodiscard]] constexpr std::uint32_t counters_of(std::uint32_t channel_counts) noexcept {
  return (channel_counts >> 12U) & 0xFU;
}

/// Registers 38 and A4: V. 0 means no supply. NaN above 100 V, which this rig cannot have.
[[nodiscard]] constexpr double supply_V(std::uint32_t raw) noexcept {
  constexpr double most_V = 100.0;
  if (raw == 0) return 0.0;
  const double volts = 92000.0 / static_cast<double>(raw);
  return volts <= most_V ? volts : std::numeric_limits<double>::quiet_NaN();
}
/// Registers B4 (high) and B8 (low): deg C. NaN without sensor pulses (low = 0) and below -100 deg C, which a power
/// stage cannot have. The formula cannot exceed 235.
[[nodiscard]] constexpr double temperature_C(std::uint32_t high, std::uint32_t low) noexcept {
  constexpr double least_C = -100.0;
  if (low == 0) return std::numeric_limits<double>::quiet_NaN();
  const double celsius = 235.0 - 400.0 * static_cast<double>(high) / static_cast<double>(low);
  return celsius >= least_C ? celsius : std::numeric_limits<double>::quiet_NaN();
}
/// Registers 54, 58 and 5C (low 16 bits) with register 50: rad/s; NaN if the period is 0.
[[nodiscard]] double velocity_rad_s(std::uint32_t raw, std::uint32_t period_ticks) noexcept;

}  // namespace abs_hil::driver::pci
