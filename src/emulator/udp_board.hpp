#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abs_hil/plant_sim/plant.hpp"
#include "emulator/can_node.hpp"
#include "emulator/rig_behind.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::emulator {

/// A change of the duties at the power stages.
struct OutputChange {
  std::int64_t time_ns{0};  ///< the board's time
  Outputs now{};
};

/// The log of a board's outputs in the board's own time.
class OutputLog {
 public:
  void add(std::int64_t time_ns, const std::string& event) { events_.push_back({time_ns, event}); }
  /// Notes the duties if they have changed. `last_reload_ns`: when the watchdog was last reloaded, -1: never.
  void note(std::int64_t time_ns, const Outputs& now, const std::string& why, std::int64_t last_reload_ns) {
    const Outputs before = std::exchange(told_, now);
    if (now.drive_duty == before.drive_duty && now.brake_duty == before.brake_duty) return;
    changes_.push_back({time_ns, now});
    const auto zero = [](const Outputs& out) { return out.drive_duty == 0.0 && out.brake_duty == 0.0; };
    if (zero(now)) {
      const double since_ms = static_cast<double>(time_ns - last_reload_ns) * 1e-6;
      add(time_ns, "outputs zero: " + why +
                       (last_reload_ns < 0 ? "" : rig::formatted("; watchdog last reloaded %.3f ms ago", since_ms)));
    } else if (zero(before)) {
      add(time_ns, "outputs on: " + why);
    }
  }
  [[nodiscard]] std::vector<NodeEvent> take_events() { return std::exchange(events_, {}); }
  [[nodiscard]] std::vector<OutputChange> take_changes() { return std::exchange(changes_, {}); }

 private:
  Outputs told_{};
  std::vector<NodeEvent> events_{};
  std::vector<OutputChange> changes_{};
};

/// A board that a host talks to by datagrams, with the rig behind it.
class UdpBoard {
 public:
  UdpBoard() = default;
  UdpBoard(const UdpBoard&) = delete;
  UdpBoard& operator=(const UdpBoard&) = delete;
  virtual ~UdpBoard() = default;

  /// Obeys a datagram at the current time. Returns the answer; empty: there is none.
  [[nodiscard]] virtual std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) = 0;
  /// Advances rig and watchdog to `time_ns` (0 at the first power-on); an earlier time does nothing.
  virtual void advance_to(std::int64_t time_ns) = 0;
  /// Switches the board off and on: all registers as after power-on. The wheels go on turning.
  virtual void power_cycle() = 0;
  /// The watchdog bites now.
  virtual void bite() = 0;
  virtual void press_emergency_stop(bool pressed) = 0;  ///< cuts the drive only
  virtual void turn_by_hand(bool upper_wheel, double revolutions) = 0;
  /// Sets the quadrature error bit of a wheel's counter, if the board has one.
  virtual void make_quadrature_error(bool upper_wheel) = 0;

  [[nodiscard]] virtual std::int64_t time_ns() const noexcept = 0;
  [[nodiscard]] virtual Outputs outputs() const noexcept = 0;
  [[nodiscard]] virtual const plant_sim::Plant& plant() const noexcept = 0;
  [[nodiscard]] virtual bool bitten() const noexcept = 0;
  /// True while any pin is an output.
  [[nodiscard]] virtual bool drives_pins() const noexcept = 0;
  /// Datagrams with a command that writes something that acts: activations, commands, zeros.
  [[nodiscard]] virtual std::uint64_t writes() const noexcept = 0;
  [[nodiscard]] virtual OutputLog& log() noexcept = 0;
  /// All registers that a host has set, also those that it cannot read: "1100=00020002 ...".
  [[nodiscard]] virtual std::string registers_text() const = 0;
};

}  // namespace abs_hil::emulator
