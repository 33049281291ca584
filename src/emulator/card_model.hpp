#pragma once

#include <array>
#include <cstdint>

#include "abs_hil/plant_sim/plant.hpp"
#include "emulator/card_options.hpp"
#include "plant_sim/encoder.hpp"

namespace abs_hil::emulator {

/// Duties that reach the power stage, after mode, width, interlocks and E-stop. No cap applies here.
struct Outputs {
  double drive_duty{0.0};
  double brake_duty{0.0};
};

/// Both PWMs' width registers and the times of their changes; card's clock, 0 at power-on.
struct PwmWidths {
  std::uint32_t drive{0};
  std::uint32_t brake{0};
  std::int64_t zero_since_ns{0};    ///< time since which both have been 0; only valid while both are 0
  std::int64_t last_written_ns{0};  ///< time of the host's last write to either, of any value
};

/// The RT-DAC4/PCI with ABS logic as a host sees it: 256 bytes of 32-bit registers with their side effects, and the
/// simulated rig behind them. It was written only from the documented registers and does not use the driver's tables.
/// It has no watchdog: without a host the PWMs hold their duties.
class CardModel {
 public:
  static constexpr std::uint32_t bytes = 256;
  static constexpr std::int64_t step_ns = 100'000;  ///< the plant and the interlocks run at 10 kHz

  /// Throws std::invalid_argument if an option is outside its range.
  explicit CardModel(const CardOptions& options);

  /// One 32-bit access at a multiple of 4 below `bytes`. Undocumented registers read 0 and ignore writes.
  [[nodiscard]] std::uint32_t read32(std::uint32_t offset) const noexcept;
  void write32(std::uint32_t offset, std::uint32_t value) noexcept;
  /// Advances the rig to `time_ns` (0 at power-on) in steps of at most `step_ns`; an earlier time does nothing.
  void advance_to(std::int64_t time_ns) noexcept;

  // Events from outside the rig, except those of the host.
  void press_emergency_stop(bool pressed) noexcept { emergency_stop_ = pressed; }  ///< cuts the drive only
  void set_supply_V(double volts) noexcept { options_.supply_V = volts; }
  void set_temperature_C(double celsius) noexcept { options_.temperature_C = celsius; }
  void trip_overspeed() noexcept;
  /// Turns a standing wheel by hand.
  void turn_by_hand(bool upper_wheel, double revolutions) noexcept;

  [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ns_; }
  [[nodiscard]] Outputs outputs() const noexcept;
  [[nodiscard]] std::uint32_t trip_flags() const noexcept;
  /// The width registers, before mode, interlocks and E-stop.
  [[nodiscard]] const PwmWidths& pwm_widths() const noexcept { return widths_; }
  /// True speeds and torques for the emulator's own log; no register shows them.
  [[nodiscard]] const plant_sim::Plant& plant() const noexcept { return plant_; }

 private:
  struct PwmChannel {
    std::uint32_t mode{1};
    std::uint32_t prescaler{60};
    std::uint32_t width{0};
  };
  static constexpr std::uint32_t pwm_count = 2;
  static constexpr std::uint32_t encoder_count = 3;

  void note_widths(std::int64_t written_ns) noexcept;
  [[nodiscard]] std::uint32_t read_pwm(std::uint32_t offset) const noexcept;
  void write_pwm(std::uint32_t offset, std::uint32_t value) noexcept;
  [[nodiscard]] std::uint32_t raw_count(std::uint32_t channel) const noexcept;
  [[nodiscard]] std::uint32_t velocity(double omega_rad_s) const noexcept;
  void enforce_limits() noexcept;

  CardOptions options_;
  plant_sim::Plant plant_;
  plant_sim::Encoder upper_;
  plant_sim::Encoder lower_;
  std::int64_t time_ns_{0};
  std::uint32_t pwm_index_{0};
  std::array<PwmChannel, pwm_count> pwm_{};
  PwmWidths widths_{};
  std::uint32_t encoder_index_{0};
  std::uint32_t reset_mask_{0};
  std::array<std::uint32_t, encoder_count> zero_{};  ///< raw count at which each counter shows 0
  std::array<std::uint32_t, bytes / 4> plain_{};     ///< registers that only store the written value
  bool overspeed_latched_{false};
  bool emergency_stop_{false};
};

}  // namespace abs_hil::emulator
