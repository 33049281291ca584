// From an experiment's file and a configuration to the phases that run.
#include "config/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "abs_hil/rig/brake_map.hpp"
#include "config/config_error.hpp"

namespace abs_hil::config {

namespace {

using experiment::BrakeAction;
using experiment::EndKind;
using rig::Reason;

/// Slack on the time limit of phases that end by their duration.
constexpr double duration_slack_s = 1.0;

/// The kind of a phase in the CSV, derived where the script gives none.
rig::Phase kind_of(const PhaseScript& phase) {
  if (phase.kind) return *phase.kind;
  for (const auto& [word, kind] : words_of<rig::Phase>) {
    if (word == phase.name) return kind;
  }
  if (phase.brake.action() != BrakeAction::released) return rig::Phase::brake;
  return phase.motor ? rig::Phase::accelerate : rig::Phase::coast;
}

/// The value of the number under these settings. Throws ConfigError if it is out of its range.
double value_of(const Script& script, const Number& number, const KeyTable& keys) {
  if (number.key.empty()) return number.value;
  const Key* key = find_key(keys.keys(), number.key);
  const double value = key == nullptr ? std::nan("") : number_of(value_of(*key)).value_or(std::nan(""));
  if (!number.range.contains(value)) {
    throw ConfigError(fmt::format("{}: ${} is {} in this configuration; give a value in {}{}{}",
                                  script.at(number.place), number.key, value, number.range.text(),
                                  number.unit.empty() ? "" : " ", number.unit));
  }
  return value;
}

/// True if the condition holds under these settings.
bool holds(const When& when, const KeyTable& keys) {
  const Key* key = find_key(keys.keys(), when.key);
  if (key == nullptr) return false;
  if (const std::optional<double> value = number_of(value_of(*key))) {
    const double other = number_of(parse_value(*key, when.value)).value();  // the reader has checked it
    if (when.operation == "=") return *value == other;
    if (when.operation == "!=") return *value != other;
    if (when.operation == "<") return *value < other;
    if (when.operation == ">") return *value > other;
    return when.operation == "<=" ? *value <= other : *value >= other;
  }
  return (text_of(value_of(*key)) == when.value) == (when.operation == "=");
}

class Planner {
 public:
  Planner(const Script& script, const Settings& settings) : script_(script), settings_(settings), keys_(settings_) {}

  [[nodiscard]] Plan make() const {
    Plan plan;
    for (const PhaseScript& phase : script_.phases) {
      if (phase.when && !holds(*phase.when, keys_)) continue;
      plan.phases.push_back(planned(phase));
    }
    if (plan.phases.empty()) {
      throw ConfigError(
          fmt::format("{}: this configuration leaves out every phase by its \"when\"; change one", script_.path));
    }
    if (script_.limits.run_time) plan.limits.run_time_s = value(*script_.limits.run_time);
    if (script_.limits.distance) plan.limits.distance_m = value(*script_.limits.distance);
    return plan;
  }

 private:
  [[nodiscard]] double value(const Number& number) const { return value_of(script_, number, keys_); }

  [[nodiscard]] experiment::Profile profile(const ProfileScript& script) const {
    std::vector<experiment::Profile::Point> points;
    points.reserve(script.points.size());
    for (const auto& [time, number] : script.points) points.push_back({value(time), value(number)});
    return experiment::Profile(std::move(points), script.between);
  }

  [[nodiscard]] experiment::EndCondition condition(const ConditionScript& script) const {
    const experiment::EndRow& row = experiment::row_of(script.kind);
    experiment::EndCondition end{.kind = script.kind, .reason = row.reason};
    for (const ConditionScript& part : script.parts) end.parts.push_back(condition(part));
    if (row.takes_value()) end.value = value(script.value);
    return end;
  }

