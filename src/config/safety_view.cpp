// The one view of what a run may do on a board, and the one rule that judges it.
#include "config/safety_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <utility>
#include <variant>

#include "abs_hil/rig/option_check.hpp"
#include "rig/formatted_text.hpp"

namespace abs_hil::config {

namespace {

using experiment::BrakeAction;
using experiment::EndKind;
using experiment::PhasePlan;
using Verdict = SafetyRow::Verdict;

bool drives(const PhasePlan& phase) { return !phase.motor_duty.zero(); }

/// True if some values of the key weaken the protection and others do not.
bool has_bound(const Key& key) {
  using Kind = rig::SafetyClass::Kind;
  const Kind kind = safety_of(key).kind;
  return kind == Kind::above || kind == Kind::below || kind == Kind::unless || kind == Kind::text;
}

/// The longest that a phase can last without a fault.
double longest_s(const PhasePlan& phase) {
  double most_s = phase.time_limit_s;
  for (const experiment::EndCondition& end : phase.ends_on) {
    if (end.kind == EndKind::duration) most_s = std::min(most_s, end.value);
  }
  return most_s;
}

double highest(const experiment::Profile& profile) {
  double most = 0.0;
  for (const experiment::Profile::Point& point : profile.points()) most = std::max(most, point.value);
  return most;
}

/// The highest wheel speed that a condition or its parts wait for; 0: none.
double awaited_rad_s(const experiment::EndCondition& end, double r2_m) {
  double most = 0.0;
  if (end.kind == EndKind::car_speed_above) most = end.value / r2_m;
  if (end.kind == EndKind::upper_speed_above || end.kind == EndKind::lower_speed_above) most = end.value;
  for (const experiment::EndCondition& part : end.parts) most = std::max(most, awaited_rad_s(part, r2_m));
  return most;
}

class Viewer {
 public:
  Viewer(const Settings& s, const KeyTable& keys) : s_(s), keys_(keys) {}

  /// Phases that follow one another with the drive on are one drive, however a script divides it.
  void add_plan(const Plan& plan) {
    double drive_s = 0.0;
    double most_drive_s = 0.0;
    for (const PhasePlan& phase : plan.phases) {
      const std::string name = fmt::format("phase \"{}\": ", phase.name);
      drive_s = drives(phase) ? drive_s + longest_s(phase) : 0.0;
      if (drives(phase)) {
        most_drive_s += longest_s(phase);
        tell(name + "drive duty at most", std::min(highest(phase.motor_duty), s_.gate.motor_duty_max), "");
        judge(name + "drive on in a row for at most", drive_s, "experiment.accelerate_limit_s");
        const double r2_m = s_.rig.parameters.wheels.r2_m;
        const double awaited = awaited_rad_s({.parts = phase.ends_on}, r2_m);
        if (awaited > 0.0) judge(name + "drives until a wheel turns at", awaited, "experiment.cut_speed_rad_s");
      }
      if (phase.brake == BrakeAction::released) continue;
      const bool holds = phase.phase == rig::Phase::hold;
      judge(name + "brake on for at most", longest_s(phase),
            holds ? "experiment.hold_limit_s" : "experiment.brake_limit_s");
    }
    tell("drive on in the whole run for at most", most_drive_s, "s");
  }

  void add_keys() {
    for (const Key& key : keys_.keys()) {
      if (!has_bound(key)) continue;
      const bool weak = std::visit([&key](const auto* target) { return rig::weakens(key, *target); }, key.target);
      add({.what = key.name, .value = with_unit(text_of(value_of(key)), key.unit)}, key, weak);
    }
  }

  [[nodiscard]] SafetyView made() && { return std::move(view_); }

 private:
  static std::string with_unit(std::string value, std::string_view unit) {
    return unit.empty() ? value : fmt::format("{} {}", value, unit);
  }

  void tell(std::string what, double value, std::string_view unit) {
    view_.push_back({.what = std::move(what), .value = with_unit(fmt::format("{:.6g}", value), unit)});
  }

  /// A number of the plan, by the row of the key that bounds it.
  void judge(std::string what, double value, std::string_view name) {
    const Key& key = *find_key(keys_.keys(), name);
    add({.what = std::move(what), .value = with_unit(fmt::format("{:.6g}", value), key.unit)}, key,
        rig::weakens(key, value));
  }

  void add(SafetyRow row, const Key& key, bool weak) {
    row.bound = fmt::format("{}; {}", key.safety.in_words(key.unit), key.meaning);
    row.key = key.name;
    row.consent = key.safety.consent;
    row.verdict = !weak ? Verdict::holds : accepts(key) ? Verdict::accepted : Verdict::weak;
    view_.push_back(std::move(row));
  }

  /// True if a person has consented: by the key in `unsafe.keys`, or by the flag that its row names.
  [[nodiscard]] bool accepts(const Key& key) const {
    const std::vector<std::string_view> named = rig::split(s_.unsafe.keys, ',');
    if (std::ranges::find(named, key.name) != named.end()) return true;
    const Key* flag = find_key(keys_.keys(), fmt::format("unsafe.{}", key.safety.consent));
    return flag != nullptr && value_of(*flag) == Value(true);
  }

  const Settings& s_;
  const KeyTable& keys_;
  SafetyView view_{};
};

}  // namespace

SafetyView safety_view(const Settings& s, const KeyTable& keys, const Plan& plan) {
  Viewer viewer(s, keys);
  viewer.add_keys();  // a phase whose number is a key's is refused by the key's name
  viewer.add_plan(plan);
  return std::move(viewer).made();
}

std::vector<std::string> refuse_weak_rows(const SafetyView& view) {
  std::vector<std::string> accepted;
  for (const SafetyRow& row : view) {
    if (row.verdict == Verdict::weak) {
      throw std::invalid_argument(fmt::format(
          "{} = {}: this value weakens the protection of a real board ({}); give another one, or accept the risk with "
          "--set unsafe.keys={}{}",
          row.what, row.value, row.bound, row.key,
          row.consent.empty() ? "" : fmt::format(" or unsafe.{}=true", row.consent)));
    }
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
