#include "config/model.hpp"

#include <fmt/format.h>

#include <variant>

#include "config/key_table.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::config {

namespace {

double as_double(const Key& key) {
  if (const auto* whole = std::get_if<std::int32_t*>(&key.target)) return static_cast<double>(**whole);
  return *std::get<double*>(key.target);
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

std::vector<std::string> theta_out_of_bounds(const Settings& settings) {
  Settings copy = settings;
  const KeyTable table(copy);
  const std::string section = section_of(settings.control.controller);
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
