#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "driver/pci/wire.hpp"

namespace abs_hil::driver::pci {

/// Registers that are read in turn, one per cycle: they change slowly, and the FPGA acts on them by itself.
inline constexpr std::array health_registers{reg::trip_flags, reg::supply, reg::temperature_high, reg::temperature_low};

/// A register that keeps its value during a run. The index of its PWM is written before it is read.
struct Setting {
  std::uint32_t offset{0};
  Pwm pwm{Pwm::brake};  ///< for the others the cycle's last access
};
/// Each cycle compares one of these, in turn, with its value at activation. A changed mode can make a small width a
/// full duty, so each PWM's comes every fourth cycle.
inline constexpr std::array settings{Setting{reg::pwm_mode, Pwm::drive}, Setting{reg::bitstream_version},
                                     Setting{reg::pwm_mode, Pwm::brake}, Setting{reg::channel_counts},
                                     Setting{reg::pwm_mode, Pwm::drive}, Setting{reg::pwm_prescaler, Pwm::drive},
                                     Setting{reg::pwm_mode, Pwm::brake}, Setting{reg::pwm_prescaler, Pwm::brake},
                                     Setting{reg::pwm_mode, Pwm::drive}, Setting{reg::velocity_period},
                                     Setting{reg::pwm_mode, Pwm::brake}, Setting{reg::velocity_limit},
                                     Setting{reg::pwm_mode, Pwm::drive}, Setting{reg::supply_min},
                                     Setting{reg::pwm_mode, Pwm::brake}, Setting{reg::temperature_max}};

/// Number of register accesses of one cycle (docs/rig-setup.md lists them): index and counter of two encoders, one of
/// the health registers; of two PWMs index, the width that it has and the width that it gets; one of the settings. The
/// driver writes the index before every access to indexed data although the card keeps it: with a wrong index the
/// brake's duty would go to the drive.
inline constexpr std::size_t accesses_in_read = std::size_t{2} * 2 + 1;
inline constexpr std::size_t accesses_in_write = std::size_t{2} * 3 + 1;
inline constexpr std::size_t accesses_per_cycle = accesses_in_read + accesses_in_write;

using OpenCard = std::function<Card()>;
/// The RT-DAC4/PCI with ABS logic. Not verified on hardware.
///
/// `read` and `write` together make `accesses_per_cycle` register accesses, about 1 us each on PCI. They make four more
/// after a delayed reading of the counters, and up to four more if an answer looks like that of a missing or tripped
/// card. `write` first looks at the widths of the previous cycle: a register that did not take its value shows one
/// cycle later, and a width that something else has written since then shows at all. The driver itself gates the motor
/// enable: the ABS logic has no such bit. The card has no known watchdog, so it is assumed to keep its last duties
/// after a crash.
///
/// Throws std::invalid_argument, naming the key, if an option is outside its range.
/// @param open_card called by `configure`; throws Unavailable
/// @param read_clock  the clock of `now_ns`. The time stamp of the counters is the middle of their reading, so that a
///                    delayed answer does not look like speed. Null in virtual time, where reading takes no time.
[[nodiscard]] std::unique_ptr<RigDriver> pci_driver(const PciOptions& options, OpenCard open_card,
                                                    BoardDriver::ReadClock read_clock = nullptr);

/// What all registers show, and what is known of them, one per line, for the user.
[[nodiscard]] std::vector<std::string> shown_registers(RegisterWindow& window);

using OpenWindow = std::function<std::unique_ptr<RegisterWindow>()>;
/// Makes the writer that sets both PWMs of the RT-DAC4/PCI to width 0, then reads both back. Index and data are two
/// accesses. A live owner between them could send a width to the wrong PWM, or undo the safe state with its next width.
/// Use it only when the owner no longer writes, or writes only zeros.
/// @param full_width  of a PWM: it also looks at both before it sets them; 0: it does not look
[[nodiscard]] std::unique_ptr<SafeStateWriter> safe_state_writer(OpenWindow open_window, std::uint32_t full_width = 0);
/// For the card that the options select, through sysfs. Beside a guardian, which writes zeros as well, it also looks.
[[nodiscard]] std::unique_ptr<SafeStateWriter> safe_state_writer_of(const PciOptions& options, const RunFacts& run);

}  // namespace abs_hil::driver::pci
