#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "emulator/udp_board.hpp"

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
  explicit Hm2Fpga(const Hm2Options& options);

  /// One register at a multiple of 4. Registers that cannot be read give 0.
  [[nodiscard]] std::uint32_t read32(std::uint32_t address) const noexcept;
  void write32(std::uint32_t address, std::uint32_t value);

  /// All registers as after power-on. The wheels go on turning.
  void power_on();
  void bite() override { bite_for("watchdog"); }
  void turn_by_hand(bool upper_wheel, double revolutions) override;
  void make_quadrature_error(bool upper_wheel) override { counter_of(upper_wheel).error = true; }

  [[nodiscard]] Outputs outputs() const noexcept override;
  [[nodiscard]] bool bitten() const noexcept override { return status_ != 0; }
  [[nodiscard]] bool drives_pins() const noexcept override;
  [[nodiscard]] std::string registers_text() const override;

 protected:
  Hm2Identity identity_;

 private:
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

  [[nodiscard]] std::uint32_t read_port(std::uint32_t reg, std::uint32_t i) const noexcept;
  void write_port(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept;
  [[nodiscard]] std::uint32_t read_counter(std::uint32_t reg, std::uint32_t i) const noexcept;
  void write_counter(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept;
  void write_generator(std::uint32_t reg, std::uint32_t i, std::uint32_t value) noexcept;
  void load_watchdog(std::uint32_t clocks);
  void bite_for(const std::string& why);
  [[nodiscard]] std::uint32_t watchdog_counter() const noexcept;
  [[nodiscard]] std::uint32_t time_stamp(std::int64_t time_ns) const noexcept;
  [[nodiscard]] double period_ns(const Generator& g) const noexcept;
  [[nodiscard]] double pwm_high_share(const Generator& g) const noexcept;
  [[nodiscard]] bool pwm_high_now(const Generator& g) const noexcept;
  [[nodiscard]] std::uint32_t encoder_lines(const Counter& c) const noexcept;
  [[nodiscard]] double high_share(std::uint32_t io) const noexcept;
  [[nodiscard]] bool level(std::uint32_t io) const noexcept;
  [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override;
  void after_step(const plant_sim::PlantState& before, std::int64_t from_ns) override;
  [[nodiscard]] Counter& counter_of(bool upper_wheel) noexcept;
  void count(bool upper_wheel, double from_rad, double to_rad, std::int64_t from_ns, std::int64_t to_ns) noexcept;
  void note_outputs(const std::string& why) override { log_.note(time_ns(), outputs(), why, last_pet_ns_); }

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
