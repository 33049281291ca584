// The registers of a HostMot2 with watchdog, I/O ports, quadrature counters and PWM generators, and the rig behind its
// pins. Duty at a power stage: share of the time in which its pin has the active level.

#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "emulator/udp_board.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::emulator {

/// The HostMot2 registers of a 7I92 with firmware G540x2, 32 bits each, and the simulated rig behind its pins. Written
/// from the documented registers; it shares no code with the driver.
///
/// A bite of the watchdog clears DDR and open drain. The pins are then inputs, which resistors pull high. All other
/// registers stay: counters count on, PWM generators keep their values.
class Hm2Fpga : public UdpBoard {
 public:
  static constexpr std::uint32_t clock_low_Hz = 100'000'000;
  static constexpr std::uint32_t clock_high_Hz = 200'000'000;

  /// Throws std::invalid_argument if an option is outside its range.
  explicit Hm2Fpga(const BoardOptions& options) : UdpBoard(options), identity_(options.words) {
    if (options.enable_line < -1 || options.enable_line >= static_cast<std::int32_t>(port_count * pins_per_port)) {
      throw std::invalid_argument("enable pin " + std::to_string(options.enable_line) + ": give -1 to 33");
    }
  }

  /// One register at a multiple of 4. Registers that cannot be read give 0.
  [[nodiscard]] std::uint32_t read32(std::uint32_t address) const noexcept {
    const std::uint32_t reg = address >> 8U;
    const std::uint32_t i = (address & 0xFFU) / 4;
    if (reg == 0x0C) return i == 0 ? watchdog_counter() : 0;
    if (reg == 0x0D) return i == 0 ? status_ : 0;
    if (reg >= 0x10 && reg <= 0x14) return i < port_count ? read_port(reg, i) : 0;
    if (reg >= 0x30 && reg <= 0x34) return read_counter(reg, i);
    return reg < 0x0C ? identity_.word(address) : 0;
  }
  void write32(std::uint32_t address, std::uint32_t value) {
    const std::uint32_t reg = address >> 8U;
    const std::uint32_t i = (address & 0xFFU) / 4;
    if (reg >= 0x10 && reg <= 0x14 && i < port_count) {
      write_port(reg, i, value);
    } else if (reg >= 0x30 && reg <= 0x34) {
      write_counter(reg, i, value);
    } else if (reg >= 0x40 && reg <= 0x44) {
      write_generator(reg, i, value);
    } else if (i == 0 && reg == 0x02) {
      leds_ = value;
    } else if (i == 0 && reg == 0x0C) {
      load_watchdog(value);
    } else if (i == 0 && reg == 0x0D) {
      status_ &= value & 1U;
    } else if (i == 0 && reg == 0x0E && value >> 24U == pet_mark) {
      load_watchdog(watchdog_time_);
    }
    note_outputs("commanded");
  }

  /// All registers as after power-on. The wheels go on turning.
  void power_on() {
    ports_ = {};
    generators_ = {};
    counters_ = {};
    pwm_rate_ = pdm_rate_ = pwm_enable_ = stamp_divisor_ = filter_rate_ = leds_ = 0;
    watchdog_time_ = disabled;
    status_ = 1;
    armed_ = false;
    last_pet_ns_ = -1;
    for (const bool upper : {false, true}) {
      Counter& c = counter_of(upper);
      c.position = c.zero = position(upper);
      c.last_ns = time_ns();
    }
    note_outputs("power-on");
  }
  void bite() override { bite_for("watchdog"); }
  void stood_still(std::int64_t duration_ns) override {
    if (!armed_) return;
    bites_ns_ += duration_ns;
    last_pet_ns_ += duration_ns;
  }
  void turn_by_hand(bool upper_wheel, double revolutions) override {
    const plant_sim::PlantState before = plant().state();
    RigBehind::turn_by_hand(upper_wheel, revolutions);
    const plant_sim::PlantState& after = plant().state();
    count(upper_wheel, upper_wheel ? before.angle1_rad : before.angle2_rad,
          upper_wheel ? after.angle1_rad : after.angle2_rad, time_ns(), time_ns());
  }
  void make_quadrature_error(bool upper_wheel) override { counter_of(upper_wheel).error = true; }

