#include "config/grammar.hpp"

#include <algorithm>

namespace abs_hil::config {

namespace {

constexpr double day_s = 86'400.0;
constexpr rig::Range duration = rig::from_zero(day_s);
/// No phase lasts longer, whatever it waits for (experiment::Sequence), its slack of a second included.
constexpr rig::Range phase_limit = rig::positive(600.0);
constexpr rig::Range phase_duration = rig::from_zero(599.0);
constexpr rig::Range span = rig::positive(day_s);
constexpr rig::Range wheel_speed = rig::from_zero(2000.0);
constexpr rig::Range car_speed = rig::from_zero(200.0);
constexpr rig::Range way = rig::positive(1e5);
constexpr rig::Range duty = rig::from_zero(1.0);
constexpr rig::Range torque = rig::from_zero(100.0);
constexpr rig::Range slip = rig::open_between(0.0, 1.0);
constexpr rig::Range any_slip = rig::between(-1.0, 1.0);
constexpr rig::Range factor = rig::positive(10.0);
constexpr rig::Range anything = rig::between(-1e9, 1e9);

}  // namespace

const Field* Grammar::find(std::string_view name) const noexcept {
  const auto is_it = [name](const Field& field) {
    if (!name.starts_with(field.name)) return false;
    const std::string_view rest = name.substr(field.name.size());
    return rest.empty() || rest == suffix_of(field.quantity);
  };
  const auto at = std::find_if(fields.begin(), fields.end(), is_it);
  return at == fields.end() ? nullptr : &*at;
}

std::vector<std::string> Grammar::spellings() const {
  std::vector<std::string> names;
  for (const Field& field : fields) {
    names.emplace_back(field.name);
    if (field.quantity != Quantity::none) {
      names.push_back(std::string(field.name) + std::string(suffix_of(field.quantity)));
    }
  }
  return names;
}

const Grammar& script_grammar() {
  static const Grammar grammar{
      "the script",
      "An experiment of abs_hil (docs/experiments.md)",
      {
          {.name = "description", .shape = Shape::text, .meaning = "what the experiment is, in a line"},
          {.name = "author", .shape = Shape::text, .meaning = "who wrote it"},
          {.name = "notes", .shape = Shape::text, .meaning = "anything else worth keeping with the results"},
          {.name = "analysis",
           .shape = Shape::choice,
           .meaning = "what is computed from the run beside its metrics",
           .allowed = {"friction-curve"}},
          {.name = "settings",
           .shape = Shape::settings,
           .meaning = "configuration values of the experiment; --config, options and --set override them"},
          {.name = "phase",
           .shape = Shape::tables,
           .meaning = "the phases, in order",
           .grammar = &phase_grammar(),
           .required = true},
          {.name = "limits",
           .shape = Shape::table,
           .meaning = "limits of this experiment; they can only tighten those of the configuration",
           .grammar = &limits_grammar()},
          {.name = "event",
           .shape = Shape::tables,
           .meaning = "what happens to the simulated plant; the rig refuses it",
           .grammar = &event_grammar()},
          {.name = "series",
           .shape = Shape::table,
           .meaning = "the experiment is run several times",
           .grammar = &series_grammar()},
          {.name = "vary",
           .shape = Shape::grid,
           .meaning = "configuration values that the runs of a series differ in: every combination is run"},
      }};
  return grammar;
}

const Grammar& phase_grammar() {
  static const Grammar grammar{
      "[[phase]]",
      "One phase: what acts, and what ends it",
      {
          {.name = "name", .shape = Shape::text, .meaning = "its name, in displays and events", .required = true},
          {.name = "kind",
           .shape = Shape::choice,
           .meaning = "the CSV's word for it; without: the name if it is one of these, else by what acts",
           .allowed = {"idle", "accelerate", "coast", "brake", "hold", "stopped"}},
          {.name = "when",
           .shape = Shape::condition,
           .meaning = "the phase is left out unless this holds for the configuration"},
          {.name = "motor", .shape = Shape::motor, .meaning = "drive PWM of the lower wheel's motor", .range = duty},
          {.name = "brake",
           .shape = Shape::brake,
           .meaning = "what drives the brake; or a table of duty, torque_Nm or slip_ref",
           .allowed = {"off", "controller"},
           .grammar = &brake_grammar()},
          {.name = "until",
           .shape = Shape::table,
           .meaning = "what ends the phase: one condition, or any or all of several",
           .grammar = &until_grammar(),
           .required = true},
          {.name = "at_most",
           .shape = Shape::number,
           .meaning = "a phase that lasts longer is a fault; may be left out if the phase ends by its duration",
           .quantity = Quantity::time,
           .range = phase_limit},
      }};
  return grammar;
}

const Grammar& until_grammar() {
  // Lists of conditions hold tables of the same kind: the grammar refers to itself.
  static Grammar grammar{"until", "What ends a phase", {}};
  static const bool filled = [] {
    using enum Quantity;
    const auto add = [](std::string_view name, Quantity quantity, rig::Range range, std::string_view meaning) {
      grammar.fields.push_back(
          {.name = name, .shape = Shape::number, .meaning = meaning, .quantity = quantity, .range = range});
    };
    add("lasts", time, phase_duration, "the phase has lasted this long");
    add("upper_speed_above", angular_speed, wheel_speed, "the upper wheel is at least this fast");
    add("upper_speed_below", angular_speed, wheel_speed, "the upper wheel is slower than this");
    add("upper_wheel_peak", time, span, "the upper wheel has gained no speed for this long");
    add("lower_speed_above", angular_speed, wheel_speed, "the lower wheel is at least this fast");
    add("lower_speed_below", angular_speed, wheel_speed, "the lower wheel is slower than this");
    add("car_speed_above", speed, car_speed, "the car (the lower wheel's rim) is at least this fast");
    add("car_speed_below", speed, car_speed, "the car is slower than this");
    add("slip_above", none, any_slip, "the estimated slip is at least this");
    add("slip_below", none, any_slip, "the estimated slip is less than this");
    add("distance", distance, way, "the car has come this far since the phase began");
    grammar.fields.push_back({.name = "standstill", .shape = Shape::flag_true, .meaning = "both wheels stand"});
    grammar.fields.push_back({.name = "when",
                              .shape = Shape::condition,
                              .meaning = "the condition is left out unless this holds for the configuration"});
    grammar.fields.push_back(
        {.name = "any", .shape = Shape::tables, .meaning = "the first of these that holds", .grammar = &grammar});
    grammar.fields.push_back(
        {.name = "all", .shape = Shape::tables, .meaning = "all of these at the same time", .grammar = &grammar});
    return true;
  }();
  static_cast<void>(filled);
  return grammar;
}

const Grammar& brake_grammar() {
  static const Grammar grammar{"brake",
                               "What drives the brake: one of these",
                               {
                                   {.name = "duty",
                                    .shape = Shape::profile,
                                    .meaning = "brake PWM",
                                    .range = duty,
                                    .grammar = &profile_grammar()},
                                   {.name = "torque",
                                    .shape = Shape::profile,
                                    .meaning = "brake torque, through the inverse of the brake's map",
                                    .quantity = Quantity::torque,
                                    .range = torque,
                                    .grammar = &profile_grammar()},
                                   {.name = "slip_ref",
                                    .shape = Shape::profile,
                                    .meaning = "the slip controller, with this reference in place of control.slip_ref",
                                    .range = slip,
                                    .grammar = &profile_grammar()},
                               }};
  return grammar;
}

const Grammar& profile_grammar() {
  static const Grammar grammar{
      "a profile",
      "A value over the time since the phase began: a ramp, a step, points or a file",
      {
          {.name = "from", .shape = Shape::number, .meaning = "ramp: first value", .range = anything},
          {.name = "to", .shape = Shape::number, .meaning = "ramp: last value", .range = anything},
          {.name = "over",
           .shape = Shape::number,
           .meaning = "ramp: how long it takes",
           .quantity = Quantity::time,
           .range = span},
          {.name = "before", .shape = Shape::number, .meaning = "step: first value", .range = anything},
          {.name = "after", .shape = Shape::number, .meaning = "step: second value", .range = anything},
          {.name = "at",
           .shape = Shape::number,
           .meaning = "step: when",
           .quantity = Quantity::time,
           .range = duration},
          {.name = "points",
           .shape = Shape::points,
           .meaning = "profile: [[time in s, value], ...], times rising",
           .range = anything},
          {.name = "file",
           .shape = Shape::text,
           .meaning = "profile: CSV file beside the script, header time_s,value, times rising"},
          {.name = "between",
           .shape = Shape::choice,
           .meaning = "profile: what happens between two points",
           .allowed = {"line", "hold"}},
      }};
  return grammar;
}

const Grammar& limits_grammar() {
  static const Grammar grammar{"[limits]",
                               "Limits of the experiment",
                               {
                                   {.name = "wheel_speed",
                                    .shape = Shape::number,
                                    .meaning = "a faster wheel is a fault (gate.overspeed_rad_s)",
                                    .quantity = Quantity::angular_speed,
                                    .range = {0.0, 2000.0, true, false}},
                                   {.name = "motor_duty",
                                    .shape = Shape::number,
                                    .meaning = "largest drive PWM (gate.motor_duty_max)",
                                    .range = {0.0, 1.0, true, false}},
                                   {.name = "brake_duty",
                                    .shape = Shape::number,
                                    .meaning = "largest brake PWM (gate.brake_duty_max)",
                                    .range = {0.0, 1.0, true, false}},
                                   {.name = "run_time",
                                    .shape = Shape::number,
                                    .meaning = "a longer run is a fault",
                                    .quantity = Quantity::time,
                                    .range = span},
                                   {.name = "distance",
                                    .shape = Shape::number,
                                    .meaning = "a car that comes further in the run is a fault",
                                    .quantity = Quantity::distance,
                                    .range = way},
                               }};
  return grammar;
}

const Grammar& event_grammar() {
  static const Grammar grammar{
      "[[event]]",
      "One thing that happens to the simulated plant",
      {
          {.name = "at", .shape = Shape::number, .meaning = "when", .quantity = Quantity::time, .range = duration},
          {.name = "counted_from",
           .shape = Shape::choice,
           .meaning = "what `at` counts from; without: start",
           .allowed = {"start", "braking"}},
          {.name = "over",
           .shape = Shape::number,
           .meaning = "how long the change takes; without: a jump",
           .quantity = Quantity::time,
           .range = span},
          {.name = "until",
           .shape = Shape::number,
           .meaning = "when the change has ended, in place of over",
           .quantity = Quantity::time,
           .range = span},
          {.name = "friction",
           .shape = Shape::number,
           .meaning = "friction of the road from then on, over that of the tyre model",
           .range = factor},
          {.name = "brake_torque",
           .shape = Shape::number,
           .meaning = "torque of the brake from then on, over that of its map: fading",
           .range = factor},
          {.name = "motor_torque",
           .shape = Shape::number,
           .meaning = "torque of the motor from then on, over that of the plant's parameters",
           .range = factor},
          {.name = "upper_bearing",
           .shape = Shape::number,
           .meaning =
               "friction of the upper wheel's bearing (M10, d1) from then on, over that of the plant's parameters",
           .range = factor},
          {.name = "lower_bearing",
           .shape = Shape::number,
           .meaning =
               "friction of the lower wheel's bearing (M20, d2) from then on, over that of the plant's parameters",
           .range = factor},
          {.name = "inject",
           .shape = Shape::text,
           .meaning = "a fault at the I/O seam, as after --inject; it says itself when (docs/fault-injection.md)"},
      }};
  return grammar;
}

const Grammar& series_grammar() {
  static const Grammar grammar{
      "[series]",
      "The experiment is run several times",
      {
          {.name = "repeat",
           .shape = Shape::whole,
           .meaning = "runs of each combination, with seeds that count up",
           .range = {1.0, 100'000.0}},
          {.name = "seed", .shape = Shape::whole, .meaning = "seed of the first repetition", .range = {0.0, 9e15}},
          {.name = "seeds",
           .shape = Shape::wholes,
           .meaning = "the seeds themselves, in place of repeat and seed",
           .range = {0.0, 9e15}},
          {.name = "pause",
           .shape = Shape::number,
           .meaning = "between two runs in real time, for the brake to cool",
           .quantity = Quantity::time,
           .range = duration},
      }};
  return grammar;
}

const Grammar& steps_grammar() {
  static const Grammar grammar{
      "a range of values",
      "Equally spaced values, both ends included",
      {
          {.name = "from", .shape = Shape::number, .meaning = "first value", .range = anything, .required = true},
          {.name = "to", .shape = Shape::number, .meaning = "last value", .range = anything, .required = true},
          {.name = "steps",
           .shape = Shape::whole,
           .meaning = "how many values",
           .range = {2.0, 10'000.0},
           .required = true},
      }};
  return grammar;
}

}  // namespace abs_hil::config
