// The emulated RT-DAC4/PCI: its registers, what they do to the rig, and faults of single registers.

#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <map>
#include <numbers>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>

#include "emulator/rig_behind.hpp"

namespace abs_hil::emulator {

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
  explicit CardModel(const BoardOptions& options) : RigBehind(options) {
    if (options.overspeed_bit != 0 && options.overspeed_bit != 2) {
      throw std::invalid_argument("overspeed bit " + std::to_string(options.overspeed_bit) + ": give 0 or 2");
    }
    plain_[0x50 / 4] = 400'000;  // ticks of 40 MHz, 10 ms: our choice
    plain_[0x5C / 4] = velocity(rad_s_of_rpm(options.overspeed_rpm));
    plain_[0xA4 / 4] = supply_raw(options.supply_min_V);
    plain_[0xA8 / 4] = options.temperature_max_C;
  }

  /// One 32-bit access at a multiple of 4 below `bytes`. Undocumented registers read 0 and ignore writes.
  [[nodiscard]] std::uint32_t read32(std::uint32_t offset) const noexcept {
    const plant_sim::PlantState& s = plant().state();
    switch (offset) {
      case 0x00: return options_.bitstream_version;
      case 0x04: return 0x3200;  // 3 counters (15:12), 2 timers (11:8): our choice
      case 0x38: return supply_raw(options_.supply_V);
      case 0x54: return velocity(s.omega2_rad_s);
      case 0x58: return velocity(s.omega1_rad_s);
      case 0x60: return pwm_index_;
      case 0x64:
      case 0x68:
      case 0x6C: return pwm_index_ < pwm_count ? pwm_[pwm_index_][(offset - 0x64) / 4] : 0;
      case 0x80: return encoder_index_;
      case 0x84: return reset_mask_;
      case 0x88:
        if (encoder_index_ >= encoder_count || (reset_mask_ >> encoder_index_ & 1U) != 0) return 0;
        return raw_count(encoder_index_) - zero_[encoder_index_];
      case 0xAC: return trip_flags();
      case 0xB4: return rounded((235.0 - options_.temperature_C) / 400.0 * temperature_low_ticks);
      case 0xB8: return temperature_low_ticks;
      default: return offset < bytes ? plain_[offset / 4] : 0;
    }
  }
  void write32(std::uint32_t offset, std::uint32_t value) noexcept {
    switch (offset) {
      case 0x60: pwm_index_ = value; break;
      case 0x64:
      case 0x68:
      case 0x6C: write_pwm(offset, value); break;
      case 0x80: encoder_index_ = value; break;
      case 0x84:
        // A counter stays at 0 while its bit is set, and counts from 0 once the bit is cleared.
        for (std::uint32_t channel = 0; channel < encoder_count; ++channel) {
          if (((reset_mask_ | value) >> channel & 1U) != 0) zero_[channel] = raw_count(channel);
        }
        reset_mask_ = value & 7U;
        break;
      default:
        if (only_stores(offset)) plain_[offset / 4] = value;
    }
  }

  void trip_overspeed() noexcept override {
    RigBehind::trip_overspeed();
    enforce_limits();
  }

  [[nodiscard]] Outputs outputs() const noexcept override {
    if (trip_flags() != 0) return {};
    const auto duty = [](const PwmChannel& channel) {
      const std::uint32_t full = channel[mode] == 1 ? 4095 : 255;
      return static_cast<double>(std::min(channel[width], full)) / static_cast<double>(full);
    };
    return {.drive_duty = emergency_stop() ? 0.0 : duty(pwm_[0]), .brake_duty = duty(pwm_[1])};
  }
  [[nodiscard]] std::uint32_t trip_flags() const noexcept {
    const std::uint32_t supply_raw_now = supply_raw(options_.supply_V);
    const bool supply_low = supply_raw_now == 0 || (plain_[0xA4 / 4] != 0 && supply_raw_now > plain_[0xA4 / 4]);
    const bool too_hot = options_.temperature_C > static_cast<double>(plain_[0xA8 / 4]);
    const std::uint32_t temperature_bit = 2U - options_.overspeed_bit;
    return (supply_low ? 2U : 0U) | (overspeed_latched_ ? 1U << options_.overspeed_bit : 0U) |
           (too_hot ? 1U << temperature_bit : 0U);
  }
  /// The width registers, before mode, interlocks and E-stop.
  [[nodiscard]] const PwmWidths& pwm_widths() const noexcept { return widths_; }

