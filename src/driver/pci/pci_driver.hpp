#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
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

/// The RT-DAC4/PCI with ABS logic. Not verified on hardware.
///
/// `read` and `write` together make `accesses_per_cycle` register accesses, about 1 us each on PCI. They make four more
/// after a delayed reading of the counters, and up to four more if an answer looks like that of a missing or tripped
/// card. `write` first looks at the widths of the previous cycle: a register that did not take its value shows one
/// cycle later, and a width that something else has written since then shows at all. The driver itself gates the motor
/// enable: the ABS logic has no such bit. The card has no known watchdog, so it is assumed to keep its last duties
/// after a crash.
class PciDriver final : public BoardDriver {
 public:
  using OpenCard = std::function<Card()>;
  /// Throws std::invalid_argument, naming the key, if an option is outside its range.
  /// @param open_card called by `configure`; throws Unavailable
  /// @param read_clock  the clock of `now_ns`. The time stamp of the counters is the middle of their reading, so that a
  ///                    delayed answer does not look like speed. Null in virtual time, where reading takes no time.
  PciDriver(const PciOptions& options, OpenCard open_card, ReadClock read_clock = nullptr);
  ~PciDriver() override { static_cast<void>(deactivate()); }

  [[nodiscard]] std::string_view name() const noexcept override { return "pci"; }
  [[nodiscard]] std::vector<std::string> notes() const override;
  [[nodiscard]] std::vector<std::string> inspection() override;
  [[nodiscard]] BoardIdentity identity() const override;
  [[nodiscard]] bool outputs_now(rig::Command& applied) noexcept override;
  [[nodiscard]] IoResult try_write() noexcept override;

 private:
  class Access;

  void do_configure() override;
  void do_activate(std::int64_t now_ns) override;
  IoResult do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept override;
  IoResult do_write(const rig::Command& command, rig::Command& sent) noexcept override;
  IoResult do_make_safe() noexcept override;

  void take_over(Access& card) noexcept;
  void read_wheels(Access& card) noexcept;
  /// Reads both counters and sets their time stamp; false if that took too long.
  bool read_wheels_at(Access& card, std::int64_t& read_ns) noexcept;
  void read_health(Access& card, std::size_t which) noexcept;
  /// Writes a width and reads it back.
  void set_pwm(Access& card, Pwm pwm, std::uint32_t width) noexcept;
  /// Looks whether the PWM still has the width sent last, and writes the next one. Returns the width that the output
  /// has then: `width`, or 0 while the card's interlock holds the output off.
  std::uint32_t update_pwm(Access& card, Pwm pwm, std::uint32_t width) noexcept;
  void note_settings(Access& card) noexcept;
  void check_setting(Access& card) noexcept;
  /// Why a width is not the one sent: the register fails, the logic was loaded again, or something else has written it.
  [[nodiscard]] IoResult cause_of_wrong_width() noexcept;
  [[nodiscard]] bool tripped_to_zero(Access& card, std::uint32_t width_read) noexcept;
  [[nodiscard]] bool plausible(std::int64_t read_ns, const std::array<std::int32_t, 2>& before) const noexcept;
  [[nodiscard]] IoResult checked_for_absence(const Access& card) noexcept;

  PciOptions options_;
  PwmMode mode_;
  OpenCard open_card_;
  Card card_{};
  std::uint32_t version_{0};
  std::uint32_t channel_counts_{0};

  std::int64_t last_read_ns_{0};
  std::array<std::int32_t, 2> counts_{};  ///< upper, lower; with their signs
  std::array<std::uint32_t, health_registers.size()> health_{};
  std::size_t next_health_{0};
  std::array<std::uint32_t, 2> widths_sent_{};             ///< drive, brake
  std::array<std::uint32_t, settings.size()> settings_{};  ///< at activation
  std::size_t next_setting_{0};
};

using OpenWindow = std::function<std::unique_ptr<RegisterWindow>()>;
/// Makes the writer that sets both PWMs of the RT-DAC4/PCI to width 0, then reads both back. Index and data are two
/// accesses. A live owner between them could send a width to the wrong PWM, or undo the safe state with its next width.
/// Use it only when the owner no longer writes, or writes only zeros.
/// @param full_width  of a PWM: it also looks at both before it sets them; 0: it does not look
[[nodiscard]] std::unique_ptr<SafeStateWriter> safe_state_writer(OpenWindow open_window, std::uint32_t full_width = 0);
/// For the card that the options select, through sysfs. Beside a guardian, which writes zeros as well, it also looks.
[[nodiscard]] std::unique_ptr<SafeStateWriter> safe_state_writer_of(const PciOptions& options, const RunFacts& run);

}  // namespace abs_hil::driver::pci
