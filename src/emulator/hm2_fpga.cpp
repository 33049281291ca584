// The registers of a HostMot2 with watchdog, I/O ports, quadrature counters and PWM generators, and the rig behind its
// pins. Duty at a power stage: share of the time in which its pin has the active level.

#include "emulator/hm2_fpga.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "rig/formatted_text.hpp"

namespace abs_hil::emulator {

namespace {

constexpr std::int64_t ns_per_clock = 10;  // of ClockLow
/// A load of N bites N + 3 or 4 clocks after the write.
constexpr std::int64_t watchdog_lag_clocks = 4;
constexpr std::uint32_t pet_mark = 0x5A;
constexpr std::uint32_t pin_mask = 0x1FFFF;
constexpr std::uint32_t direction_bit = 0x80000000;
// Mode register of a PWM generator.
constexpr std::uint32_t width_mask = 3;
constexpr std::uint32_t double_buffered = 0x20;
enum Output : std::uint32_t { pwm_and_direction, swapped, up_and_down, pdm };
// Control register of a counter.
constexpr std::uint32_t error_bit = 0x8000;
constexpr std::uint32_t control_bits = 0x0FF8;  // those that a host sets

std::uint32_t bits_of(std::uint32_t mode) { return 9 + (mode & width_mask); }
std::uint32_t output_of(std::uint32_t mode) { return mode >> 3U & 3U; }

void check_pair(const char* what, std::uint32_t a, std::uint32_t b) {
  if (a < 2 && b < 2 && a != b) return;
  throw std::invalid_argument(std::string(what) + " " + std::to_string(a) + " and " + std::to_string(b) +
                              ": give 0 and 1, or 1 and 0");
}

}  // namespace

Hm2Fpga::Hm2Fpga(const Hm2Options& options) : UdpBoard(options), identity_(options.lie) {
  check_pair("PWM generators", options.drive_pwm, options.brake_pwm);
  check_pair("counters", options.lower_encoder, options.upper_encoder);
  if (options.enable_pin < -1 || options.enable_pin >= static_cast<std::int32_t>(port_count * pins_per_port)) {
    throw std::invalid_argument("enable pin " + std::to_string(options.enable_pin) + ": give -1 to 33");
  }
}

void Hm2Fpga::power_on() {
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

Hm2Fpga::Counter& Hm2Fpga::counter_of(bool upper_wheel) noexcept {
  return counters_[upper_wheel ? options_.upper_encoder : options_.lower_encoder];
}

// Registers.

std::uint32_t Hm2Fpga::read32(std::uint32_t address) const noexcept {
  const std::uint32_t reg = address >> 8U;
  const std::uint32_t i = (address & 0xFFU) / 4;
  if (reg == 0x0C) return i == 0 ? watchdog_counter() : 0;
  if (reg == 0x0D) return i == 0 ? status_ : 0;
  if (reg >= 0x10 && reg <= 0x14) return i < port_count ? read_port(reg, i) : 0;
  if (reg >= 0x30 && reg <= 0x34) return read_counter(reg, i);
  return reg < 0x0C ? identity_.word(address) : 0;
}

void Hm2Fpga::write32(std::uint32_t address, std::uint32_t value) {
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

std::uint32_t Hm2Fpga::read_port(std::uint32_t reg, std::uint32_t i) const noexcept {
  if (reg == 0x11) return ports_[i].ddr;
  if (reg != 0x10) return 0;  // alternate source, open drain and inversion cannot be read
  std::uint32_t levels = 0;
  for (std::uint32_t pin = 0; pin < pins_per_port; ++pin) levels |= (level(i * pins_per_port + pin) ? 1U : 0U) << pin;
  return levels;
}

void Hm2Fpga::write_port(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept {
  Port& port = ports_[i];
  const std::array<std::uint32_t*, 5> registers{&port.data, &port.ddr, &port.alternate, &port.open_drain, &port.invert};
  *registers[reg - 0x10] = value & pin_mask;
}

std::uint32_t Hm2Fpga::read_counter(std::uint32_t reg, std::uint32_t i) const noexcept {
  if (reg == 0x32 || reg == 0x34) return 0;
  if (reg == 0x33) return i == 0 ? time_stamp(time_ns()) : 0;
  if (i >= counters_.size()) return 0;
  const Counter& c = counters_[i];
  if (reg == 0x31) return c.control | (c.error ? error_bit : 0U) | encoder_lines(c);
  return (static_cast<std::uint32_t>(c.position - c.zero) & 0xFFFFU) | time_stamp(c.last_ns) << 16U;
}

void Hm2Fpga::write_counter(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept {
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

void Hm2Fpga::write_generator(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept {
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

void Hm2Fpga::load_watchdog(std::uint32_t clocks) {
  const bool was_armed = armed_;
  watchdog_time_ = clocks;
  last_pet_ns_ = time_ns();
  armed_ = clocks < disabled;
  bites_ns_ = time_ns() + (std::int64_t{clocks} + watchdog_lag_clocks) * ns_per_clock;
  if (was_armed && !armed_) bite_for("watchdog switched off");
}

std::uint32_t Hm2Fpga::watchdog_counter() const noexcept {
  if (!armed_) return watchdog_time_ >= disabled ? watchdog_time_ : 0xFFFFFFFF;
  return static_cast<std::uint32_t>(std::max<std::int64_t>(0, (bites_ns_ - time_ns()) / ns_per_clock));
}

void Hm2Fpga::bite_for(const std::string& why) {
  armed_ = false;
  status_ = 1;
  for (Port& port : ports_) port.ddr = port.open_drain = 0;
  log_.add(time_ns(), why);
  note_outputs(why);
}

bool Hm2Fpga::drives_pins() const noexcept {
  return std::any_of(ports_.begin(), ports_.end(), [](const Port& p) { return (p.ddr | p.open_drain) != 0; });
}

// Counters and their time stamps.

std::uint32_t Hm2Fpga::time_stamp(std::int64_t time_ns) const noexcept {
  return static_cast<std::uint32_t>(time_ns / ns_per_clock / (std::int64_t{stamp_divisor_} + 2)) & 0xFFFFU;
}

std::uint32_t Hm2Fpga::encoder_lines(const Counter& c) const noexcept {
  constexpr std::array<std::uint32_t, 4> phase{0, 1, 3, 2};  // A leads
  constexpr std::uint32_t index_bit = 4;
  return phase[static_cast<std::uint64_t>(c.position) % 4] |
         (c.position % options_.plant.rig.encoder_counts_per_rev == 0 ? index_bit : 0U);
}

/// Counts what a wheel has turned in a step in which its speed was constant, and finds the time of the last edge.
void Hm2Fpga::count(bool upper_wheel, double from_rad, double to_rad, std::int64_t from_ns,
                    std::int64_t to_ns) noexcept {
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

// Pins. Not driven, a pin is pulled high.

double Hm2Fpga::period_ns(const Generator& g) const noexcept {
  return 1e9 * std::ldexp(65536.0 / clock_high_Hz, static_cast<int>(bits_of(g.mode))) / pwm_rate_;
}

double Hm2Fpga::pwm_high_share(const Generator& g) const noexcept {
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

bool Hm2Fpga::pwm_high_now(const Generator& g) const noexcept {
  const double share = pwm_high_share(g);
  if (pwm_rate_ == 0) return share > 0.5;
  const double periods = static_cast<double>(time_ns()) / period_ns(g);
  return periods - std::floor(periods) < share;
}

double Hm2Fpga::high_share(std::uint32_t io) const noexcept {
  const Port& port = ports_[io / pins_per_port];
  const std::uint32_t bit = 1U << io % pins_per_port;
  const bool open_drain = (port.open_drain & bit) != 0;
  if ((port.ddr & bit) == 0 && !open_drain) return 1.0;
  double share = (port.data & bit) != 0 ? 1.0 : 0.0;
  if ((port.alternate & bit) != 0) share = bit == 2 ? pwm_high_share(generators_[io / pins_per_port]) : 0.0;
  return (port.invert & bit) != 0 ? 1.0 - share : share;
}

bool Hm2Fpga::level(std::uint32_t io) const noexcept {
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

Outputs Hm2Fpga::outputs() const noexcept {
  const auto acting = [this](std::uint32_t io) {
    return options_.active_high_stage ? high_share(io) : 1.0 - high_share(io);
  };
  const bool enabled = options_.enable_pin < 0 || acting(static_cast<std::uint32_t>(options_.enable_pin)) > 0.5;
  return {.drive_duty = emergency_stop() || !enabled ? 0.0 : acting(options_.drive_pwm * pins_per_port + 1),
          .brake_duty = acting(options_.brake_pwm * pins_per_port + 1)};
}

// Time.

std::int64_t Hm2Fpga::step_end_ns(std::int64_t next_ns) const noexcept {
  if (armed_) next_ns = std::clamp(bites_ns_, time_ns(), next_ns);
  for (const Generator& g : generators_) {
    if (g.waiting) next_ns = std::clamp(g.waits_until_ns, time_ns(), next_ns);
  }
  return next_ns;
}

void Hm2Fpga::after_step(const plant_sim::PlantState& before, std::int64_t from_ns) {
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

void Hm2Fpga::turn_by_hand(bool upper_wheel, double revolutions) {
  const plant_sim::PlantState before = plant().state();
  RigBehind::turn_by_hand(upper_wheel, revolutions);
  const plant_sim::PlantState& after = plant().state();
  count(upper_wheel, upper_wheel ? before.angle1_rad : before.angle2_rad,
        upper_wheel ? after.angle1_rad : after.angle2_rad, time_ns(), time_ns());
}

std::string Hm2Fpga::registers_text() const {
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

}  // namespace abs_hil::emulator
