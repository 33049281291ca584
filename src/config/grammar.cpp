#include "config/grammar.hpp"

#include <algorithm>
#include <utility>

namespace abs_hil::config {

namespace {

constexpr double day_s = 86'400.0;
constexpr rig::Range duration = rig::from_zero(day_s);
/// The longest time limit of a phase (experiment::Sequence). It includes the slack of one second.
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

Field row(Shape shape, rig::OptionFacts facts, Quantity quantity = Quantity::none, const Grammar* grammar = nullptr) {
  facts.unit = unit_of(quantity);
  return {.facts = facts, .shape = shape, .quantity = quantity, .grammar = grammar};
}

Field required(Field field) {
  field.required = true;
  return field;
}

}  // namespace

const Field* Grammar::find(std::string_view name) const noexcept {
  const auto is_it = [name](const Field& field) {
    if (!name.starts_with(field.facts.key)) return false;
    const std::string_view rest = name.substr(field.facts.key.size());
    return rest.empty() || rest == suffix_of(field.quantity);
  };
  const auto at = std::find_if(fields.begin(), fields.end(), is_it);
  return at == fields.end() ? nullptr : &*at;
}

std::vector<std::string> Grammar::spellings() const {
  std::vector<std::string> names;
  for (const Field& field : fields) {
    names.emplace_back(field.facts.key);
    if (field.quantity != Quantity::none) {
      names.push_back(std::string(field.facts.key) + std::string(suffix_of(field.quantity)));
    }
  }
  return names;
}

std::string table_below_with(const Grammar& start, std::string_view key) {
  // Breadth first: the nearest table counts. The grammar of `until` contains itself, so no grammar is taken twice.
  std::vector<std::pair<const Grammar*, std::string>> open{{&start, ""}};
  for (std::size_t n = 0; n < open.size(); ++n) {
    const auto [grammar, path] = open[n];
    for (const Field& field : grammar->fields) {
      const auto is_it = [&field](const auto& other) { return other.first == field.grammar; };
      if (field.grammar == nullptr || std::any_of(open.begin(), open.end(), is_it)) continue;
      std::string below = path + (path.empty() ? "" : ".") + std::string(field.facts.key);
      if (field.grammar->find(key) != nullptr) return below;
      open.emplace_back(field.grammar, std::move(below));
    }
  }
  return {};
}

const Grammar& script_grammar() {
  static const Grammar grammar{
      "the script",
      "An experiment of abs_hil (docs/experiments.md)",
      {
          row(Shape::text, {.key = "description", .meaning = "what the experiment is, in a line"}),
          row(Shape::text, {.key = "author", .meaning = "who wrote it"}),
          row(Shape::text, {.key = "notes", .meaning = "anything else worth keeping with the results"}),
          row(Shape::choice, {.key = "analysis",
                              .meaning = "what is computed from the run beside its metrics",
                              .allowed = {"friction-curve"}}),
          row(Shape::settings,
              {.key = "settings",
               .meaning = "configuration values of the experiment; --config, options and --set override them"}),
          row(Shape::tables,
              {.key = "phase", .meaning = "the phases, in order; required unless [series] names experiments"},
              Quantity::none, &phase_grammar()),
          row(Shape::table,
              {.key = "limits",
               .meaning = "limits of this experiment; they can only tighten those of the configuration"},
              Quantity::none, &limits_grammar()),
          row(Shape::tables, {.key = "event", .meaning = "what happens to the simulated plant; the rig refuses it"},
              Quantity::none, &event_grammar()),
          row(Shape::table, {.key = "series", .meaning = "the experiment is run several times"}, Quantity::none,
              &series_grammar()),
          row(Shape::grid,
              {.key = "vary",
               .meaning = "configuration values that the runs of a series differ in: every combination is run"}),
      }};
  return grammar;
}

const Grammar& phase_grammar() {
  static const Grammar grammar{
      "[[phase]]",
      "One phase: what acts, and what ends it",
      {
          required(row(Shape::text, {.key = "name", .meaning = "its name, in displays and events"})),
          row(Shape::choice,
              {.key = "kind",
               .meaning = "the CSV's word for it; without: the name if it is one of these, else by what acts",
               .allowed = {"idle", "accelerate", "coast", "brake", "hold", "stopped"}}),
          row(Shape::condition,
              {.key = "when", .meaning = "the phase is left out unless this holds for the configuration"}),
          row(Shape::motor, {.key = "motor", .meaning = "drive PWM of the lower wheel's motor", .range = duty}),
          row(Shape::brake,
              {.key = "brake",
               .meaning = "what drives the brake; or a table of duty, torque_Nm or slip_ref",
               .allowed = {"off", "controller"}},
              Quantity::none, &brake_grammar()),
          row(Shape::flag_true,
              {.key = "restart",
               .meaning = "the slip controller begins anew; without: it goes on from the phase before"}),
          row(Shape::flag_true,
              {.key = "wheels_apart",
               .meaning =
                   "the upper wheel is lifted off the lower one: a simulator parts them, on a rig a person does"}),
          row(Shape::text,
              {.key = "ask",
               .meaning = "what a person is asked to do; the phase ends when the person has answered, motor and brake "
                          "are off meanwhile"}),
          row(Shape::table,
              {.key = "until",
               .meaning = "what ends the phase: one condition, or any or all of several; required unless it asks"},
              Quantity::none, &until_grammar()),
          row(Shape::number,
              {.key = "at_most",
               .meaning = "a phase that lasts longer is a fault; may be left out if the phase ends by its duration",
               .range = phase_limit},
              Quantity::time),
      }};
  return grammar;
}

const Grammar& until_grammar() {
  // Lists of conditions hold tables of the same kind: the grammar refers to itself.
  static Grammar grammar{"until", "What ends a phase", {}};
  static const bool filled = [] {
    using enum Quantity;
    const auto add = [](std::string_view name, Quantity quantity, rig::Range range, std::string_view meaning) {
      grammar.fields.push_back(row(Shape::number, {.key = name, .meaning = meaning, .range = range}, quantity));
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
    grammar.fields.push_back(row(Shape::flag_true, {.key = "standstill", .meaning = "both wheels stand"}));
    grammar.fields.push_back(
        row(Shape::condition,
            {.key = "when", .meaning = "the condition is left out unless this holds for the configuration"}));
    grammar.fields.push_back(
        row(Shape::tables, {.key = "any", .meaning = "the first of these that holds"}, Quantity::none, &grammar));
    grammar.fields.push_back(
        row(Shape::tables, {.key = "all", .meaning = "all of these at the same time"}, Quantity::none, &grammar));
    return true;
  }();
  static_cast<void>(filled);
  return grammar;
}

const Grammar& brake_grammar() {
  static const Grammar grammar{
      "brake",
      "What drives the brake: one of these",
      {
          row(Shape::profile, {.key = "duty", .meaning = "brake PWM", .range = duty}, Quantity::none,
              &profile_grammar()),
          row(Shape::profile,
              {.key = "torque", .meaning = "brake torque, through the inverse of the brake's map", .range = torque},
              Quantity::torque, &profile_grammar()),
          row(Shape::profile,
              {.key = "slip_ref",
               .meaning = "the slip controller, with this reference in place of control.slip_ref",
               .range = slip},
              Quantity::none, &profile_grammar()),
      }};
  return grammar;
}

const Grammar& profile_grammar() {
  static const Grammar grammar{
      "a profile",
      "A value over the time since the phase began: a ramp, a step, points or a file",
      {
          row(Shape::number, {.key = "from", .meaning = "ramp: first value", .range = anything}),
          row(Shape::number, {.key = "to", .meaning = "ramp: last value", .range = anything}),
          row(Shape::number, {.key = "over", .meaning = "ramp: how long it takes", .range = span}, Quantity::time),
          row(Shape::number, {.key = "before", .meaning = "step: first value", .range = anything}),
          row(Shape::number, {.key = "after", .meaning = "step: second value", .range = anything}),
          row(Shape::number, {.key = "at", .meaning = "step: when", .range = duration}, Quantity::time),
          row(Shape::points,
              {.key = "points", .meaning = "profile: [[time in s, value], ...], times rising", .range = anything}),
          row(Shape::text,
              {.key = "file", .meaning = "profile: CSV file beside the script, header time_s,value, times rising"}),
          row(Shape::choice,
              {.key = "between", .meaning = "profile: what happens between two points", .allowed = {"line", "hold"}}),
      }};
  return grammar;
}

const Grammar& limits_grammar() {
  static const Grammar grammar{
      "[limits]",
      "Limits of the experiment",
      {
          row(Shape::number,
              {.key = "wheel_speed",
               .meaning = "a faster wheel is a fault (gate.overspeed_rad_s)",
               .range = rig::positive(2000.0)},
              Quantity::angular_speed),
          row(Shape::number,
              {.key = "motor_duty", .meaning = "largest drive PWM (gate.motor_duty_max)", .range = rig::positive(1.0)}),
          row(Shape::number,
              {.key = "brake_duty", .meaning = "largest brake PWM (gate.brake_duty_max)", .range = rig::positive(1.0)}),
          row(Shape::number, {.key = "run_time", .meaning = "a longer run is a fault", .range = span}, Quantity::time),
          row(Shape::number,
              {.key = "distance", .meaning = "a car that comes further in the run is a fault", .range = way},
              Quantity::distance),
      }};
  return grammar;
}

const Grammar& event_grammar() {
  static const Grammar grammar{
      "[[event]]",
      "One thing that happens to the simulated plant",
      {
          row(Shape::number, {.key = "at", .meaning = "when", .range = duration}, Quantity::time),
          row(Shape::choice, {.key = "counted_from",
                              .meaning = "what `at` counts from; without: start",
                              .allowed = {"start", "braking"}}),
          row(Shape::number, {.key = "over", .meaning = "how long the change takes; without: a jump", .range = span},
              Quantity::time),
          row(Shape::number, {.key = "until", .meaning = "when the change has ended, in place of over", .range = span},
              Quantity::time),
          row(Shape::number, {.key = "friction",
                              .meaning = "friction of the road from then on, over that of the tyre model",
                              .range = factor}),
          row(Shape::number, {.key = "brake_torque",
                              .meaning = "torque of the brake from then on, over that of its map: fading",
                              .range = factor}),
          row(Shape::number, {.key = "motor_torque",
                              .meaning = "torque of the motor from then on, over that of the plant's parameters",
                              .range = factor}),
          row(Shape::number,
              {.key = "upper_bearing",
               .meaning =
                   "friction of the upper wheel's bearing (M10, d1) from then on, over that of the plant's parameters",
               .range = factor}),
          row(Shape::number,
              {.key = "lower_bearing",
               .meaning =
                   "friction of the lower wheel's bearing (M20, d2) from then on, over that of the plant's parameters",
               .range = factor}),
          row(Shape::text,
              {.key = "inject",
               .meaning = "a fault at the I/O seam, as after --inject; it says itself when (docs/fault-injection.md)"}),
      }};
  return grammar;
}

const Grammar& series_grammar() {
  static const Grammar grammar{
      "[series]",
      "The experiment is run several times",
      {
          row(Shape::texts,
              {.key = "experiments",
               .meaning =
                   "the experiments that are run, one after the other, in place of phases: names or TOML files"}),
          row(Shape::whole, {.key = "repeat",
                             .meaning = "runs of each combination, with seeds that count up",
                             .range = {1.0, 100'000.0}}),
          row(Shape::whole, {.key = "seed", .meaning = "seed of the first repetition", .range = {0.0, 9e15}}),
          row(Shape::wholes,
              {.key = "seeds", .meaning = "the seeds themselves, in place of repeat and seed", .range = {0.0, 9e15}}),
          row(Shape::number,
              {.key = "pause", .meaning = "between two runs in real time, for the brake to cool", .range = duration},
              Quantity::time),
      }};
  return grammar;
}

const Grammar& steps_grammar() {
  static const Grammar grammar{
      "a range of values",
      "Equally spaced values, both ends included",
      {
          required(row(Shape::number, {.key = "from", .meaning = "first value", .range = anything})),
          required(row(Shape::number, {.key = "to", .meaning = "last value", .range = anything})),
          required(row(Shape::whole, {.key = "steps", .meaning = "how many values", .range = {2.0, 10'000.0}})),
      }};
  return grammar;
}

}  // namespace abs_hil::config
