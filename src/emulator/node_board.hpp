#pragma once

#include <cstdint>

#include "emulator/udp_board.hpp"
#include "node_core.h"

namespace abs_hil::emulator {

/// The node of docs/node.md: the core of its firmware, and the simulated rig behind its pins. The chip's loop looks at
/// the counters and the watchdog at every step of the rig and at every datagram.
class NodeBoard final : public UdpBoard {
 public:
  /// Takes plant, start speed, MAC, address, lock-step and channels from `options`. A name that begins with "7I92"
  /// makes it present itself as that board. Throws std::invalid_argument as UdpBoard does.
  explicit NodeBoard(const Hm2Options& options);

  [[nodiscard]] std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) override;
  void power_cycle() override;
  void bite() override;
  void turn_by_hand(bool upper_wheel, double revolutions) override;

  [[nodiscard]] Outputs outputs() const noexcept override;
  [[nodiscard]] bool bitten() const noexcept override { return core_.latched; }
  [[nodiscard]] bool drives_pins() const noexcept override { return node_drives(&core_, 0) || node_drives(&core_, 1); }
  [[nodiscard]] std::string registers_text() const override;

 private:
  [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override;
  void after_step(const plant_sim::PlantState& /*before*/, std::int64_t /*from_ns*/) override { look(); }
  [[nodiscard]] std::uint32_t now_us() const noexcept { return static_cast<std::uint32_t>(time_ns() / 1000); }
  /// Advances the time as the commands of space 5 say, and returns the others.
  std::vector<std::uint8_t> obey_lock_step(std::span<const std::uint8_t> datagram);
  /// Puts what space 5 answers in place of the core's zeros.
  void answer_lock_step(std::span<const std::uint8_t> datagram, std::span<std::uint8_t> reply) const;
  /// What the chip's loop does: counters, then the watchdog.
  void look();
  void note_outputs(const std::string& why) override;

  node_identity identity_{};
  node_core core_{};
};

}  // namespace abs_hil::emulator
