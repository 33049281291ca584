#include "emulator/rig_behind.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

namespace abs_hil::emulator {

double rad_s_of_rpm(double rpm) noexcept {
  constexpr double seconds_per_minute = 60.0;
  return rpm * 2.0 * std::numbers::pi / seconds_per_minute;
}

void start_wheels(plant_sim::Plant& plant, double speed_rad_s) {
  if (!(speed_rad_s >= 0.0) || !std::isfinite(speed_rad_s)) {
    throw std::invalid_argument("start speed " + std::to_string(speed_rad_s) + " rad/s: give a finite value >= 0");
  }
  plant.reset({.omega1_rad_s = speed_rad_s, .omega2_rad_s = speed_rad_s});
}

double fastest_rad_s(const plant_sim::Plant& plant) noexcept {
  const plant_sim::PlantState& s = plant.state();
  return std::max(std::abs(s.omega1_rad_s), std::abs(s.omega2_rad_s));
}

void turn_wheel(plant_sim::Plant& plant, bool upper_wheel, double revolutions) noexcept {
  plant_sim::PlantState state = plant.state();
  (upper_wheel ? state.angle1_rad : state.angle2_rad) += revolutions * 2.0 * std::numbers::pi;
  plant.reset(state);
}

std::int64_t step_end_ns(std::int64_t from_ns, std::int64_t to_ns, std::int64_t step_ns) noexcept {
  return std::min(to_ns, (from_ns / step_ns + 1) * step_ns);
}

void step(plant_sim::Plant& plant, std::int64_t duration_ns, const Outputs& out) noexcept {
  plant.advance(static_cast<double>(duration_ns) * 1e-9, {.motor_duty = out.drive_duty, .brake_duty = out.brake_duty});
}

RigBehind::RigBehind(const plant_sim::PlantOptions& plant, double start_speed_rad_s)
    : plant_(plant), upper_(plant_sim::upper_encoder(plant)), lower_(plant_sim::lower_encoder(plant)) {
  start_wheels(plant_, start_speed_rad_s);
}

void RigBehind::advance_to(std::int64_t time_ns) {
  while (time_ns_ < time_ns) {
    const std::int64_t next_ns = this->step_end_ns(emulator::step_end_ns(time_ns_, time_ns, step_ns));
    step(plant_, next_ns - time_ns_, outputs());
    time_ns_ = next_ns;
    after_step();
  }
}

void RigBehind::turn_by_hand(bool upper_wheel, double revolutions) noexcept {
  turn_wheel(plant_, upper_wheel, revolutions);
}

std::int64_t RigBehind::count(bool upper_wheel) const noexcept {
  const plant_sim::PlantState& s = plant_.state();
  return upper_wheel ? upper_.position(s.angle1_rad) : lower_.position(s.angle2_rad);
}

double RigBehind::fastest_rad_s() const noexcept { return emulator::fastest_rad_s(plant_); }

}  // namespace abs_hil::emulator
