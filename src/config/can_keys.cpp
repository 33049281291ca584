#include "config/can_keys.hpp"

#include "config/board_ranges.hpp"

namespace abs_hil::config {

void add_can_keys(std::vector<Key>& keys, driver::can::CanOptions& c) {
  keys.insert(
      keys.end(),
      {
          {"driver.can.interface", "", "CAN interface of the node; unix:PATH: an emulator's socket in its place",
           &c.interface},
          {"driver.can.fd",
           "",
           "CAN FD frames; auto: where interface and node have them",
           &c.fd,
           {},
           {"auto", "on", "off"}},
          {"driver.can.watchdog_ms",
           "ms",
           "the node zeroes its outputs so long after the last valid command",
           &c.watchdog_ms,
           {5, 10'000}},
          {"driver.can.answer_timeout_us",
           "us",
           "longest wait for the node's answer, at most 80 % of the period; 0: 60 % of it",
           &c.answer_timeout_us,
           {0, 8000}},
          {"driver.can.motor_duty_max", "", "largest drive PWM the driver sends", &c.motor_duty_max, board_duty_cap},
          {"driver.can.brake_duty_max", "", "largest brake PWM the driver sends; caps gate.brake_duty_max",
           &c.brake_duty_max, board_duty_cap},
          {"driver.can.lower_sign", "", "1, or -1 if the counter counts down going forward", &c.lower_sign,
           counting_direction},
          {"driver.can.upper_sign", "", "1, or -1 if the counter counts down going forward", &c.upper_sign,
           counting_direction},
          {"driver.can.loss_cost", "", "points that a lost or wrong frame costs", &c.loss_cost, {0, 1000}},
          {"driver.can.loss_relief", "", "points that a good answer takes off", &c.loss_relief, {0, 1000}},
          {"driver.can.loss_limit", "", "points that end the run", &c.loss_limit, {1, 1'000'000}},
          {"driver.can.plausible_speed_rad_s",
           "rad/s",
           "a counter that goes faster is a fault",
           &c.plausible_speed_rad_s,
           {10, 100'000}},
      });
}

}  // namespace abs_hil::config