  [[nodiscard]] experiment::PhasePlan planned(const PhaseScript& phase) const {
    const std::optional<ProfileScript>& brake = phase.brake.profile();
    experiment::PhasePlan plan{.phase = kind_of(phase),
                               .name = phase.name,
                               .brake = phase.brake.action(),
                               .restart = phase.restart,
                               .wheels_apart = phase.wheels_apart,
                               .question = phase.ask};
    if (phase.motor) plan.motor_duty = profile(*phase.motor);
    if (brake) {
      (plan.brake == BrakeAction::slip_control ? plan.slip_ref
       : plan.brake == BrakeAction::duty       ? plan.brake_duty
                                               : plan.brake_torque_Nm) = profile(*brake);
    }
    for (const ConditionScript& script : phase.until) {
      if (!script.when || holds(*script.when, keys_)) plan.ends_on.push_back(condition(script));
    }
    if (plan.ends_on.empty()) {
      throw ConfigError(fmt::format("{}: this configuration leaves phase \"{}\" without an end condition; give one",
                                    script_.at(phase.place), phase.name));
    }
    plan.time_limit_s = time_limit_s(phase, plan);
    if (plan.brake == BrakeAction::slip_control && !ends_above(settings_.control.v_min_m_s, plan)) {
      // The laws are steep in 1 / v_x. Below this speed slip control ends, whatever the script says.
      plan.ends_on.push_back(
          {EndKind::car_speed_below, settings_.control.v_min_m_s, Reason::slip_control_left_at_low_speed});
    }
    return plan;
  }

  /// True if the phase ends before the car is slower than `v_min_m_s`.
  [[nodiscard]] static bool ends_above(double v_min_m_s, const experiment::PhasePlan& plan) {
    return std::any_of(plan.ends_on.begin(), plan.ends_on.end(), [=](const experiment::EndCondition& end) {
      return end.kind == EndKind::car_speed_below && end.value >= v_min_m_s;
    });
  }

  [[nodiscard]] double time_limit_s(const PhaseScript& phase, const experiment::PhasePlan& plan) const {
    if (phase.at_most) return value(*phase.at_most);
    double longest_s = 0.0;
    for (const experiment::EndCondition& end : plan.ends_on) {
      if (end.kind == EndKind::duration) longest_s = std::max(longest_s, end.value);
    }
    return longest_s + duration_slack_s;
  }

