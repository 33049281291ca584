// Advances the simulated rig under a board's outputs.
#include "emulator/rig_behind.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace abs_hil::emulator {

double rad_s_of_rpm(double rpm) noexcept {
  constexpr double seconds_per_minute = 60.0;
  return rpm * 2.0 * std::numbers::pi / seconds_per_minute;
}

RigBehind::RigBehind(const plant_sim::PlantOptions& plant, double start_speed_rad_s)
    : plant_(plant), upper_(plant_sim::upper_encoder(plant)), lower_(plant_sim::lower_encoder(plant)) {
  if (!(start_speed_rad_s >= 0.0) || !std::isfinite(start_speed_rad_s)) {
    throw std::invalid_argument("start speed " + std::to_string(start_speed_rad_s) +
                                " rad/s: give a finite value >= 0");
  }
  plant_.reset({.omega1_rad_s = start_speed_rad_s, .omega2_rad_s = start_speed_rad_s});
}

void RigBehind::advance_to(std::int64_t time_ns) {
  while (time_ns_ < time_ns) {
    const std::int64_t from_ns = time_ns_;
    const plant_sim::PlantState before = plant_.state();
    const std::int64_t next_ns = step_end_ns(std::min(time_ns, (from_ns / step_ns + 1) * step_ns));
    const Outputs out = outputs();
    plant_.advance(static_cast<double>(next_ns - from_ns) * 1e-9,
                   {.motor_duty = out.drive_duty, .brake_duty = out.brake_duty});
    time_ns_ = next_ns;
    after_step(before, from_ns);
  }
}

void RigBehind::turn_by_hand(bool upper_wheel, double revolutions) {
  plant_sim::PlantState state = plant_.state();
  (upper_wheel ? state.angle1_rad : state.angle2_rad) += revolutions * 2.0 * std::numbers::pi;
  plant_.reset(state);
}

std::int64_t RigBehind::position_at(bool upper_wheel, double angle_rad) const noexcept {
  return (upper_wheel ? upper_ : lower_).position(angle_rad);
}

std::int64_t RigBehind::position(bool upper_wheel) const noexcept {
  const plant_sim::PlantState& s = plant_.state();
  return position_at(upper_wheel, upper_wheel ? s.angle1_rad : s.angle2_rad);
}

double RigBehind::fastest_rad_s() const noexcept {
  const plant_sim::PlantState& s = plant_.state();
  return std::max(std::abs(s.omega1_rad_s), std::abs(s.omega2_rad_s));
}

}  // namespace abs_hil::emulator
