// The wire of the RT-DAC4/PCI with ABS logic: its registers as one table, with their conversions and open questions,
// the file of sysfs that they stand behind, with one owner, and how the card is found.

#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abs_hil/driver/io_result.hpp"
#include "driver/board_kit.hpp"
#include "driver/board_options.hpp"
#include "driver/file_descriptor.hpp"

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

/// Index of a PWM channel (register 60).
enum class Pwm : std::uint32_t { drive = 0, brake = 1 };
// Register 64 is a PwmMode.

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

/// The 32-bit registers of one card, by byte offset from the start of its BAR. Real-time safe: no exception, allocation
/// or lock; each access takes as long as the bus.
class RegisterWindow {
 public:
  virtual ~RegisterWindow() = default;

  /// `value` does not change on error. `IoResult::where` is the offset.
  virtual IoResult read32(std::uint32_t offset, std::uint32_t& value) noexcept = 0;
  virtual IoResult write32(std::uint32_t offset, std::uint32_t value) noexcept = 0;
  /// Of a guardian's window: whether new owners are refused.
  virtual void refuse_owners(bool /*refuse*/) noexcept {}
};

/// Who opens a card's registers. A guardian opens them beside the owner, and keeps new owners away after the owner's
/// end: it holds another kind of lock (fcntl), for which a new owner checks. `beside_guardian` takes no lock.
enum class WindowUse : std::uint8_t { owner, guardian, beside_guardian };

/// The registers behind sysfs' `resource2`. For an I/O BAR the kernel turns a 4-byte pread or pwrite at the register's
/// offset into one 32-bit port access (Documentation/PCI/sysfs-pci.rst). Only one process may own a card, because index
/// and data are two accesses. The file stays locked (flock) during the window's lifetime.
/// Throws Unavailable if the file is missing, if access is not permitted (with the udev rule that fixes it), or if
/// another process owns the card or still makes it safe (with its id).
[[nodiscard]] std::unique_ptr<RegisterWindow> open_window(const std::filesystem::path& resource_file,
                                                          WindowUse use = WindowUse::owner);

/// The emulator's clock: a file of 8 bytes in the card's folder, the time in ns. A write advances the time.
/// Throws Unavailable if the file is missing or cannot be opened.
[[nodiscard]] std::unique_ptr<EmulatedTime> open_emulated_time(const std::filesystem::path& file);

/// The error that an errno of pread or pwrite means.
[[nodiscard]] IoError io_error_for(int errno_value) noexcept;

/// A card ready for use.
struct Card {
  std::unique_ptr<RegisterWindow> window{};
  std::unique_ptr<EmulatedTime> time{};  ///< only for an emulator in lock-step
  std::string place{};                   ///< for messages: address and folder
  std::string address{};                 ///< "0000:03:00.0"
};

/// The addresses ("0000:03:00.0") of all cards with the right vendor and device below `root`, sorted. Throws
/// Unavailable if `root` cannot be read.
[[nodiscard]] std::vector<std::string> find_cards(const std::filesystem::path& root);

/// The cards that the options do not exclude, with what keeps a run from using them. Accesses no register. Empty if
/// there is no card, or no folder of PCI devices.
[[nodiscard]] std::vector<FoundBoard> survey_cards(const PciOptions& options);

/// Finds the card that the options select. Checks its ids, what the kernel says against it and the kind and size of its
/// BAR, then opens and locks it. Writes nothing. Throws Unavailable with cause and fix.
/// @param lock_step  advance the emulator's clock; refused without such a clock, as on all hardware. If false, an
///                   emulator in lock-step is refused
[[nodiscard]] Card open_card(const PciOptions& options, bool lock_step);

/// Opens the registers of the same card for a guardian, without the owner's lock. Of the obstacles only those count
/// that concern the ports: the others do not keep zeros from a card. Throws Unavailable, also if another guardian still
/// makes that card safe.
/// @param beside_guardian  go on even then: both write zeros only
/// @param file  becomes the file of the registers as soon as the card is found; null: not asked for
[[nodiscard]] std::unique_ptr<RegisterWindow> open_beside_owner(const PciOptions& options, bool beside_guardian = false,
                                                                std::string* file = nullptr);

/// File in the card's folder that only an emulator in lock-step has.
inline constexpr const char* emulated_time_file = "emulated_time_ns";

}  // namespace abs_hil::driver::pci
