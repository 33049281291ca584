#pragma once

// An active driver on a board in virtual time.

#include <cstdint>

#include "catch.hpp"
#include "register_board.hpp"

namespace abs_hil::test {

using driver::IoResult;
using driver::hm2::Hm2Driver;
using driver::hm2::Hm2Options;

inline constexpr std::int64_t ms = 1'000'000;
inline constexpr rig::Command drive{.motor_duty = 0.5, .motor_enable = true};
inline constexpr rig::Command brake{.brake_duty = 0.25};

/// A board, its cable and a driver that is active, with a cycle of 1 ms.
struct Rig {
  explicit Rig(const Hm2Options& options = {}, double speed_rad_s = 0.0)
      : board(speed_rad_s), driver(options, cable.opener()) {
    driver.configure();
    driver.activate(0);
  }
  /// One cycle as the executive makes it.
  IoResult cycle(const rig::Command& command) {
    now_ns += ms;
    board.advance_to(now_ns);
    IoResult result = driver.read(now_ns, measurement);
    if (!result.ok()) return result;
    return driver.write(command, sent);
  }
  IoResult cycles(int count, const rig::Command& command) {
    IoResult result{};
    for (int i = 0; i < count && result.ok(); ++i) result = cycle(command);
    return result;
  }
  /// Time passes without the program until both outputs are 0; returns how long that took.
  std::int64_t until_off() {
    const std::int64_t from_ns = now_ns;
    while (is_on() && now_ns < from_ns + 1000 * ms) board.advance_to(now_ns += ms / 10);
    return now_ns - from_ns;
  }
  [[nodiscard]] bool is_on() const { return board.outputs().drive_duty + board.outputs().brake_duty > 0.0; }

  RegisterBoard board;
  Cable cable{board};
  Hm2Driver driver;
  std::int64_t now_ns{0};
  rig::Measurement measurement{};
  rig::Command sent{};
};

inline bool is_cycle_write(const RegisterBoard::Bytes& request) { return request.size() == 40; }
inline bool is_cycle_read(const RegisterBoard::Bytes& request) { return request.size() == 44; }

}  // namespace abs_hil::test
