#pragma once

// A HostMot2 board as its own descriptors show it: cookie, IDROM, modules, pins, clocks. Nothing about it is assumed.
// Then the pins that the options name.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "driver/board_options.hpp"
#include "driver/hm2/wire.hpp"

namespace abs_hil::driver::hm2 {

/// One module of the board: register k of instance i is at base + k · register_stride + i · instance_stride.
struct Module {
  unsigned version{0};
  unsigned instances{0};
  std::uint16_t base{0};
  std::uint16_t register_stride{0};
  std::uint16_t instance_stride{0};
  double clock_Hz{0.0};
  [[nodiscard]] std::uint16_t address(unsigned reg, unsigned instance = 0) const noexcept {
    return static_cast<std::uint16_t>(base + reg * register_stride + instance * instance_stride);
  }
};

/// What the registers of the modules are.
namespace reg {
enum Watchdog : unsigned { time, bitten, pet };
enum Port : unsigned { data, direction, alternate_source, open_drain, invert };
enum Counter : unsigned { count, control, stamp_divisor, stamp_clock, filter };
enum Pwm : unsigned { value, mode, rate, pdm_rate, enable };
}  // namespace reg

/// One of the module's functions at an I/O pin.
struct Pin {
  std::uint8_t function{0};  ///< bit 7: output
  std::uint8_t tag{0};
  std::uint8_t unit{0};
};
namespace tag {
inline constexpr std::uint8_t watchdog = 2;
inline constexpr std::uint8_t port = 3;
inline constexpr std::uint8_t counter = 4;
inline constexpr std::uint8_t pwm = 6;
}  // namespace tag
inline constexpr std::uint8_t pwm_output = 0x81;

/// A board as it describes itself.
struct Board {
  std::string name{};  ///< "7I92"
  std::string idrom_name{};
  unsigned protocol_version{0};
  unsigned firmware_version{0};
  std::string mac{};
  double clock_low_Hz{0.0};
  double clock_high_Hz{0.0};
  unsigned ports{0};
  unsigned port_width{0};
  Module watchdog{};
  Module port{};
  Module counter{};
  Module pwm{};
  std::vector<Pin> pins{};
  std::vector<std::string> modules{};  ///< each in words
};

/// One word for each of the board's ports.
[[nodiscard]] inline std::span<const std::uint32_t> of_ports(const PortWords& words, const Board& board) noexcept {
  return {words.data(), board.ports};
}

/// Reads who the board is, all descriptors, and checks each of them. Writes nothing but the scratch word of `ask`.
/// Throws Unavailable, naming the fact, for a board that does not answer, that describes something impossible, or that
/// lacks a watchdog, two counters or two PWMs of a known version.
[[nodiscard]] Board read_board(Link& link, const std::string& place, std::uint32_t& number);

/// The pins that a rig uses, as words for the ports' registers.
struct UsedPins {
  PortWords outputs{};   ///< the direction register while active
  PortWords modules{};   ///< pins that carry their module
  PortWords inverted{};  ///< outputs that are active low
  PortWords enable{};    ///< the motor's enable line
  PortWords relay{};     ///< the line that changes with each command
};

/// Finds the pins of the options' PWMs, counters and lines.
/// Throws Unavailable, naming the key, if the board has them elsewhere or lacks them, or if a pin has two uses.
[[nodiscard]] UsedPins find_pins(const Board& board, const Hm2Options& options);

}  // namespace abs_hil::driver::hm2
