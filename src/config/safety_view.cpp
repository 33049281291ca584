// The one view of what a run may do on a board, and the one rule that judges it.
#include "config/safety_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>
#include <variant>

#include "abs_hil/rig/option_check.hpp"

namespace abs_hil::config {

namespace {

using experiment::EndKind;
using experiment::PhasePlan;
using Verdict = SafetyRow::Verdict;

/// The longest that a phase can last without a fault.
double longest_s(const PhasePlan& phase) {
  double most_s = phase.time_limit_s;
  for (const experiment::EndCondition& end : phase.ends_on) {
    if (end.kind == EndKind::duration) most_s = std::min(most_s, end.value);
  }
  return most_s;
}

/// The highest wheel speed that a condition or its parts wait for; 0: none.
double awaited_rad_s(const experiment::EndCondition& end, double r2_m) {
  double most = 0.0;
  if (end.kind == EndKind::car_speed_above) most = end.value / r2_m;
  if (end.kind == EndKind::upper_speed_above || end.kind == EndKind::lower_speed_above) most = end.value;
  for (const experiment::EndCondition& part : end.parts) most = std::max(most, awaited_rad_s(part, r2_m));
  return most;
}

/// True if a person has consented: by the key in `unsafe.keys`, or by the flag that its row names.
bool is_accepted(const Key& key, const Settings& s, const KeyTable& keys) {
  if (fmt::format(",{},", s.unsafe.keys).find(fmt::format(",{},", key.name)) != std::string::npos) return true;
  const Key* flag = find_key(keys.keys(), fmt::format("unsafe.{}", key.safety.consent));
  return flag != nullptr && value_of(*flag) == Value(true);
}

std::string with_unit(const std::string& value, std::string_view unit) {
  return unit.empty() ? value : fmt::format("{} {}", value, unit);
}

}  // namespace

SafetyView safety_view(const Settings& s, const KeyTable& keys, const Plan& plan) {
  SafetyView view;
  const auto add = [&](const std::string& what, const std::string& value, const Key& key, bool weak) {
    const std::string_view flag = key.safety.consent;
    view.push_back({.what = what,
                    .value = with_unit(value, key.unit),
                    .bound = fmt::format("{}; {}", key.safety.in_words(key.unit), key.meaning),
                    .fix = fmt::format("--set unsafe.keys={}{}", key.name,
                                       flag.empty() ? "" : fmt::format(" or unsafe.{}=true", flag)),
                    .verdict = !weak                       ? Verdict::holds
                               : is_accepted(key, s, keys) ? Verdict::accepted
                                                           : Verdict::weak});
  };
  using Kind = rig::SafetyClass::Kind;
  for (const Key& key : keys.keys()) {
    const Kind kind = safety_of(key).kind;
    if (kind < Kind::above || kind > Kind::text) continue;  // no value weakens, or another rule judges
    add(key.name, text_of(value_of(key)), key,
        std::visit([&key](const auto* target) { return rig::weakens(key, *target); }, key.target));
  }
  // The keys' ranges let a car in. Limits from such an identity would protect no rig of a laboratory.
  for (const auto& [name, most] : {std::pair("rig.theta_N", 500.0), std::pair("rig.b1_Nm", 1000.0)}) {
    Key key = *find_key(keys.keys(), name);
    key.safety = rig::weaker_above(most);
    add(key.name, text_of(value_of(key)), key, rig::weakens(key, number_of(value_of(key)).value_or(0.0)));
  }
  const auto tell = [&view](const std::string& what, double value, std::string_view unit) {
    view.push_back({.what = what, .value = with_unit(fmt::format("{:.6g}", value), unit)});
  };
  // A number of the plan, by the row of the key that bounds it.
  const auto judge = [&](const std::string& what, double value, std::string_view name) {
    const Key& key = *find_key(keys.keys(), name);
    add(what, fmt::format("{:.6g}", value), key, rig::weakens(key, value));
  };
  // Phases that follow one another with the drive on are one drive, however a script divides it.
  double drive_s = 0.0, whole_s = 0.0;
  for (const PhasePlan& phase : plan.phases) {
    const std::string name = fmt::format("phase \"{}\": ", phase.name);
    const bool drives = !phase.motor_duty.zero();
    drive_s = drives ? drive_s + longest_s(phase) : 0.0;
    if (drives) {
      whole_s += longest_s(phase);
      tell(name + "drive duty at most", std::min(highest(phase.motor_duty), s.gate.motor_duty_max), "");
      judge(name + "drive on in a row for at most", drive_s, "experiment.accelerate_limit_s");
      const double awaited = awaited_rad_s({.parts = phase.ends_on}, s.rig.parameters.wheels.r2_m);
      if (awaited > 0.0) judge(name + "drives until a wheel turns at", awaited, "experiment.cut_speed_rad_s");
    }
    if (phase.brake == experiment::BrakeAction::released) continue;
    judge(name + "brake on for at most", longest_s(phase),
          phase.phase == rig::Phase::hold ? "experiment.hold_limit_s" : "experiment.brake_limit_s");
  }
  tell("drive on in the whole run for at most", whole_s, "s");
  return view;
}

std::vector<std::string> refuse_weak_rows(const SafetyView& view) {
  std::vector<std::string> accepted;
  for (const SafetyRow& row : view) {
    if (row.verdict == Verdict::weak)
      throw std::invalid_argument(
          fmt::format("{} = {}: this value weakens the protection of a real board ({}); give another one, or accept "
                      "the risk with {}",
                      row.what, row.value, row.bound, row.fix));
    if (row.verdict != Verdict::accepted) continue;
    accepted.push_back(fmt::format("{} = {} weakens the protection of this board ({}); unsafe. accepts it", row.what,
                                   row.value, row.bound));
  }
  return accepted;
}

std::string in_words(const SafetyView& view) {
  static constexpr std::array words{"", "  ok", "  WEAK", "  weak, accepted"};
  std::string text;
  for (const SafetyRow& row : view) {
    text += fmt::format("{} = {}{}{}\n", row.what, row.value.empty() ? "(empty)" : row.value,
                        words.at(static_cast<std::size_t>(row.verdict)),
                        row.bound.empty() ? "" : fmt::format(" ({})", row.bound));
  }
  return text;
}

}  // namespace abs_hil::config