 private:
  static constexpr double clock_Hz = 40e6;
  static constexpr double lines_per_rev = 1024.0;
  static constexpr double supply_scale_V = 92000.0;
  /// Sensor pulse, low time; the ratio of high to low time carries the temperature.
  static constexpr std::uint32_t temperature_low_ticks = 100'000;

  static std::uint32_t rounded(double value) noexcept {
    return static_cast<std::uint32_t>(std::llround(std::clamp(value, 0.0, 4.0e9)));
  }

  /// Digital I/O, velocity period, start resistors, limits: not known whether the host may write them. Here it may.
  static constexpr bool only_stores(std::uint32_t offset) noexcept {
    return (offset >= 0x40 && offset <= 0x50) || offset == 0x5C || (offset >= 0x90 && offset <= 0xA8);
  }

  static std::uint32_t supply_raw(double volts) noexcept { return volts > 0.0 ? rounded(supply_scale_V / volts) : 0; }

  enum PwmRegister : std::uint32_t { mode, prescaler, width };  // from offset 64
  using PwmChannel = std::array<std::uint32_t, 3>;
  static constexpr std::uint32_t pwm_count = 2;
  static constexpr std::uint32_t encoder_count = 3;

  void note_widths(std::int64_t written_ns) noexcept {
    const bool were_zero = widths_.drive == 0 && widths_.brake == 0;
    widths_.drive = pwm_[0][width];
    widths_.brake = pwm_[1][width];
    widths_.last_written_ns = written_ns;
    if (!were_zero) widths_.zero_since_ns = time_ns();
  }
  void write_pwm(std::uint32_t offset, std::uint32_t value) noexcept {
    if (pwm_index_ >= pwm_count) return;
    constexpr std::array<std::uint32_t, 3> bits{1, 0xFFFF, 0xFFF};
    const std::uint32_t which = (offset - 0x64) / 4;
    const bool locked = which == width && options_.trip_clears_width && trip_flags() != 0;
    if (!locked) pwm_[pwm_index_][which] = value & bits[which];
    if (which == width) note_widths(time_ns());
  }
  [[nodiscard]] std::uint32_t raw_count(std::uint32_t channel) const noexcept {
    // 0 is the lower wheel, 1 the upper wheel, 2 the lever, which is at rest.
    return channel < 2 ? static_cast<std::uint32_t>(position(channel == 1)) : 0;
  }
  [[nodiscard]] std::uint32_t velocity(double omega_rad_s) const noexcept {
    const double lines_per_s = std::abs(omega_rad_s) / (2.0 * std::numbers::pi) * lines_per_rev;
    return std::min(rounded(lines_per_s * static_cast<double>(plain_[0x50 / 4]) / clock_Hz), 0xFFFFU);
  }
  void enforce_limits() noexcept {
    latch_overspeed(velocity(fastest_rad_s()) > plain_[0x5C / 4]);
    if (options_.trip_clears_width && trip_flags() != 0) {
      for (PwmChannel& channel : pwm_) channel[width] = 0;
      note_widths(widths_.last_written_ns);
    }
  }
  void after_step(const plant_sim::PlantState& /*before*/, std::int64_t /*from_ns*/) override { enforce_limits(); }

  std::uint32_t pwm_index_{0};
  std::array<PwmChannel, pwm_count> pwm_{{{1, 60, 0}, {1, 60, 0}}};
  PwmWidths widths_{};
  std::uint32_t encoder_index_{0};
  std::uint32_t reset_mask_{0};
  std::array<std::uint32_t, encoder_count> zero_{};  ///< raw count at which each counter shows 0
  std::array<std::uint32_t, bytes / 4> plain_{};     ///< registers that only store the written value
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

