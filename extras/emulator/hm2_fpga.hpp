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
    if (reg == 0x0D) return i == 0 ? written_[reg][0] : 0;
    if (reg == 0x10) return i < port_count ? levels(i) : 0;
    // Alternate source, open drain and inversion of a port cannot be read.
    if (reg == 0x11) return i < port_count ? written_[reg][i] : 0;
    if (reg >= 0x30 && reg <= 0x33) return read_counter(reg, i);
    return reg < 0x0C ? identity_.word(address) : 0;
  }
  void write32(std::uint32_t address, std::uint32_t value) {
    write(address >> 8U, (address & 0xFFU) / 4, value);
    note_outputs("commanded");
  }

  /// All registers as after power-on. The wheels go on turning.
  void power_on() {
    written_ = {};
    generators_ = {};
    counters_ = {};
    written_[0x0C][0] = disabled;
    written_[0x0D][0] = 1;  // a watchdog that was never set has bitten at the first clock
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
  [[nodiscard]] bool bitten() const noexcept override { return written_[0x0D][0] != 0; }
  [[nodiscard]] bool drives_pins() const noexcept override { return (driven(0) | driven(1)) != 0; }
  [[nodiscard]] std::string registers_text() const override {
    std::string text;
    for (const Registers& block : host_sets) {
      for (std::uint32_t i = 0; i < block.units; ++i) {
        for (std::uint32_t reg = block.first; reg <= block.last; ++reg) {
          text += rig::formatted("%s%04X=%08x", text.empty() ? "" : " ", reg << 8U | 4 * i, written_[reg][i]);
        }
      }
    }
    return text;
  }

 protected:
  Hm2Identity identity_;

 private:
  static constexpr std::int64_t ns_per_clock = 10;  // of ClockLow
  /// A load of N bites N + 3 or 4 clocks after the write.
  static constexpr std::int64_t watchdog_lag_clocks = 4;
  static constexpr std::uint32_t pet_mark = 0x5A;
  static constexpr std::uint32_t direction_bit = 0x80000000;
  // Mode register of a PWM generator.
  static constexpr std::uint32_t width_mask = 3;
  static constexpr std::uint32_t double_buffered = 0x20;
  enum Output : std::uint32_t { pwm_and_direction, swapped, up_and_down, pdm };
  // Control register of a counter.
  static constexpr std::uint32_t error_bit = 0x8000;

  static std::uint32_t bits_of(std::uint32_t mode) { return 9 + (mode & width_mask); }
  static std::uint32_t output_of(std::uint32_t mode) { return mode >> 3U & 3U; }

  static constexpr std::uint32_t port_count = 2;
  static constexpr std::uint32_t pins_per_port = 17;
  static constexpr std::uint32_t disabled = 0x80000000;

  /// Registers that a host sets, the first and the last of each block. Their units stand 4 bytes apart.
  struct Registers {
    std::uint32_t first, last, units;
    std::uint32_t bits;  ///< that they keep
  };
  static constexpr std::array<Registers, 9> host_sets{{{0x02, 0x02, 1, ~0U},      // LEDs
                                                       {0x0C, 0x0D, 1, ~0U},      // watchdog: time, status
                                                       {0x10, 0x14, 2, 0x1FFFF},  // ports, as in Port
                                                       {0x31, 0x31, 2, 0x0FF8},   // counters: control
                                                       {0x32, 0x32, 1, 0xFFFF},   // divisor of their time stamps
                                                       {0x34, 0x34, 1, 0x0FFF},   // their filter
                                                       {0x40, 0x41, 2, ~0U},      // PWM generators: value, mode
                                                       {0x42, 0x43, 1, 0xFFFF},   // rates of PWM and PDM
                                                       // Drives only pins of the function "enable", which G540x2 lacks.
                                                       {0x44, 0x44, 1, ~0U}}};
  enum Port : std::uint32_t { data = 0x10, ddr, alternate, open_drain, invert };
  struct Generator {
    std::uint32_t value{0};                        ///< the value that acts
    std::optional<std::int64_t> waits_until_ns{};  ///< double buffered: the written one acts from the next period
  };
  struct Counter {
    std::int64_t position{0};  ///< of the encoder, without wrap
    std::int64_t zero{0};
    std::int64_t last_ns{0};  ///< time of the last count
    bool error{false};
  };

  void write(std::uint32_t reg, std::uint32_t i, std::uint32_t value) {
    if (reg == 0x0E && i == 0 && value >> 24U == pet_mark) load_watchdog(written_[0x0C][0]);
    if (reg == 0x30 && i < counters_.size()) counters_[i].zero = counters_[i].position;
    const auto* block =
        std::ranges::find_if(host_sets, [&](const Registers& b) { return reg >= b.first && reg <= b.last; });
    if (block == host_sets.end() || i >= block->units) return;
    if (reg == 0x0C) return load_watchdog(value);
    if (reg == 0x0D) value &= written_[reg][0] & 1U;
    if (reg == 0x31) counters_[i].error = counters_[i].error && (value & error_bit) != 0;
    if (reg == 0x41) value &= 0x7FU;
    written_[reg][i] = value & block->bits;
    if (reg == 0x40) set_generator(i, value);
  }
  void set_generator(std::uint32_t i, std::uint32_t value) noexcept {
    Generator& g = generators_[i];
    if ((mode(i) & double_buffered) == 0 || pwm_rate() == 0) {
      g = {.value = value};
      return;
    }
    const double period = period_ns(i);
    g.waits_until_ns =
        static_cast<std::int64_t>(std::ceil((std::floor(static_cast<double>(time_ns()) / period) + 1.0) * period));
  }
  [[nodiscard]] std::uint32_t levels(std::uint32_t port) const noexcept {
    std::uint32_t all = 0;
    for (std::uint32_t pin = 0; pin < pins_per_port; ++pin) all |= (level(port * pins_per_port + pin) ? 1U : 0U) << pin;
    return all;
  }
  [[nodiscard]] std::uint32_t read_counter(std::uint32_t reg, std::uint32_t i) const noexcept {
    if (reg == 0x33) return i == 0 ? time_stamp(time_ns()) : 0;
    if (reg == 0x32 || i >= counters_.size()) return 0;
    const Counter& c = counters_[i];
    if (reg == 0x31) return written_[reg][i] | (c.error ? error_bit : 0U) | encoder_lines(c);
    return (static_cast<std::uint32_t>(c.position - c.zero) & 0xFFFFU) | time_stamp(c.last_ns) << 16U;
  }
  [[nodiscard]] std::uint32_t mode(std::uint32_t generator) const noexcept { return written_[0x41][generator]; }
  [[nodiscard]] std::uint32_t pwm_rate() const noexcept { return written_[0x42][0]; }
  /// The pins of a port that are outputs.
  [[nodiscard]] std::uint32_t driven(std::uint32_t port) const noexcept {
    return written_[ddr][port] | written_[open_drain][port];
  }

  // Watchdog: a counter of ClockLow, which bites when it falls through 0. Bit 31 of the counter: it stands.

  void load_watchdog(std::uint32_t clocks) {
    const bool was_armed = armed_;
    written_[0x0C][0] = clocks;
    last_pet_ns_ = time_ns();
    armed_ = clocks < disabled;
    bites_ns_ = time_ns() + (std::int64_t{clocks} + watchdog_lag_clocks) * ns_per_clock;
    if (was_armed && !armed_) bite_for("watchdog switched off");
  }
  void bite_for(const std::string& why) {
    armed_ = false;
    written_[0x0D][0] = 1;
    written_[ddr] = written_[open_drain] = {};
    log_.add(time_ns(), why);
    note_outputs(why);
  }
  [[nodiscard]] std::uint32_t watchdog_counter() const noexcept {
    if (!armed_) return written_[0x0C][0] >= disabled ? written_[0x0C][0] : 0xFFFFFFFF;
    return static_cast<std::uint32_t>(std::max<std::int64_t>(0, (bites_ns_ - time_ns()) / ns_per_clock));
  }
  [[nodiscard]] std::uint32_t time_stamp(std::int64_t time_ns) const noexcept {
    return static_cast<std::uint32_t>(time_ns / ns_per_clock / (std::int64_t{written_[0x32][0]} + 2)) & 0xFFFFU;
  }

  // Pins. Not driven, a pin is pulled high.

  [[nodiscard]] double period_ns(std::uint32_t generator) const noexcept {
    return 1e9 * std::ldexp(65536.0 / clock_high_Hz, static_cast<int>(bits_of(mode(generator)))) / pwm_rate();
  }
  [[nodiscard]] double pwm_high_share(std::uint32_t generator) const noexcept {
    const std::uint32_t value = generators_[generator].value;
    const std::uint32_t full = 1U << bits_of(mode(generator));
    const std::uint32_t magnitude = value >> 16U & (full - 1U);
    const bool backwards = (value & direction_bit) != 0;
    const std::uint32_t output = output_of(mode(generator));
    if (output == swapped) return backwards ? 1.0 : 0.0;
    if (output == up_and_down && backwards) return 0.0;
    const std::uint32_t rate = output == pdm ? written_[0x43][0] : pwm_rate();
    if (rate == 0) return magnitude > 0 ? 1.0 : 0.0;  // the generator's counter stands at 0
    return static_cast<double>(magnitude) / full;
  }
  [[nodiscard]] bool pwm_high_now(std::uint32_t generator) const noexcept {
    const double share = pwm_high_share(generator);
    if (pwm_rate() == 0) return share > 0.5;
    const double periods = static_cast<double>(time_ns()) / period_ns(generator);
    return periods - std::floor(periods) < share;
  }
  [[nodiscard]] std::uint32_t encoder_lines(const Counter& c) const noexcept {
    constexpr std::array<std::uint32_t, 4> phase{0, 1, 3, 2};  // A leads
    constexpr std::uint32_t index_bit = 4;
    return phase[static_cast<std::uint64_t>(c.position) % 4] |
           (c.position % options_.plant.rig.encoder_counts_per_rev == 0 ? index_bit : 0U);
  }
  [[nodiscard]] bool is_set(Port reg, std::uint32_t io) const noexcept {
    return (written_[reg][io / pins_per_port] >> io % pins_per_port & 1U) != 0;
  }
  /// True if a PWM generator drives the pin, whatever its direction.
  [[nodiscard]] bool of_generator(std::uint32_t io) const noexcept {
    return io % pins_per_port == 1 && is_set(alternate, io);
  }
  [[nodiscard]] double high_share(std::uint32_t io) const noexcept {
    if (!is_set(ddr, io) && !is_set(open_drain, io)) return 1.0;
    double share = is_set(data, io) ? 1.0 : 0.0;
    if (is_set(alternate, io)) share = of_generator(io) ? pwm_high_share(io / pins_per_port) : 0.0;
    return is_set(invert, io) ? 1.0 - share : share;
  }
  [[nodiscard]] bool level(std::uint32_t io) const noexcept {
    if (is_set(ddr, io) || is_set(open_drain, io)) {
      return of_generator(io) ? pwm_high_now(io / pins_per_port) != is_set(invert, io) : high_share(io) > 0.5;
    }
    constexpr std::uint32_t first_counter_pin = 13;
    const std::uint32_t line = io % pins_per_port - first_counter_pin;  // huge for those before
    return line > 2 || (encoder_lines(counters_[io / pins_per_port]) >> line & 1U) != 0;
  }
  [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override {
    if (armed_) next_ns = std::clamp(bites_ns_, time_ns(), next_ns);
    for (const Generator& g : generators_) {
      if (g.waits_until_ns) next_ns = std::clamp(*g.waits_until_ns, time_ns(), next_ns);
    }
    return next_ns;
  }
  void after_step(const plant_sim::PlantState& before, std::int64_t from_ns) override {
    const plant_sim::PlantState& after = plant().state();
    count(true, before.angle1_rad, after.angle1_rad, from_ns, time_ns());
    count(false, before.angle2_rad, after.angle2_rad, from_ns, time_ns());
    for (std::uint32_t i = 0; i < generators_.size(); ++i) {
      if (time_ns() < generators_[i].waits_until_ns.value_or(time_ns() + 1)) continue;
      generators_[i] = {.value = written_[0x40][i]};
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

  std::array<std::array<std::uint32_t, port_count>, 0x45>
      written_{};  ///< registers and their units, as a host set them
  std::array<Generator, 2> generators_{};
  std::array<Counter, 2> counters_{};
  bool armed_{false};
  std::int64_t bites_ns_{0};      ///< when the armed watchdog bites
  std::int64_t last_pet_ns_{-1};  ///< last reload of the watchdog; -1: none since power-on
};

}  // namespace abs_hil::emulator
