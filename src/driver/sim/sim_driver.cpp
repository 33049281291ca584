// The simulated rig as a board: it moves the plant on between two readings.
#include "driver/sim/sim_driver.hpp"

#include <cmath>
#include <random>
#include <stdexcept>
#include <string>

#include "rig/encoder_scale.hpp"

namespace abs_hil::driver {
namespace {

/// A number in [0, 1) from the generator's upper 32 bits: the same with every standard library, and far enough from 1
/// that no rounding reaches the next count.
double fraction_of_count(std::mt19937_64& generator) { return static_cast<double>(generator() >> 32U) * 0x1p-32; }

}  // namespace

CountOffsets count_offsets(std::uint64_t seed, double rad_per_count) {
  std::mt19937_64 generator(seed);
  const double upper_rad = fraction_of_count(generator) * rad_per_count;
  return {upper_rad, fraction_of_count(generator) * rad_per_count};
}

SimDriver::SimDriver(const plant_sim::PlantOptions& plant, const SimStart& start)
    : BoardDriver({.duty_steps = full_width(start.pwm_mode), .any_brake_duty = plant.ideal_actuator}),
      plant_(plant),
      upper_(plant_sim::upper_encoder(plant)),
      lower_(plant_sim::lower_encoder(plant)),
      start_(start) {
  if (!std::isfinite(start.start_speed_rad_s) || start.start_speed_rad_s < 0.0) {
    throw std::invalid_argument("start speed " + std::to_string(start.start_speed_rad_s) +
                                " rad/s: give a finite value >= 0");
  }
}

void SimDriver::do_activate(std::int64_t now_ns) {
  offsets_ = count_offsets(start_.seed, rig::radians_per_count(plant_.options().rig.encoder_counts_per_rev));
  plant_.reset({.omega1_rad_s = start_.start_speed_rad_s, .omega2_rad_s = start_.start_speed_rad_s});
  input_ = {};
  time_ns_ = now_ns;
}

IoResult SimDriver::do_read(std::int64_t now_ns, rig::Measurement& measurement) noexcept {
  if (now_ns > time_ns_) {
    plant_.advance(static_cast<double>(now_ns - time_ns_) * 1e-9, input_);
    time_ns_ = now_ns;
  }
  const plant_sim::PlantState& state = plant_.state();
  measurement = {};
  measurement.time_ns = time_ns_;
  measurement.upper_counts = upper_.counts(state.angle1_rad, offsets_.upper_rad);
  measurement.lower_counts = lower_.counts(state.angle2_rad, offsets_.lower_rad);
  if (plant_.options().ideal_sensors) {
    measurement.ideal_speeds = rig::WheelSpeeds{state.omega1_rad_s, state.omega2_rad_s};
  }
  return {};
}

IoResult SimDriver::do_write(const rig::Command& command, rig::Command& sent) noexcept {
  if (!in_range(command)) return {IoError::command_out_of_range};
  sent = grid_.as_sent(command);
  input_.motor_duty = sent.motor_duty;
  input_.brake_duty = sent.brake_duty;
  input_.brake_torque_Nm = sent.brake_torque_Nm;
  return {};
}

IoResult SimDriver::do_make_safe() noexcept {
  input_ = {};
  return {};
}

}  // namespace abs_hil::driver
