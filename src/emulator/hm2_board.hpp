#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "emulator/hm2_fpga.hpp"
#include "emulator/hm2_identity.hpp"

namespace abs_hil::emulator {

/// The Mesa 7I92T as a host sees it through UDP: LBP16 commands in a datagram, their answers in another one. Where the
/// documents are silent this project chose: a command that the space does not take reads as zeros and counts as an
/// error; a datagram that breaks off, or whose answer would not fit into a packet, is obeyed up to that command.
///
/// In lock-step, space 5, which no hardware uses, holds the board's time in ns (8 bytes, little-endian). A host
/// advances the time by a write of all 8 bytes.
class Hm2Board final : public UdpBoard {
 public:
  static constexpr std::uint16_t port = 27181;
  static constexpr std::size_t largest_answer = 1472;

  /// Throws std::invalid_argument if an option is outside its range.
  explicit Hm2Board(const Hm2Options& options);

  [[nodiscard]] std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) override;
  void advance_to(std::int64_t time_ns) override { fpga_.advance_to(time_ns); }
  void power_cycle() override;
  void bite() override { fpga_.bite("watchdog"); }
  void press_emergency_stop(bool pressed) override { fpga_.press_emergency_stop(pressed); }
  void turn_by_hand(bool upper_wheel, double revolutions) override { fpga_.turn_by_hand(upper_wheel, revolutions); }
  void make_quadrature_error(bool upper_wheel) override { fpga_.make_quadrature_error(upper_wheel); }

  [[nodiscard]] Hm2Fpga& fpga() noexcept { return fpga_; }
  [[nodiscard]] const Hm2Fpga& fpga() const noexcept { return fpga_; }
  [[nodiscard]] std::int64_t time_ns() const noexcept override { return fpga_.time_ns(); }
  [[nodiscard]] Outputs outputs() const noexcept override { return fpga_.outputs(); }
  [[nodiscard]] const plant_sim::Plant& plant() const noexcept override { return fpga_.plant(); }
  [[nodiscard]] bool bitten() const noexcept override { return fpga_.bitten(); }
  [[nodiscard]] bool drives_pins() const noexcept override { return fpga_.drives_pins(); }
  /// Writes to the space of the timers do not count.
  [[nodiscard]] std::uint64_t writes() const noexcept override { return writes_; }
  [[nodiscard]] OutputLog& log() noexcept override { return fpga_.log(); }
  [[nodiscard]] std::string registers_text() const override { return fpga_.registers_text(); }

 private:
  static constexpr std::uint32_t space_count = 8;
  static constexpr std::uint32_t memory_bytes = 0x80;
  struct Access {
    bool write, info, increment;
    std::uint32_t space, unit_bytes, units;
  };
  using Memory = std::array<std::uint8_t, memory_bytes>;

  [[nodiscard]] static Access decoded(std::uint32_t command) noexcept;
  [[nodiscard]] bool takes(const Access& access) const noexcept;
  [[nodiscard]] std::uint32_t info_word(std::uint32_t space, std::uint32_t address) const noexcept;
  [[nodiscard]] std::uint64_t read(const Access& access, std::uint32_t address) const noexcept;
  void write(const Access& access, std::uint32_t address, std::uint64_t value);
  void write_control(std::uint32_t address);
  void count_error(std::uint32_t bit);
  void bump(std::uint32_t space, std::uint32_t address) noexcept;
  [[nodiscard]] std::uint64_t bytes(const Memory& memory, std::uint32_t address, std::uint32_t count) const noexcept;
  void put(std::uint32_t space, std::uint32_t address, std::uint32_t count, std::uint64_t value) noexcept;

  Hm2Options options_;
  Hm2Identity identity_;
  Hm2Fpga fpga_;
  std::array<Memory, space_count> memory_{};
  std::array<std::uint32_t, space_count> pointers_{};
  std::int64_t power_on_ns_{0};
  std::uint64_t writes_{0};
};

}  // namespace abs_hil::emulator
