// Where the model differs from the plant, and settings that look like a mistake, in words.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "abs_hil/control/registry.hpp"
#include "abs_hil/rig/brake_map.hpp"
#include "abs_hil/rig/tyre_curve.hpp"
#include "config/key_table.hpp"
#include "config/merge.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::config {

namespace {

double as_double(const Key& key) { return number_of(value_of(key)).value(); }

/// Brake torque that holds a slip while the car slows down, from (1) and (2) at a constant slip; slow, so without
/// viscous friction.
double holding_torque_Nm(const rig::RigParameters& rig, double slip) {
  const rig::WheelParameters& w = rig.wheels;
  const double force_N = rig.tyre.theta_N * rig::normalised_tyre_force(rig.tyre, slip);
  const double lower_slows_rad_s2 = (w.r2_m * force_N + w.M20_Nm) / w.J2_kg_m2;
  return w.r1_m * force_N - w.M10_Nm + w.J1_kg_m2 * (1.0 - slip) * w.r2_m / w.r1_m * lower_slows_rad_s2;
}

std::string six_digits(double value) { return fmt::format("{:.6g}", value); }

}  // namespace

std::vector<ModelDifference> model_differences(const Settings& settings) {
  std::vector<ModelDifference> differences;
  Settings copy = settings;
  const KeyTable table(copy);
  for (const Key& key : table.keys()) {
    const Key* model = model_key(table.keys(), key.name);
    if (model == nullptr || as_double(*model) == as_double(key)) continue;
    differences.push_back({key.name.substr(key.name.find('.') + 1), as_double(*model), as_double(key)});
  }
  return differences;
}

std::string in_words(const std::vector<ModelDifference>& differences) {
  std::string text;
  for (const ModelDifference& d : differences) {
    if (six_digits(d.model) == six_digits(d.plant)) continue;  // a rounding, which nobody would see here
    text +=
        fmt::format("{}{} {} (plant {})", text.empty() ? "" : ", ", d.name, six_digits(d.model), six_digits(d.plant));
  }
  return text;
}

std::string standstill_too_early(const Settings& s) {
  if (s.plant.ideal_sensors) return {};
  const double rad_per_count = rig::radians_per_count(s.model.encoder_counts_per_rev);
  const double count_s = rad_per_count * s.model.wheels.r2_m / s.experiment.end_speed_m_s;
  if (count_s < s.control.observer.standstill_time_s) return {};
  return fmt::format(
      "control.observer.standstill_time_s = {:.3g} s: with {} counts a turn a car at "
      "experiment.end_speed_m_s = {:.3g} m/s gives a count every {:.3g} s and seems to stand; give more "
      "than that",
      s.control.observer.standstill_time_s, s.model.encoder_counts_per_rev, s.experiment.end_speed_m_s, count_s);
}

std::string slip_out_of_reach(const Script& script, const Settings& s) {
  const bool wanted = std::ranges::any_of(script.phases, [](const PhaseScript& phase) {
    return phase.brake.action() == experiment::BrakeAction::slip_control && !phase.brake.profile();
  });
  if (!wanted || s.gate.brake_duty_max >= 1.0 || s.plant.ideal_actuator) return {};
  // The lever's tyre has no theta of its own; the model's is fitted to it.
  const bool of_plant = !s.on_rig() && s.plant.load == "constant";
  const rig::RigParameters& rig = of_plant ? s.plant.rig : s.model;
  const rig::BrakeParameters& brake = s.on_rig() ? s.model.brake : s.plant.rig.brake;
  const double most_Nm = rig::brake_torque_at(brake, s.gate.brake_duty_max);
  const double least_slip = std::min(s.control.slip_ref, rig::peak_slip(rig.tyre));
  const double needed_Nm = holding_torque_Nm(rig, least_slip);
  if (needed_Nm <= most_Nm) return {};
  double reached = 0.0;
  for (double step = 0.5 * least_slip; step > 1e-4 * least_slip; step *= 0.5) {
    if (holding_torque_Nm(rig, reached + step) <= most_Nm) reached += step;
  }
  return fmt::format(
      "gate.brake_duty_max = {:.3g}: the brake gives at most {:.3g} N m, but a slip of {:.3g} takes {:.3g} N m at "
      "{}.theta_N = {:.6g} N, so control.slip_ref = {:.3g} is out of reach: the slip stays below about {:.2g}; raise "
      "the cap if brake and supply bear it, or give a control.slip_ref below {:.2g}",
      s.gate.brake_duty_max, most_Nm, least_slip, needed_Nm, of_plant ? "plant" : "model", rig.tyre.theta_N,
      s.control.slip_ref, reached, reached);
}

std::vector<std::string> negative_at_dead_zone(const Settings& s) {
  std::vector<std::string> problems;
  const auto judge = [&](std::string_view section, const rig::BrakeParameters& brake) {
    const double torque_Nm = brake.b1_Nm * brake.u0 + brake.b2_Nm;
    if (torque_Nm >= 0.0) return;
    const double ends_at = std::ceil(-brake.b2_Nm / brake.b1_Nm * 1e4) / 1e4;  // rounded up: b is not negative there
    problems.push_back(fmt::format(
        "{0}.u0 = {1:.6g}: the brake's map b(u) = b1_Nm u + b2_Nm is {2:.3g} N m there, below 0, so the brake gives "
        "nothing up to a duty of {3:.4g} and no log tells {0}.u0; {4}measure {0}.b1_Nm = {5:.6g} and "
        "{0}.b2_Nm = {6:.6g} again",
        section, brake.u0, torque_Nm, ends_at,
        ends_at < 1.0 ? fmt::format("give {}.u0 = {:.4g}, or ", section, ends_at) : "", brake.b1_Nm, brake.b2_Nm));
  };
  const rig::BrakeParameters& plant = s.plant.rig.brake;
  const rig::BrakeParameters& model = s.model.brake;
  const bool same = plant.u0 == model.u0 && plant.b1_Nm == model.b1_Nm && plant.b2_Nm == model.b2_Nm;
  if (!s.on_rig()) judge("plant", plant);
  if (s.on_rig() || !same) judge("model", model);
  return problems;
}

std::vector<std::string> theta_out_of_bounds(const Settings& settings) {
  Settings copy = settings;
  const KeyTable table(copy);
  const std::string section = control::section_of(settings.control.controller);
  const Key* least = find_key(table.keys(), section + "theta_min_N");
  const Key* most = find_key(table.keys(), section + "theta_max_N");
  std::vector<std::string> problems;
  if (least == nullptr || most == nullptr) return problems;
  const auto judge = [&](std::string_view name, double theta_N) {
    if (theta_N >= as_double(*least) && theta_N <= as_double(*most)) return;
    problems.push_back(
        fmt::format("{} = {:.6g} N lies outside the bounds of the estimate, [{:.6g}, {:.6g}] N: the estimate stays at "
                    "a bound; change {} or {}",
                    name, theta_N, as_double(*least), as_double(*most), least->name, most->name));
  };
  const bool plant_has_theta = !settings.on_rig() && settings.plant.load == "constant";
  if (plant_has_theta) judge("plant.theta_N", settings.plant.rig.tyre.theta_N);
  if (!plant_has_theta || settings.model.tyre.theta_N != settings.plant.rig.tyre.theta_N) {
    judge("model.theta_N", settings.model.tyre.theta_N);
  }
  return problems;
}

}  // namespace abs_hil::config
