#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <map>
#include <random>
#include <string_view>

#include "emulator/rig_behind.hpp"

namespace abs_hil::emulator {

/// Properties of the emulated card and limits of its FPGA. Where the maker's sources give no value, this project chose
/// the default ("our choice"). Where they are silent or disagree, an option selects the variant, so that tests cover
/// both.
struct CardOptions {
  plant_sim::PlantOptions plant{};
  double start_speed_rad_s{0.0};                 ///< both wheels' speed at power-on, >= 0
  std::uint32_t bitstream_version{0xAB5};        ///< our choice: the real word is not public
  std::uint32_t channel_counts{0x3200};          ///< 3 counters (15:12), 2 timers (11:8); our choice
  double supply_V{24.0};                         ///< our choice; 0 = no supply
  double supply_min_V{15.0};                     ///< our choice
  double temperature_C{30.0};                    ///< our choice
  std::uint32_t temperature_max_C{90};           ///< our choice
  double overspeed_rpm{2200.0};                  ///< our choice; in the vendor's demo the lower wheel reaches 1700
  std::uint32_t velocity_period_ticks{400'000};  ///< ticks of 40 MHz; our choice: 10 ms
  std::uint32_t overspeed_bit{0};                ///< bit 0 or 2 of the trip flags; temperature has the other one
  bool trip_clears_width{false};                 ///< a trip zeroes the width registers as well as the outputs
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
class CardModel final : public RigBehind {
 public:
  static constexpr std::uint32_t bytes = 256;

  /// Throws std::invalid_argument if an option is outside its range.
  explicit CardModel(const CardOptions& options);

  /// One 32-bit access at a multiple of 4 below `bytes`. Undocumented registers read 0 and ignore writes.
  [[nodiscard]] std::uint32_t read32(std::uint32_t offset) const noexcept;
  void write32(std::uint32_t offset, std::uint32_t value) noexcept;

  // Events from outside the rig, except those of the host.
  void set_supply_V(double volts) noexcept { options_.supply_V = volts; }
  void set_temperature_C(double celsius) noexcept { options_.temperature_C = celsius; }
  void trip_overspeed() noexcept;

  [[nodiscard]] Outputs outputs() const noexcept override;
  [[nodiscard]] std::uint32_t trip_flags() const noexcept;
  /// The width registers, before mode, interlocks and E-stop.
  [[nodiscard]] const PwmWidths& pwm_widths() const noexcept { return widths_; }

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
  void after_step(const plant_sim::PlantState& /*before*/, std::int64_t /*from_ns*/) override { enforce_limits(); }

  CardOptions options_;
  std::uint32_t pwm_index_{0};
  std::array<PwmChannel, pwm_count> pwm_{};
  PwmWidths widths_{};
  std::uint32_t encoder_index_{0};
  std::uint32_t reset_mask_{0};
  std::array<std::uint32_t, encoder_count> zero_{};  ///< raw count at which each counter shows 0
  std::array<std::uint32_t, bytes / 4> plain_{};     ///< registers that only store the written value
};

/// Faults of one register. The names are those of `--fault OFFSET:NAME[=PARAMETER]`.
enum class FaultKind : std::uint8_t {
  ok,            ///< no fault: heals the register
  stuck,         ///< keeps the value that it had when the fault began; writes are lost
  wrong,         ///< reads its value plus the parameter
  slow,          ///< each access takes the parameter in us
  delayed,       ///< reads the value of n reads ago (n: parameter)
  intermittent,  ///< each access fails with the given probability
  off,           ///< every access fails
  garbage,       ///< reads random values
};

struct Fault {
  FaultKind kind{FaultKind::ok};
  double parameter{0.0};
};

/// Result of one access for the host.
struct AccessResult {
  bool failed{false};
  std::uint32_t value{0};
  std::int64_t delay_ns{0};  ///< delay of the answer
};

/// A card with faults in single registers, or a card that is missing on the bus (all ones).
class FaultyCard {
 public:
  FaultyCard(CardModel& card, std::uint64_t seed) : card_(card), random_(seed) {}

  /// Begins or (`ok`) ends a fault of the register at `offset`.
  void set(std::uint32_t offset, const Fault& fault);
  /// Sets a fault such as "88:delayed=3" or "0x6c:stuck". Throws std::invalid_argument with the valid faults.
  void set(std::string_view text);
  void answer_all_ones(bool on) noexcept { all_ones_ = on; }

  AccessResult read32(std::uint32_t offset);
  AccessResult write32(std::uint32_t offset, std::uint32_t value);

 private:
  struct State {
    Fault fault{};
    std::uint32_t stuck_at{0};
    std::deque<std::uint32_t> earlier{};
  };
  [[nodiscard]] bool fails(const Fault& fault);

  CardModel& card_;
  std::mt19937_64 random_;
  std::map<std::uint32_t, State> faults_{};
  bool all_ones_{false};
};

}  // namespace abs_hil::emulator
