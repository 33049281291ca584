#pragma once

#include <cstdint>

#include "emulator/hm2_identity.hpp"
#include "emulator/rig_behind.hpp"
#include "emulator/udp_board.hpp"
#include "node_core.h"

namespace abs_hil::emulator {

/// The node of docs/node.md: the core of its firmware, and the simulated rig behind its pins. The chip's loop looks at
/// the counters and the watchdog at every step of the rig and at every datagram.
class NodeBoard final : public UdpBoard {
 public:
  /// Takes plant, start speed, MAC, address, lock-step and channels from `options`. A name that begins with "7I92"
  /// makes it present itself as that board. Throws std::invalid_argument if an option is outside its range.
  explicit NodeBoard(const Hm2Options& options);

  [[nodiscard]] std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) override;
  void advance_to(std::int64_t time_ns) override { rig_.advance_to(time_ns); }
  void power_cycle() override;
  void bite() override;
  void press_emergency_stop(bool pressed) override;
  void turn_by_hand(bool upper_wheel, double revolutions) override;
  void make_quadrature_error(bool /*upper_wheel*/) override {}  // the chip's counters have no such bit

  [[nodiscard]] std::int64_t time_ns() const noexcept override { return rig_.time_ns(); }
  [[nodiscard]] Outputs outputs() const noexcept override { return rig_.outputs(); }
  [[nodiscard]] const plant_sim::Plant& plant() const noexcept override { return rig_.plant(); }
  [[nodiscard]] bool bitten() const noexcept override { return core_.latched; }
  [[nodiscard]] bool drives_pins() const noexcept override { return node_drives(&core_, 0) || node_drives(&core_, 1); }
  [[nodiscard]] std::uint64_t writes() const noexcept override { return writes_; }
  [[nodiscard]] OutputLog& log() noexcept override { return log_; }
  [[nodiscard]] std::string registers_text() const override;

 private:
  class Rig final : public RigBehind {
   public:
    Rig(NodeBoard& board, const Hm2Options& options)
        : RigBehind(options.plant, options.start_speed_rad_s), board_(board) {}
    [[nodiscard]] Outputs outputs() const noexcept override;
    using RigBehind::position;

   private:
    [[nodiscard]] std::int64_t step_end_ns(std::int64_t next_ns) const noexcept override;
    void after_step(const plant_sim::PlantState& /*before*/, std::int64_t /*from_ns*/) override { board_.look(); }
    NodeBoard& board_;
  };

  [[nodiscard]] std::uint32_t now_us() const noexcept { return static_cast<std::uint32_t>(rig_.time_ns() / 1000); }
  /// Advances the time as the commands of space 5 say.
  void obey_lock_step(std::span<const std::uint8_t> datagram);
  /// Puts what space 5 answers in place of the core's zeros.
  void answer_lock_step(std::span<const std::uint8_t> datagram, std::span<std::uint8_t> reply) const;
  /// What the chip's loop does: counters, then the watchdog.
  void look();
  void note(const std::string& why);

  Hm2Options options_;
  node_identity identity_{};
  node_core core_{};
  Rig rig_;
  OutputLog log_{};
  std::uint64_t writes_{0};
};

}  // namespace abs_hil::emulator
