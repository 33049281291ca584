#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "emulator/hm2_fpga.hpp"

namespace abs_hil::emulator {

/// The Mesa 7I92T as a host sees it through UDP: LBP16 commands in a datagram, their answers in another one. Where the
/// documents are silent this project chose: a command that the space does not take reads as zeros and counts as an
/// error; a datagram that breaks off, or whose answer would not fit into a packet, is obeyed up to that command.
///
/// In lock-step, space 5, which no hardware uses, holds the board's time in ns (8 bytes, little-endian). A host
/// advances the time by a write of all 8 bytes.
class Hm2Board final : public Hm2Fpga {
 public:
  static constexpr std::uint16_t port = 27181;
  static constexpr std::size_t largest_answer = 1472;

  /// Throws std::invalid_argument if an option is outside its range.
  explicit Hm2Board(const Hm2Options& options);

  [[nodiscard]] std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) override;
  void power_cycle() override;

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

  std::array<Memory, space_count> memory_{};
  std::array<std::uint32_t, space_count> pointers_{};
  std::int64_t power_on_ns_{0};
};

}  // namespace abs_hil::emulator
