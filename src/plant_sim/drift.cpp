// Parameters of the plant that drift with time, and dead time, curved map, fading and hysteresis of its brake.
#include "abs_hil/plant_sim/drift.hpp"

#include <algorithm>

#include "abs_hil/rig/scalar.hpp"

namespace abs_hil::plant_sim {
namespace {

/// A profile over time alone: it ignores the wheel's angle and radius.
FactorProgress over_time(const std::string& profile, const char* key) {
  return {FactorProfile(profile, key, FactorProfile::Axes::time_only), 1.0};
}

/// Changes of the duty on their way at most: those of the longest dead time at 10 kHz. Beyond them the newest replaces
/// the one before.
constexpr std::size_t changes_most = 2048;
/// Rounding error of the sum of a run's intervals; a change that is due within it is due.
constexpr double due_rounding_s = 1e-11;

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

BrakePath::BrakePath(const BrakeFlaws& flaws, double full_Nm, bool ideal_actuator)
    : dead_time_s_(flaws.dead_time_s),
      hysteresis_(ideal_actuator ? 0.0 : flaws.hysteresis),
      fading_per_J_(ideal_actuator ? 0.0 : flaws.fading_per_J),
      cooling_per_s_(flaws.cooling_per_s),
      curvature_(ideal_actuator || !(full_Nm > 0.0) ? 0.0 : flaws.curvature),
      full_Nm_(full_Nm),
      release_ratio_(ideal_actuator ? 1.0 : flaws.release_ratio),
      changes_(!ideal_actuator && flaws.dead_time_s > 0.0 ? changes_most : 0) {}

void BrakePath::start() noexcept {
  first_ = count_ = 0;
  time_s_ = newest_ = duty_ = held_Nm_ = heat_J_ = 0.0;
}

void BrakePath::command(double duty) noexcept {
  if (!delays()) {
    duty_ = duty;
    return;
  }
  settle();
  if (duty == newest_) return;
  newest_ = duty;
  if (count_ == changes_.size()) --count_;
  changes_[(first_ + count_) % changes_.size()] = {time_s_ + dead_time_s_, duty};
  ++count_;
}

double BrakePath::part_s(double left_s, double max_step_s) const noexcept {
  double part_s = left_s;
  if (count_ > 0) part_s = std::min(part_s, next().due_s - time_s_);
  if (fades()) part_s = std::min(part_s, max_step_s);
  return part_s;
}

double BrakePath::transmitted_Nm(double static_Nm, double part_s, double power_W) noexcept {
  // Fading acts as it is in the part's middle.
  const double heat_J = heat_J_ * (1.0 + cooled(part_s)) + 0.5 * part_s * power_W;
  const double target_Nm = static_Nm * (1.0 + rig::exponential_less_one(-fading_per_J_ * heat_J));
  held_Nm_ = std::clamp(held_Nm_, (1.0 - hysteresis_) * target_Nm, (1.0 + hysteresis_) * target_Nm);
  return held_Nm_;
}

void BrakePath::pass(double part_s, double energy_J) noexcept {
  time_s_ += part_s;
  // The energy comes in in the part's middle.
  const double kept = 1.0 + cooled(part_s);
  heat_J_ = (heat_J_ * kept + energy_J) * kept;
  settle();
}

double BrakePath::cooled(double part_s) const noexcept {
  return rig::exponential_less_one(-0.5 * cooling_per_s_ * part_s);
}

void BrakePath::settle() noexcept {
  for (; count_ > 0 && next().due_s <= time_s_ + due_rounding_s; --count_) {
    duty_ = next().duty;
    first_ = (first_ + 1) % changes_.size();
  }
}

}  // namespace abs_hil::plant_sim
