#pragma once

#include <cstdint>
#include <string>

namespace abs_hil::driver::can {

/// Everything below `driver.can.` in the configuration.
struct CanOptions {
  /// Network interface. "unix:PATH": a socket of type SOCK_SEQPACKET on which an emulator listens.
  std::string interface {
    "can0"
  };
  std::string fd{"auto"};        ///< CAN FD frames: "auto", "on" or "off"
  std::int32_t watchdog_ms{20};  ///< the node zeroes its outputs this time after the last valid command, 5 ... 10000
  std::int32_t answer_timeout_us{0};     ///< longest wait for the answer to a SYNC; 0: 60 % of the period
  double motor_duty_max{1.0};            ///< in (0, 1]
  double brake_duty_max{0.7};            ///< in (0, 1]; the vendor's driver caps the brake's supply current at this
  std::int32_t upper_sign{1};            ///< 1, or -1 if the counter counts down for forward motion
  std::int32_t lower_sign{1};            ///< as `upper_sign`
  std::int32_t loss_cost{2};             ///< points that a lost or wrong frame adds to the leaky bucket, >= 0
  std::int32_t loss_relief{1};           ///< points that a good answer takes off, >= 0
  std::int32_t loss_limit{10};           ///< number of points at which the run ends, >= 1
  double plausible_speed_rad_s{1000.0};  ///< a counter that moves faster is a fault, rad/s, > 0
  // Copied from other tables of the configuration.
  std::int32_t encoder_counts_per_rev{4096};
  double rate_Hz{1000.0};  ///< cycles per second
};

}  // namespace abs_hil::driver::can
