#include "emulator/rig_behind.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

namespace abs_hil::emulator {

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

double rad_s_of_rpm(double rpm) noexcept {
  constexpr double seconds_per_minute = 60.0;
  return rpm * 2.0 * std::numbers::pi / seconds_per_minute;
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

}  // namespace abs_hil::emulator
