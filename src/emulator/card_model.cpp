// The emulated RT-DAC4/PCI's registers and what they do to the rig.
#include "emulator/card_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace abs_hil::emulator {

namespace {

constexpr double clock_Hz = 40e6;
constexpr double lines_per_rev = 1024.0;
constexpr double supply_scale_V = 92000.0;
/// Sensor pulse, low time; the ratio of high to low time carries the temperature.
constexpr std::uint32_t temperature_low_ticks = 100'000;

std::uint32_t rounded(double value) noexcept {
  return static_cast<std::uint32_t>(std::llround(std::clamp(value, 0.0, 4.0e9)));
}

/// Digital I/O, velocity period, start resistors, limits: not known whether the host may write them. Here it may.
constexpr bool only_stores(std::uint32_t offset) noexcept {
  return (offset >= 0x40 && offset <= 0x50) || offset == 0x5C || (offset >= 0x90 && offset <= 0xA8);
}

std::uint32_t supply_raw(double volts) noexcept { return volts > 0.0 ? rounded(supply_scale_V / volts) : 0; }

}  // namespace

CardModel::CardModel(const CardOptions& options)
    : RigBehind(options.plant, options.start_speed_rad_s), options_(options) {
  if (options.overspeed_bit != 0 && options.overspeed_bit != 2) {
    throw std::invalid_argument("overspeed bit " + std::to_string(options.overspeed_bit) + ": give 0 or 2");
  }
  plain_[0x50 / 4] = options.velocity_period_ticks;
  plain_[0x5C / 4] = velocity(rad_s_of_rpm(options.overspeed_rpm));
  plain_[0xA4 / 4] = supply_raw(options.supply_min_V);
  plain_[0xA8 / 4] = options.temperature_max_C;
}

std::uint32_t CardModel::velocity(double omega_rad_s) const noexcept {
  const double lines_per_s = std::abs(omega_rad_s) / (2.0 * std::numbers::pi) * lines_per_rev;
  return std::min(rounded(lines_per_s * static_cast<double>(plain_[0x50 / 4]) / clock_Hz), 0xFFFFU);
}

std::uint32_t CardModel::raw_count(std::uint32_t channel) const noexcept {
  // 0 is the lower wheel, 1 the upper wheel, 2 the lever, which is at rest.
  return channel < 2 ? static_cast<std::uint32_t>(position(channel == 1)) : 0;
}

std::uint32_t CardModel::read_pwm(std::uint32_t offset) const noexcept {
  if (pwm_index_ >= pwm_count) return 0;
  const PwmChannel& channel = pwm_[pwm_index_];
  if (offset == 0x64) return channel.mode;
  return offset == 0x68 ? channel.prescaler : channel.width;
}

void CardModel::write_pwm(std::uint32_t offset, std::uint32_t value) noexcept {
  if (pwm_index_ >= pwm_count) return;
  PwmChannel& channel = pwm_[pwm_index_];
  if (offset == 0x64) {
    channel.mode = value & 1U;
  } else if (offset == 0x68) {
    channel.prescaler = value & 0xFFFFU;
  } else if (!options_.trip_clears_width || trip_flags() == 0) {
    channel.width = value & 0xFFFU;
  }
  if (offset == 0x6C) note_widths(time_ns());
}

void CardModel::note_widths(std::int64_t written_ns) noexcept {
  const bool were_zero = widths_.drive == 0 && widths_.brake == 0;
  widths_.drive = pwm_[0].width;
  widths_.brake = pwm_[1].width;
  widths_.last_written_ns = written_ns;
  if (!were_zero) widths_.zero_since_ns = time_ns();
}

std::uint32_t CardModel::read32(std::uint32_t offset) const noexcept {
  const plant_sim::PlantState& s = plant().state();
  switch (offset) {
    case 0x00: return options_.bitstream_version;
    case 0x04: return options_.channel_counts;
    case 0x38: return supply_raw(options_.supply_V);
    case 0x54: return velocity(s.omega2_rad_s);
    case 0x58: return velocity(s.omega1_rad_s);
    case 0x60: return pwm_index_;
    case 0x64:
    case 0x68:
    case 0x6C: return read_pwm(offset);
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

void CardModel::write32(std::uint32_t offset, std::uint32_t value) noexcept {
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

std::uint32_t CardModel::trip_flags() const noexcept {
  const std::uint32_t supply_raw_now = supply_raw(options_.supply_V);
  const bool supply_low = supply_raw_now == 0 || (plain_[0xA4 / 4] != 0 && supply_raw_now > plain_[0xA4 / 4]);
  const bool too_hot = options_.temperature_C > static_cast<double>(plain_[0xA8 / 4]);
  const std::uint32_t temperature_bit = 2U - options_.overspeed_bit;
  return (supply_low ? 2U : 0U) | (overspeed_latched_ ? 1U << options_.overspeed_bit : 0U) |
         (too_hot ? 1U << temperature_bit : 0U);
}

Outputs CardModel::outputs() const noexcept {
  if (trip_flags() != 0) return {};
  const auto duty = [](const PwmChannel& channel) {
    const std::uint32_t full = channel.mode == 1 ? 4095 : 255;
    return static_cast<double>(std::min(channel.width, full)) / static_cast<double>(full);
  };
  return {.drive_duty = emergency_stop() ? 0.0 : duty(pwm_[0]), .brake_duty = duty(pwm_[1])};
}

void CardModel::trip_overspeed() noexcept {
  overspeed_latched_ = true;
  enforce_limits();
}

void CardModel::enforce_limits() noexcept {
  latch_overspeed(velocity(fastest_rad_s()) > plain_[0x5C / 4]);
  if (options_.trip_clears_width && trip_flags() != 0) {
    for (PwmChannel& channel : pwm_) channel.width = 0;
    note_widths(widths_.last_written_ns);
  }
}

}  // namespace abs_hil::emulator
