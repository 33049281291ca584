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
    : factors_{over_time(profiles.brake_torque, "plant.brake_torque_profile"),
               over_time(profiles.motor_torque, "plant.motor_torque_profile"),
               over_time(profiles.upper_bearing, "plant.upper_bearing_profile"),
               over_time(profiles.lower_bearing, "plant.lower_bearing_profile")},
      any_(std::ranges::any_of(factors_, &FactorProgress::changes_anything)) {}

void Drift::start() noexcept {
  for (FactorProgress& factor : factors_) factor.start(0.0);
}

void Drift::brake_applied() noexcept {
  for (FactorProgress& factor : factors_) factor.brake_applied(0.0);
}

double Drift::part_s(double left_s, double max_step_s) const noexcept {
  double part_s = left_s;
  for (const FactorProgress& factor : factors_) {
    part_s = std::min(part_s, factor.time_left_s());
    if (factor.present(0.0).per_s != 0.0) part_s = std::min(part_s, max_step_s);
  }
  return part_s;
}

void Drift::pass(double duration_s) noexcept {
  for (FactorProgress& factor : factors_) {
    factor.pass(duration_s);
    factor.settle(0.0);
  }
}

double Drift::steady_s() const noexcept { return std::ranges::min(factors_, {}, &FactorProgress::steady_s).steady_s(); }

DriftFactors Drift::after(double time_s) const noexcept {
  const auto factor = [&](std::size_t n) { return factors_[n].present(0.0).after(time_s, 0.0); };
  return {factor(0), factor(1), factor(2), factor(3)};
}

}  // namespace abs_hil::plant_sim