  /// Begins or (`ok`) ends a fault such as "88:delayed=3" or "0x6c:stuck". Throws std::invalid_argument with the valid
  /// faults.
  void set(std::string_view text) {
    const std::size_t colon = std::min(text.find(':'), text.size());
    const std::uint32_t offset = offset_in(text.substr(0, colon));
    const bool known = offset < CardModel::bytes;
    const GivenFault given =
        fault_in(known ? text.substr(std::min(colon + 1, text.size())) : "", register_faults, text,
                 "OFFSET:KIND, OFFSET a multiple of 4 in hexadecimal below 100, KIND one of ", ", ");
    const std::string_view kind = register_faults[given.place].name();
    faults_.erase(offset);
    if (kind != "ok") faults_[offset] = {.kind = kind, .parameter = given.number, .stuck_at = card_.read32(offset)};
  }
  void answer_all_ones(bool on) noexcept { all_ones_ = on; }

  AccessResult read32(std::uint32_t offset) {
    if (all_ones_) return {.value = ~0U};
    AccessResult result{.value = card_.read32(offset)};
    const auto found = faults_.find(offset);
    if (found == faults_.end()) return result;
    Fault& fault = found->second;
    if (fails(fault)) return {.failed = true};
    result.delay_ns = fault.delay_ns();
    if (fault.kind == "stuck") result.value = fault.stuck_at;
    if (fault.kind == "wrong") result.value += static_cast<std::uint32_t>(static_cast<std::int64_t>(fault.parameter));
    if (fault.kind == "garbage") result.value = static_cast<std::uint32_t>(random_() >> 32U);
    if (fault.kind == "delayed") {
      fault.earlier.push_back(result.value);
      result.value = fault.earlier.front();
      if (static_cast<double>(fault.earlier.size()) > fault.parameter) fault.earlier.pop_front();
    }
    return result;
  }
  AccessResult write32(std::uint32_t offset, std::uint32_t value) {
    if (all_ones_) return {};  // the card is not on the bus: the write is lost
    AccessResult result;
    if (const auto found = faults_.find(offset); found != faults_.end()) {
      const Fault& fault = found->second;
      if (fails(fault)) return {.failed = true};
      if (fault.kind == "stuck") return {};
      result.delay_ns = fault.delay_ns();
    }
    card_.write32(offset, value);
    return result;
  }

 private:
  static constexpr std::array<FaultName, 8> register_faults{{
      {"ok"},     // no fault: heals the register
      {"stuck"},  // keeps the value that it had when the fault began; writes are lost
      {"wrong=ADDEND", -2147483648.0, 2147483648.0},  // reads its value plus this
      {"slow=US", 0.0, 10e6},                         // each access takes so long
      {"delayed=READS", 1.0, 1e5},                    // reads the value of so many reads ago
      {"intermittent=PROBABILITY", 0.0, 1.0},         // each access fails with it
      {"off"},                                        // every access fails
      {"garbage"},                                    // reads random values
  }};

  /// CardModel::bytes if the text is no register's offset.
  static std::uint32_t offset_in(std::string_view digits) {
    if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
    const std::uint32_t offset = rig::parse_number<std::uint32_t>(digits, 16).value_or(CardModel::bytes);
    return offset % 4 == 0 ? std::min(offset, CardModel::bytes) : CardModel::bytes;
  }

  struct Fault {
    std::string_view kind{};
    double parameter{0.0};
    std::uint32_t stuck_at{0};
    std::deque<std::uint32_t> earlier{};

    [[nodiscard]] std::int64_t delay_ns() const {
      return kind == "slow" ? static_cast<std::int64_t>(parameter * 1e3) : 0;
    }
  };
  [[nodiscard]] bool fails(const Fault& fault) {
    if (fault.kind == "off") return true;
    return fault.kind == "intermittent" && static_cast<double>(random_() >> 11U) * 0x1p-53 < fault.parameter;
  }

  CardModel& card_;
  std::mt19937_64 random_;
  std::map<std::uint32_t, Fault> faults_{};
  bool all_ones_{false};
};

}  // namespace abs_hil::emulator