  [[nodiscard]] Outputs outputs() const noexcept override {
    const auto acting = [this](std::uint32_t io) {
      return options_.active_high_stage ? high_share(io) : 1.0 - high_share(io);
    };
    const bool enabled = options_.enable_line < 0 || acting(static_cast<std::uint32_t>(options_.enable_line)) > 0.5;
    return {.drive_duty = emergency_stop() || !enabled ? 0.0 : acting(1), .brake_duty = acting(pins_per_port + 1)};
  }
  [[nodiscard]] bool bitten() const noexcept override { return status_ != 0; }
  [[nodiscard]] bool drives_pins() const noexcept override {
    return std::any_of(ports_.begin(), ports_.end(), [](const Port& p) { return (p.ddr | p.open_drain) != 0; });
  }
  [[nodiscard]] std::string registers_text() const override {
    std::string text;
    const auto add = [&text](unsigned address, std::uint32_t value) {
      text += rig::formatted("%s%04X=%08x", text.empty() ? "" : " ", address, value);
    };
    add(0x0200, leds_);
    add(0x0C00, watchdog_time_);
    add(0x0D00, status_);
    for (unsigned i = 0; i < port_count; ++i) {
      const Port& p = ports_[i];
      unsigned address = 0x1000 + 4 * i;
      for (const std::uint32_t value : {p.data, p.ddr, p.alternate, p.open_drain, p.invert}) {
        add(address, value);
        address += 0x100;
      }
    }
    for (unsigned i = 0; i < counters_.size(); ++i) add(0x3100 + 4 * i, counters_[i].control);
    add(0x3200, stamp_divisor_);
    add(0x3400, filter_rate_);
    for (unsigned i = 0; i < generators_.size(); ++i) {
      add(0x4000 + 4 * i, generators_[i].waiting.value_or(generators_[i].value));
      add(0x4100 + 4 * i, generators_[i].mode);
    }
    add(0x4200, pwm_rate_);
    add(0x4300, pdm_rate_);
    add(0x4400, pwm_enable_);
    return text;
  }

 protected:
  Hm2Identity identity_;

 private:
  static constexpr std::int64_t ns_per_clock = 10;  // of ClockLow
  /// A load of N bites N + 3 or 4 clocks after the write.
  static constexpr std::int64_t watchdog_lag_clocks = 4;
  static constexpr std::uint32_t pet_mark = 0x5A;
  static constexpr std::uint32_t pin_mask = 0x1FFFF;
  static constexpr std::uint32_t direction_bit = 0x80000000;
  // Mode register of a PWM generator.
  static constexpr std::uint32_t width_mask = 3;
  static constexpr std::uint32_t double_buffered = 0x20;
  enum Output : std::uint32_t { pwm_and_direction, swapped, up_and_down, pdm };
  // Control register of a counter.
  static constexpr std::uint32_t error_bit = 0x8000;
  static constexpr std::uint32_t control_bits = 0x0FF8;  // those that a host sets

  static std::uint32_t bits_of(std::uint32_t mode) { return 9 + (mode & width_mask); }
  static std::uint32_t output_of(std::uint32_t mode) { return mode >> 3U & 3U; }

  static constexpr std::uint32_t port_count = 2;
  static constexpr std::uint32_t pins_per_port = 17;
  static constexpr std::uint32_t disabled = 0x80000000;

  struct Port {
    std::uint32_t data{0}, ddr{0}, alternate{0}, open_drain{0}, invert{0};
  };
  struct Generator {
    std::uint32_t value{0};  ///< the value that acts
    std::uint32_t mode{0};
    std::optional<std::uint32_t> waiting{};  ///< double buffered: acts from the next period
    std::int64_t waits_until_ns{0};
  };
  struct Counter {
    std::int64_t position{0};  ///< of the encoder, without wrap
    std::int64_t zero{0};
    std::int64_t last_ns{0};  ///< time of the last count
    std::uint32_t control{0};
    bool error{false};
  };

