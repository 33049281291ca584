// Parameters of the plant that drift with time.
#include "abs_hil/plant_sim/drift.hpp"

#include <algorithm>

namespace abs_hil::plant_sim {
namespace {

/// A profile over time alone: it ignores the wheel's angle and radius.
FactorProgress over_time(const std::string& profile, const char* key) {
  return {FactorProfile(profile, key, FactorProfile::Axes::time_only), 1.0};
}

}  // namespace

Drift::Drift(const DriftProfiles& profiles)
    : brake_torque_(over_time(profiles.brake_torque, "plant.brake_torque_profile")),
      motor_torque_(over_time(profiles.motor_torque, "plant.motor_torque_profile")),
      upper_bearing_(over_time(profiles.upper_bearing, "plant.upper_bearing_profile")),
      lower_bearing_(over_time(profiles.lower_bearing, "plant.lower_bearing_profile")),
      any_(brake_torque_.changes_anything() || motor_torque_.changes_anything() || upper_bearing_.changes_anything() ||
           lower_bearing_.changes_anything()) {}

void Drift::start() noexcept {
  for (FactorProgress* profile : {&brake_torque_, &motor_torque_, &upper_bearing_, &lower_bearing_})
    profile->start(0.0);
}

void Drift::brake_applied() noexcept {
  for (FactorProgress* profile : {&brake_torque_, &motor_torque_, &upper_bearing_, &lower_bearing_}) {
    profile->brake_applied(0.0);
  }
}

double Drift::part_s(double left_s, double max_step_s) const noexcept {
  double part_s = left_s;
  for (const FactorProgress* profile : {&brake_torque_, &motor_torque_, &upper_bearing_, &lower_bearing_}) {
    part_s = std::min(part_s, profile->time_left_s());
    if (profile->present(0.0).per_s != 0.0) part_s = std::min(part_s, max_step_s);
  }
  return part_s;
}

void Drift::pass(double duration_s) noexcept {
  for (FactorProgress* profile : {&brake_torque_, &motor_torque_, &upper_bearing_, &lower_bearing_}) {
    profile->pass(duration_s);
    profile->settle(0.0);
  }
}

double Drift::steady_s() const noexcept {
  return std::min(
      {brake_torque_.steady_s(), motor_torque_.steady_s(), upper_bearing_.steady_s(), lower_bearing_.steady_s()});
}

DriftFactors Drift::after(double time_s) const noexcept {
  const auto factor = [time_s](const FactorProgress& profile) { return profile.present(0.0).after(time_s, 0.0); };
  return {factor(brake_torque_), factor(motor_torque_), factor(upper_bearing_), factor(lower_bearing_)};
}

}  // namespace abs_hil::plant_sim
