#pragma once

#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "emulator/hm2_identity.hpp"
#include "emulator/rig_behind.hpp"

namespace abs_hil::emulator {

/// A board that a host talks to by datagrams, with the rig behind it.
class UdpBoard : public RigBehind {
 public:
  /// Throws std::invalid_argument if an option is outside its range.
  explicit UdpBoard(const Hm2Options& options)
      : RigBehind(options.plant, options.start_speed_rad_s), options_(options) {
    if (!options.name.empty() && options.name.size() <= 16) return;
    throw std::invalid_argument("board name \"" + options.name + "\": give 1 to 16 characters");
  }
  UdpBoard(const UdpBoard&) = delete;
  UdpBoard& operator=(const UdpBoard&) = delete;

  /// Obeys a datagram at the current time. Returns the answer; empty: there is none.
  [[nodiscard]] virtual std::vector<std::uint8_t> answer(std::span<const std::uint8_t> datagram) = 0;
  /// Switches the board off and on: all registers as after power-on. The wheels go on turning.
  virtual void power_cycle() = 0;
  /// The watchdog bites now.
  virtual void bite() = 0;
  /// Sets the quadrature error bit of a wheel's counter, as a wrong edge does, if the board has one.
  virtual void make_quadrature_error(bool /*upper_wheel*/) {}
  void press_emergency_stop(bool pressed) override {
    RigBehind::press_emergency_stop(pressed);
    note_outputs("emergency stop");
  }

  [[nodiscard]] virtual bool bitten() const noexcept = 0;
  /// True while any pin is an output.
  [[nodiscard]] virtual bool drives_pins() const noexcept = 0;
  /// Datagrams with a command that writes something that acts: activations, commands, zeros.
  [[nodiscard]] std::uint64_t writes() const noexcept { return writes_; }
  [[nodiscard]] OutputLog& log() noexcept { return log_; }
  /// All registers that a host has set, also those that it cannot read: "1100=00020002 ...".
  [[nodiscard]] virtual std::string registers_text() const = 0;

 protected:
  /// Notes the duties in the log if they have changed.
  virtual void note_outputs(const std::string& why) = 0;

  Hm2Options options_;
  OutputLog log_{};
  std::uint64_t writes_{0};
};

}  // namespace abs_hil::emulator