  [[nodiscard]] std::uint32_t read_port(std::uint32_t reg, std::uint32_t i) const noexcept {
    if (reg == 0x11) return ports_[i].ddr;
    if (reg != 0x10) return 0;  // alternate source, open drain and inversion cannot be read
    std::uint32_t levels = 0;
    for (std::uint32_t pin = 0; pin < pins_per_port; ++pin) levels |= (level(i * pins_per_port + pin) ? 1U : 0U) << pin;
    return levels;
  }
  void write_port(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept {
    Port& port = ports_[i];
    const std::array<std::uint32_t*, 5> registers{&port.data, &port.ddr, &port.alternate, &port.open_drain,
                                                  &port.invert};
    *registers[reg - 0x10] = value & pin_mask;
  }
  [[nodiscard]] std::uint32_t read_counter(std::uint32_t reg, std::uint32_t i) const noexcept {
    if (reg == 0x32 || reg == 0x34) return 0;
    if (reg == 0x33) return i == 0 ? time_stamp(time_ns()) : 0;
    if (i >= counters_.size()) return 0;
    const Counter& c = counters_[i];
    if (reg == 0x31) return c.control | (c.error ? error_bit : 0U) | encoder_lines(c);
    return (static_cast<std::uint32_t>(c.position - c.zero) & 0xFFFFU) | time_stamp(c.last_ns) << 16U;
  }
  void write_counter(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept {
    if (reg == 0x32 && i == 0) stamp_divisor_ = value & 0xFFFFU;
    if (reg == 0x34 && i == 0) filter_rate_ = value & 0xFFFU;
    if (reg > 0x31 || i >= counters_.size()) return;
    Counter& c = counters_[i];
    if (reg == 0x30) {
      c.zero = c.position;
    } else {
      c.control = value & control_bits;
      c.error = c.error && (value & error_bit) != 0;
    }
  }
  void write_generator(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept {
    if (i == 0 && reg == 0x42) pwm_rate_ = value & 0xFFFFU;
    if (i == 0 && reg == 0x43) pdm_rate_ = value & 0xFFFFU;
    if (i == 0 && reg == 0x44) pwm_enable_ = value;  // drives only pins of the function "enable", which G540x2 lacks
    if (reg > 0x41 || i >= generators_.size()) return;
    Generator& g = generators_[i];
    if (reg == 0x41) {
      g.mode = value & 0x7FU;
    } else if ((g.mode & double_buffered) != 0 && pwm_rate_ > 0) {
      const double period = period_ns(g);
      g.waiting = value;
      g.waits_until_ns =
          static_cast<std::int64_t>(std::ceil((std::floor(static_cast<double>(time_ns()) / period) + 1.0) * period));
    } else {
      g.value = value;
      g.waiting.reset();
    }
  }

  // Watchdog: a counter of ClockLow, which bites when it falls through 0. Bit 31 of the counter: it stands.

  void load_watchdog(std::uint32_t clocks) {
    const bool was_armed = armed_;
    watchdog_time_ = clocks;
    last_pet_ns_ = time_ns();
    armed_ = clocks < disabled;
    bites_ns_ = time_ns() + (std::int64_t{clocks} + watchdog_lag_clocks) * ns_per_clock;
    if (was_armed && !armed_) bite_for("watchdog switched off");
  }
  void bite_for(const std::string& why) {
    armed_ = false;
    status_ = 1;
    for (Port& port : ports_) port.ddr = port.open_drain = 0;
    log_.add(time_ns(), why);
    note_outputs(why);
  }
  [[nodiscard]] std::uint32_t watchdog_counter() const noexcept {
    if (!armed_) return watchdog_time_ >= disabled ? watchdog_time_ : 0xFFFFFFFF;
    return static_cast<std::uint32_t>(std::max<std::int64_t>(0, (bites_ns_ - time_ns()) / ns_per_clock));
  }
  [[nodiscard]] std::uint32_t time_stamp(std::int64_t time_ns) const noexcept {
    return static_cast<std::uint32_t>(time_ns / ns_per_clock / (std::int64_t{stamp_divisor_} + 2)) & 0xFFFFU;
  }

  // Pins. Not driven, a pin is pulled high.

  [[nodiscard]] double period_ns(const Generator& g) const noexcept {
    return 1e9 * std::ldexp(65536.0 / clock_high_Hz, static_cast<int>(bits_of(g.mode))) / pwm_rate_;
  }
  [[nodiscard]] double pwm_high_share(const Generator& g) const noexcept {
    const std::uint32_t full = 1U << bits_of(g.mode);
    const std::uint32_t magnitude = g.value >> 16U & (full - 1U);
    const bool backwards = (g.value & direction_bit) != 0;
    const std::uint32_t output = output_of(g.mode);
    if (output == swapped) return backwards ? 1.0 : 0.0;
    if (output == up_and_down && backwards) return 0.0;
    const std::uint32_t rate = output == pdm ? pdm_rate_ : pwm_rate_;
    if (rate == 0) return magnitude > 0 ? 1.0 : 0.0;  // the generator's counter stands at 0
    return static_cast<double>(magnitude) / full;
  }
  [[nodiscard]] bool pwm_high_now(const Generator& g) const noexcept {
    const double share = pwm_high_share(g);
    if (pwm_rate_ == 0) return share > 0.5;
    const double periods = static_cast<double>(time_ns()) / period_ns(g);
    return periods - std::floor(periods) < share;
  }
  [[nodiscard]] std::uint32_t encoder_lines(const Counter& c) const noexcept {
    constexpr std::array<std::uint32_t, 4> phase{0, 1, 3, 2};  // A leads
    constexpr std::uint32_t index_bit = 4;
    return phase[static_cast<std::uint64_t>(c.position) % 4] |
           (c.position % options_.plant.rig.encoder_counts_per_rev == 0 ? index_bit : 0U);
  }
  [[nodiscard]] double high_share(std::uint32_t io) const noexcept {
    const Port& port = ports_[io / pins_per_port];
    const std::uint32_t bit = 1U << io % pins_per_port;
    const bool open_drain = (port.open_drain & bit) != 0;
    if ((port.ddr & bit) == 0 && !open_drain) return 1.0;
    double share = (port.data & bit) != 0 ? 1.0 : 0.0;
    if ((port.alternate & bit) != 0) share = bit == 2 ? pwm_high_share(generators_[io / pins_per_port]) : 0.0;
    return (port.invert & bit) != 0 ? 1.0 - share : share;
  }
  [[nodiscard]] bool level(std::uint32_t io) const noexcept {
    const Port& port = ports_[io / pins_per_port];
    const std::uint32_t pin = io % pins_per_port;
    const std::uint32_t bit = 1U << pin;
    constexpr std::uint32_t first_counter_pin = 13;
    if (((port.ddr | port.open_drain) & bit) == 0) {
      if (pin < first_counter_pin || pin > first_counter_pin + 2) return true;
      return (encoder_lines(counters_[io / pins_per_port]) >> (pin - first_counter_pin) & 1U) != 0;
    }
    if (bit == 2 && (port.alternate & bit) != 0) {
      return pwm_high_now(generators_[io / pins_per_port]) != ((port.invert & bit) != 0);
    }
    return high_share(io) > 0.5;
  }
  [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override {
    if (armed_) next_ns = std::clamp(bites_ns_, time_ns(), next_ns);
    for (const Generator& g : generators_) {
      if (g.waiting) next_ns = std::clamp(g.waits_until_ns, time_ns(), next_ns);
    }
    return next_ns;
  }
  void after_step(const plant_sim::PlantState& before, std::int64_t from_ns) override {
    const plant_sim::PlantState& after = plant().state();
    count(true, before.angle1_rad, after.angle1_rad, from_ns, time_ns());
    count(false, before.angle2_rad, after.angle2_rad, from_ns, time_ns());
    for (Generator& g : generators_) {
      if (!g.waiting || time_ns() < g.waits_until_ns) continue;
      g.value = *std::exchange(g.waiting, std::nullopt);
      note_outputs("commanded");
    }
    if (armed_ && time_ns() >= bites_ns_) bite();
  }
  [[nodiscard]] Counter& counter_of(bool upper_wheel) noexcept { return counters_[upper_wheel ? 1 : 0]; }
  /// Counts what a wheel has turned in a step in which its speed was constant, and finds the time of the last edge.
  void count(bool upper_wheel, double from_rad, double to_rad, std::int64_t from_ns, std::int64_t to_ns) noexcept {
    Counter& c = counter_of(upper_wheel);
    const std::int64_t last = position_at(upper_wheel, to_rad);
    if (last == std::exchange(c.position, last)) return;
    constexpr int halvings = 24;
    double before = 0.0;
    double after = 1.0;
    for (int n = 0; n < halvings; ++n) {
      const double middle = (before + after) / 2.0;
      (position_at(upper_wheel, from_rad + middle * (to_rad - from_rad)) == last ? after : before) = middle;
    }
    c.last_ns = from_ns + static_cast<std::int64_t>(after * static_cast<double>(to_ns - from_ns));
  }
  [[nodiscard]] std::int64_t last_reload_ns() const noexcept override { return last_pet_ns_; }

  std::array<Port, port_count> ports_{};
  std::array<Generator, 2> generators_{};
  std::array<Counter, 2> counters_{};
  std::uint32_t pwm_rate_{0};
  std::uint32_t pdm_rate_{0};
  std::uint32_t pwm_enable_{0};
  std::uint32_t stamp_divisor_{0};
  std::uint32_t filter_rate_{0};
  std::uint32_t leds_{0};
  std::uint32_t watchdog_time_{disabled};
  std::uint32_t status_{1};  ///< a watchdog that was never set has bitten at the first clock
  bool armed_{false};
  std::int64_t bites_ns_{0};      ///< when the armed watchdog bites
  std::int64_t last_pet_ns_{-1};  ///< last reload of the watchdog; -1: none since power-on
};

}  // namespace abs_hil::emulator