  const Script& script_;
  mutable Settings settings_;
  KeyTable keys_;
};

/// What a condition alone tells of the run when it holds; 0: nothing.
using Reached = std::function<double(const experiment::EndCondition&)>;

/// What has been reached at least when a condition holds, with its parts.
double reached_at(const experiment::EndCondition& end, const Reached& reached) {
  double least = reached(end);
  for (const experiment::EndCondition& part : end.parts) least = std::max(least, reached_at(part, reached));
  return least;
}

/// The same at the end of the phase, which any of its conditions may bring.
double reached_in(const experiment::PhasePlan& phase, const Reached& reached) {
  double least = std::numeric_limits<double>::infinity();
  for (const experiment::EndCondition& end : phase.ends_on) least = std::min(least, reached_at(end, reached));
  return least;
}

}  // namespace

double highest(const experiment::Profile& profile) {
  double most = 0.0;
  for (const experiment::Profile::Point& point : profile.points()) most = std::max(most, point.value);
  return most;
}

bool means_to_stop(const Plan& plan, double end_speed_m_s) {
  const auto& phases = plan.phases;
  const auto brakes = [](const experiment::PhasePlan& phase) { return phase.phase == rig::Phase::brake; };
  // The planner adds the least speed of slip control to a phase: it is not the script's own condition.
  const auto is_foreign = [](const experiment::EndCondition& end) {
    return end.reason == Reason::slip_control_left_at_low_speed;
  };
  const auto is_stop = [&](const experiment::EndCondition& end) {
    return end.kind == EndKind::standstill ||
           (end.kind == EndKind::car_speed_below && end.value <= end_speed_m_s && !is_foreign(end));
  };
  const auto last = std::find_if(phases.rbegin(), phases.rend(), brakes);
  if (last == phases.rend()) return false;
  return std::any_of(std::prev(last.base()), phases.end(), [&](const experiment::PhasePlan& phase) {
    return std::any_of(phase.ends_on.begin(), phase.ends_on.end(), is_stop) &&
           std::all_of(phase.ends_on.begin(), phase.ends_on.end(),
                       [&](const auto& end) { return is_stop(end) || is_foreign(end); });
  });
}

Plan plan(const Script& script, const Settings& settings) { return Planner(script, settings).make(); }

Plan plan(const Settings& settings) { return plan(*find(settings.experiment.name), settings); }

void apply(const Script& script, Settings& s) {
  const KeyTable keys(s);
  const LimitsScript& limits = script.limits;
  const auto tighten = [&](double& limit, const std::optional<Number>& wanted) {
    if (wanted) limit = std::min(limit, value_of(script, *wanted, keys));
  };
  tighten(s.gate.overspeed_rad_s, limits.wheel_speed);
  tighten(s.gate.motor_duty_max, limits.motor_duty);
  tighten(s.gate.brake_duty_max, limits.brake_duty);
  // As apply_board_limits does with a board's cap, so that gate and controllers know it.
  if (!s.on_rig()) s.gate.brake_duty_max = std::min(s.gate.brake_duty_max, s.plant.brake_duty_max);
  if (s.inject.empty()) {
    for (const EventScript& event : script.events) {
      if (!event.inject.empty()) s.inject += (s.inject.empty() ? "" : ",") + event.inject;
    }
  }
  for (const ChangingPart& part : changing_parts()) {
    if (part.profile(s).empty()) part.profile(s) = profile(script, part.what);
  }
}

std::vector<std::string> beyond_limits(const Plan& plan, const Settings& s) {
  std::vector<std::string> problems;
  const double most_torque_Nm =
      s.plant.ideal_actuator ? 1e9 : rig::brake_torque_at(s.model.brake, s.gate.brake_duty_max);
  for (std::size_t i = 0; i < plan.phases.size(); ++i) {
    const experiment::PhasePlan& phase = plan.phases[i];
    const auto compare = [&](double wanted, double most, std::string_view what, std::string_view unit,
                             std::string_view limit) {
      if (wanted > most) {
        problems.push_back(fmt::format("phase \"{}\": {} {:.6g}{} is more than the {:.6g}{} that gate.{} allows",
                                       phase.name, what, wanted, unit, most, unit, limit));
      }
    };
    compare(highest(phase.motor_duty), s.gate.motor_duty_max, "motor duty", "", "motor_duty_max");
    compare(highest(phase.brake_torque_Nm), most_torque_Nm, "brake torque", " N m", "brake_duty_max");
    compare(highest(phase.brake_duty), s.gate.brake_duty_max, "brake duty", "", "brake_duty_max");
  }
  return problems;
}

std::vector<std::string> certain_faults(const Plan& plan, const Settings& s) {
  std::vector<std::string> problems;
  const auto compare = [&](const std::string& what, double least, std::string_view limit, double most,
                           std::string_view unit) {
    constexpr double rounding = 1e-9;  // of the sums
    if (least <= most * (1.0 + rounding)) return;
    problems.push_back(fmt::format("{} at least {:.6g} {}, but {} is {:.6g} {}: every run ends as a fault; change one",
                                   what, least, unit, limit, most, unit));
  };
  const auto passed_s = [](const experiment::EndCondition& end) {
    return end.kind == EndKind::duration || end.kind == EndKind::upper_wheel_peak ? end.value : 0.0;
  };
  const auto passed_m = [](const experiment::EndCondition& end) {
    return end.kind == EndKind::distance ? end.value : 0.0;
  };
  const auto speed_rad_s = [&s](const experiment::EndCondition& end) {
    if (end.kind == EndKind::car_speed_above) return end.value / s.model.wheels.r2_m;
    return end.kind == EndKind::upper_speed_above || end.kind == EndKind::lower_speed_above ? end.value : 0.0;
  };
  double time_s = 0.0;
  double distance_m = 0.0;
  for (const experiment::PhasePlan& phase : plan.phases) {
    const double lasts_s = reached_in(phase, passed_s);
    compare(fmt::format("phase \"{}\" lasts", phase.name), lasts_s, "its at_most_s", phase.time_limit_s, "s");
    compare(fmt::format("phase \"{}\" waits for a wheel speed of", phase.name), reached_in(phase, speed_rad_s),
            "limits.wheel_speed_rad_s (gate.overspeed_rad_s)", s.gate.overspeed_rad_s, "rad/s");
    time_s += lasts_s;
    distance_m += reached_in(phase, passed_m);
  }
  compare("the run lasts", time_s, "limits.run_time_s", plan.limits.run_time_s, "s");
  compare("the car goes", distance_m, "limits.distance_m", plan.limits.distance_m, "m");
  return problems;
}

}  // namespace abs_hil::config
