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

BrakePath::BrakePath(const BrakeFlaws& flaws, const rig::BrakeParameters& brake, bool ideal_actuator)
    : brake_(brake),
      delay_(ideal_actuator ? rig::BrakeDelay() : rig::BrakeDelay(brake)),
      hysteresis_(ideal_actuator ? 0.0 : flaws.hysteresis),
      fading_per_J_(ideal_actuator ? 0.0 : flaws.fading_per_J),
      cooling_per_s_(flaws.cooling_per_s),
      curvature_(flaws.curvature),
      full_Nm_(rig::brake_torque_at(brake, 1.0)),
      release_ratio_(ideal_actuator ? 1.0 : flaws.release_ratio),
      overshoot_(ideal_actuator ? 0.0 : flaws.overshoot),
      overshoot_per_s_(flaws.overshoot_per_s) {
  if (ideal_actuator || !(full_Nm_ > 0.0)) curvature_ = 0.0;
}

void BrakePath::start() noexcept {
  delay_.start();
  duty_ = engaged_ = held_Nm_ = heat_J_ = 0.0;
}

void BrakePath::command(double duty) noexcept {
  if (delay_.any()) delay_.send(duty);
  duty_ = delay_.any() ? delay_.duty() : duty;
}

double BrakePath::part_s(double left_s, double max_step_s) const noexcept {
  const bool overshoots = overshoot_ > 0.0 && duty_ >= 1.0 && engaged_ < 1.0;
  const double most_s = fades() || overshoots ? max_step_s : left_s;
  return std::min({left_s, delay_.steady_s(), most_s});
}

double BrakePath::static_Nm(double part_s) const noexcept {
  double torque_Nm = rig::brake_torque_at(brake_, duty_);
  if (curvature_ != 0.0) torque_Nm *= 1.0 + curvature_ * (torque_Nm / full_Nm_ - 1.0);
  // The overshoot acts as it is in the part's middle.
  if (overshoot_ > 0.0 && duty_ >= 1.0) torque_Nm *= 1.0 + overshoot_ * (1.0 - engaged_after(0.5 * part_s));
  return torque_Nm;
}

double BrakePath::engaged_after(double time_s) const noexcept {
  const double to = duty_ >= brake_.u0 ? 1.0 : 0.0;
  return engaged_ + (engaged_ - to) * rig::exponential_less_one(-overshoot_per_s_ * time_s);
}

double BrakePath::transmitted_Nm(double static_Nm, double part_s, double power_W) noexcept {
  // Fading acts as it is in the part's middle.
  const double heat_J = heat_J_ * (1.0 + cooled(part_s)) + 0.5 * part_s * power_W;
  const double target_Nm = static_Nm * (1.0 + rig::exponential_less_one(-fading_per_J_ * heat_J));
  held_Nm_ = std::clamp(held_Nm_, (1.0 - hysteresis_) * target_Nm, (1.0 + hysteresis_) * target_Nm);
  return held_Nm_;
}

void BrakePath::pass(double part_s, double energy_J) noexcept {
  // The energy comes in in the part's middle.
  const double kept = 1.0 + cooled(part_s);
  heat_J_ = (heat_J_ * kept + energy_J) * kept;
  if (overshoot_ > 0.0) engaged_ = engaged_after(part_s);
  if (!delay_.any()) return;
  delay_.pass(part_s);
  duty_ = delay_.duty();
}

double BrakePath::cooled(double part_s) const noexcept {
  return rig::exponential_less_one(-0.5 * cooling_per_s_ * part_s);
}

}  // namespace abs_hil::plant_sim
