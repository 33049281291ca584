#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "config/grammar.hpp"
#include "config/key_table.hpp"
#include "experiment/sequence.hpp"

// An experiment's file, table by table (docs/experiments.md). Each key is one row: see config/grammar.hpp.

namespace abs_hil::config {

class TableReader;

/// A place in a file. Line and column count from 1.
struct Place {
  unsigned int line{0};
  unsigned int column{0};
};

/// A number of a script: a constant, or the value of a configuration key, which is looked up when the run is planned.
struct Number {
  double value{0.0};
  std::string key{};  ///< not empty: the value of this configuration key
  std::string_view unit{};
  rig::Range range{};
  Place place{};
};

/// "KEY = VALUE" over the configuration.
struct When {
  std::string key;
  std::string operation;  ///< one of = != < > <= >=
  std::string value;
  Place place{};
};

inline constexpr rig::Range any_number = rig::between(-1e15, 1e15);
inline constexpr double day_s = 86'400.0;

template <>
inline constexpr std::array<Word<experiment::Between>, 2> words_of<experiment::Between>{
    {{"line", experiment::Between::line}, {"hold", experiment::Between::hold}}};
template <>
inline constexpr std::array<Word<rig::Phase>, 6> words_of<rig::Phase>{{{"idle", rig::Phase::idle},
                                                                       {"accelerate", rig::Phase::accelerate},
                                                                       {"coast", rig::Phase::coast},
                                                                       {"brake", rig::Phase::brake},
                                                                       {"hold", rig::Phase::hold},
                                                                       {"stopped", rig::Phase::stopped}}};

/// A value over the time of a phase; one point at time 0 is a constant.
struct ProfileScript {
  std::vector<std::pair<Number, Number>> points{};  ///< time, value
  experiment::Between between{experiment::Between::line};
  Place place{};
};

/// The keys that give a profile. The row of the phase's key gives the values their unit and their range.
struct ProfileForm {
  ABS_HIL_OPTIONS(ProfileForm);
  static constexpr std::string_view title = "a profile";
  static constexpr std::string_view meaning =
      "A value over the time since the phase began: a ramp, a step, points or a file";
  ABS_HIL_OPTION(Number, from, {}, .meaning = "ramp: first value", .range = any_number);
  ABS_HIL_OPTION(Number, to, {}, .meaning = "ramp: last value", .range = any_number);
  ABS_HIL_OPTION(Number, over, {}, .unit = "s", .meaning = "ramp: how long it takes", .range = rig::positive(day_s));
  ABS_HIL_OPTION(Number, before, {}, .meaning = "step: first value", .range = any_number);
  ABS_HIL_OPTION(Number, after, {}, .meaning = "step: second value", .range = any_number);
  ABS_HIL_OPTION(Number, at, {}, .unit = "s", .meaning = "step: when", .range = rig::from_zero(day_s));
  ABS_HIL_OPTION(Points, points, {}, .meaning = "profile: [[time in s, value], ...], times rising");
  ABS_HIL_OPTION(std::string, file, {},
                 .meaning = "profile: CSV file beside the script, header time_s,value, times rising");
  ABS_HIL_OPTION(experiment::Between, between, {}, .meaning = "profile: what happens between two points");
};

/// One of the conditions of experiment/end_conditions.hpp, or all of several.
struct ConditionScript {
  static constexpr std::string_view title = "until";
  static constexpr std::string_view meaning = "What ends a phase";
  static const Grammar& grammar();
  experiment::EndKind kind{experiment::EndKind::duration};
  Number value{};
  std::optional<When> when{};
  std::vector<ConditionScript> parts{};  ///< of EndKind::all
  Place place{};
};

struct BrakeScript {
  ABS_HIL_OPTIONS(BrakeScript);
  static constexpr std::string_view title = "brake";
  static constexpr std::string_view meaning = "What drives the brake: one of these";
  ABS_HIL_OPTION(std::optional<ProfileScript>, duty, {}, .meaning = "brake PWM", .range = rig::from_zero(1));
  ABS_HIL_OPTION(std::optional<ProfileScript>, torque, {}, .unit = "N m",
                 .meaning = "brake torque, through the inverse of the brake's map", .range = rig::from_zero(100));
  ABS_HIL_OPTION(std::optional<ProfileScript>, slip_ref, {},
                 .meaning = "the slip controller, with this reference in place of control.slip_ref",
                 .range = rig::open_between(0, 1));
  std::string word{"off"};  ///< "off" or "controller", unless a member is given

  void check(const TableReader& reader);
  [[nodiscard]] experiment::BrakeAction action() const noexcept;
  /// Of the duty, the torque or the slip reference; none for the slip reference: control.slip_ref.
  [[nodiscard]] const std::optional<ProfileScript>& profile() const noexcept;
};

struct PhaseScript {
  ABS_HIL_OPTIONS(PhaseScript);
  static constexpr std::string_view title = "[[phase]]";
  static constexpr std::string_view meaning = "One phase: what acts, and what ends it";
  static constexpr std::array<std::string_view, 1> required{"name"};
  ABS_HIL_OPTION(std::string, name, {}, .meaning = "its name, in displays and events");
  ABS_HIL_OPTION(std::optional<rig::Phase>, kind, {},
                 .meaning = "the CSV's word for it; without: the name if it is one of these, else by what acts");
  ABS_HIL_OPTION(std::optional<When>, when, {},
                 .meaning = "the phase is left out unless this holds for the configuration");
  ABS_HIL_OPTION(std::optional<ProfileScript>, motor, {}, .meaning = "drive PWM of the lower wheel's motor",
                 .range = rig::from_zero(1), .allowed = {"off"});
  ABS_HIL_OPTION(BrakeScript, brake, {}, .meaning = "what drives the brake; or a table of duty, torque_Nm or slip_ref",
                 .allowed = {"off", "controller"});
  ABS_HIL_OPTION(bool, restart, false,
                 .meaning = "the slip controller begins anew; without: it goes on from the phase before");
  ABS_HIL_OPTION(
      bool, wheels_apart, false,
      .meaning = "the upper wheel is lifted off the lower one: a simulator parts them, on a rig a person does");
  ABS_HIL_OPTION(std::string, ask, {},
                 .meaning =
                     "what a person is asked to do; the phase ends when the person has answered, motor and "
                     "brake are off meanwhile");
  ABS_HIL_OPTION(std::vector<ConditionScript>, until, {},
                 .meaning = "what ends the phase: one condition, or any or all of several; required unless it asks");
  /// The longest time limit of a phase (experiment::Sequence).
  ABS_HIL_OPTION(std::optional<Number>, at_most, {}, .unit = "s",
                 .meaning = "a phase that lasts longer is a fault; may be left out if the phase ends by its duration",
                 .range = rig::positive(600));
  Place place{};
  Place name_place{};

  void check(const TableReader& reader);
};

struct LimitsScript {
  ABS_HIL_OPTIONS(LimitsScript);
  static constexpr std::string_view title = "[limits]";
  static constexpr std::string_view meaning = "Limits of the experiment";
  ABS_HIL_OPTION(std::optional<Number>, wheel_speed, {}, .unit = "rad/s",
                 .meaning = "a faster wheel is a fault (gate.overspeed_rad_s)", .range = rig::positive(2000));
  ABS_HIL_OPTION(std::optional<Number>, motor_duty, {}, .meaning = "largest drive PWM (gate.motor_duty_max)",
                 .range = rig::positive(1));
  ABS_HIL_OPTION(std::optional<Number>, brake_duty, {}, .meaning = "largest brake PWM (gate.brake_duty_max)",
                 .range = rig::positive(1));
  ABS_HIL_OPTION(std::optional<Number>, run_time, {}, .unit = "s", .meaning = "a longer run is a fault",
                 .range = rig::positive(day_s));
  ABS_HIL_OPTION(std::optional<Number>, distance, {}, .unit = "m",
                 .meaning = "a car that comes further in the run is a fault", .range = rig::positive(1e5));
};

/// One event of the simulated plant.
struct EventScript {
  ABS_HIL_OPTIONS(EventScript);
  static constexpr std::string_view title = "[[event]]";
  static constexpr std::string_view meaning = "One thing that happens to the simulated plant";
  ABS_HIL_OPTION(double, at_s, 0.0, .key = "at", .unit = "s", .meaning = "when", .range = rig::from_zero(day_s));
  ABS_HIL_OPTION(std::string, counted_from, "start", .meaning = "what `at` counts from; without: start",
                 .allowed = {"start", "braking"});
  ABS_HIL_OPTION(double, over_s, 0.0, .key = "over", .unit = "s",
                 .meaning = "how long the change takes; without: a jump", .range = rig::positive(day_s));
  /// After the check, with `over` too. The same as `at_s` for a jump.
  ABS_HIL_OPTION(double, end_s, 0.0, .key = "until", .unit = "s",
                 .meaning = "when the change has ended, in place of over", .range = rig::positive(day_s));
  ABS_HIL_OPTION(std::optional<double>, friction, {},
                 .meaning = "friction of the road from then on, over that of the tyre model",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(std::optional<double>, brake_torque, {},
                 .meaning = "torque of the brake from then on, over that of its map: fading",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(std::optional<double>, motor_torque, {},
                 .meaning = "torque of the motor from then on, over that of the plant's parameters",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(std::optional<double>, upper_bearing, {},
                 .meaning =
                     "friction of the upper wheel's bearing (M10, d1) from then on, over that of the plant's "
                     "parameters",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(std::optional<double>, lower_bearing, {},
                 .meaning =
                     "friction of the lower wheel's bearing (M20, d2) from then on, over that of the plant's "
                     "parameters",
                 .range = rig::positive(10));
  ABS_HIL_OPTION(
      std::string, inject, {},
      .meaning = "a fault at the I/O seam, as after --inject; it says itself when (docs/fault-injection.md)");
  Place place{};

  void check(const TableReader& reader);
  [[nodiscard]] bool from_braking() const noexcept { return counted_from == "braking"; }
};

/// A part of the simulated plant that events may change during a run.
struct ChangingPart {
  std::string_view what;                        ///< key of an event: "friction"
  std::string_view in_words;                    ///< "friction of the road"
  std::string& (*profile)(Settings& settings);  ///< the configuration value with its profile
  std::optional<double> EventScript::*factor;
};
[[nodiscard]] std::span<const ChangingPart> changing_parts() noexcept;

struct SeriesScript {
  ABS_HIL_OPTIONS(SeriesScript);
  static constexpr std::string_view title = "[series]";
  static constexpr std::string_view meaning = "The experiment is run several times";
  ABS_HIL_OPTION(std::vector<std::string>, experiments, {},
                 .meaning =
                     "the experiments that are run, one after the other, in place of phases: names or TOML "
                     "files");
  ABS_HIL_OPTION(std::int64_t, repeat, 1, .meaning = "runs of each combination, with seeds that count up",
                 .range = rig::between(1, 100'000));
  ABS_HIL_OPTION(std::optional<std::int64_t>, seed, {}, .meaning = "seed of the first repetition",
                 .range = rig::from_zero(9e15));
  ABS_HIL_OPTION(std::vector<std::int64_t>, seeds, {}, .meaning = "the seeds themselves, in place of repeat and seed",
                 .range = rig::from_zero(9e15));
  ABS_HIL_OPTION(double, pause_s, 0.0, .key = "pause", .unit = "s",
                 .meaning = "between two runs in real time, for the brake to cool", .range = rig::from_zero(day_s));
  bool given{false};  ///< the script has a [series] or [factors]; then even a single run gets the folder of a series

  void check(const TableReader& reader) const;
  [[nodiscard]] std::size_t repetitions() const noexcept {
    return seeds.empty() ? static_cast<std::size_t>(repeat) : seeds.size();
  }
};

// Configuration values in which runs differ: the table [factors] of experiments and studies.

/// Every value is combined with every value of the other factors.
struct Levels {
  std::vector<Value> values{};
};

/// Uniform between its ends, or uniform in the logarithm.
struct Uniform {
  double from{0.0};
  double to{0.0};
  bool logarithmic{false};
};

/// Normal, cut off at its ends.
struct Normal {
  double mean{0.0};
  double sd{0.0};
  double least{0.0};
  double most{0.0};
};

/// A configuration key and the values that it takes.
struct Factor {
  std::string key{};
  std::variant<Levels, Uniform, Normal> values{};
  Place place{};  ///< of the key
  [[nodiscard]] bool has_range() const noexcept { return !std::holds_alternative<Levels>(values); }
};

/// The value at the probability `u` in (0, 1), for a factor with a range. It lies within the range, whatever the
/// rounding. Throws std::bad_variant_access for levels.
[[nodiscard]] double quantile(const Factor& factor, double u);
/// The value of a range at `u` in [0, 1]: its ends at 0 and 1. Real-time safe.
[[nodiscard]] double at(const Uniform& range, double u) noexcept;

/// False for the keys that say who runs a script, and on what: neither settings nor factors of a script may name them.
[[nodiscard]] bool script_may_set(std::string_view key) noexcept;

/// A configuration value that the script sets.
struct Setting {
  std::string key;
  Value value;
  Place place{};
};

/// An experiment as read from its file. It is checked by itself, but not yet against a configuration.
struct Script {
  ABS_HIL_OPTIONS(Script);
  static constexpr std::string_view title = "the script";
  static constexpr std::string_view meaning = "An experiment of abs_hil (docs/experiments.md)";
  ABS_HIL_OPTION(std::string, description, {}, .meaning = "what the experiment is, in a line");
  ABS_HIL_OPTION(std::string, author, {}, .meaning = "who wrote it");
  ABS_HIL_OPTION(std::string, notes, {}, .meaning = "anything else worth keeping with the results");
  ABS_HIL_OPTION(std::string, analysis, {}, .meaning = "what is computed from the run beside its metrics",
                 .allowed = {"friction-curve"});
  ABS_HIL_OPTION(std::vector<Setting>, settings, {},
                 .meaning = "configuration values of the experiment; --config, options and --set override them");
  ABS_HIL_OPTION(std::vector<PhaseScript>, phases, {}, .key = "phase",
                 .meaning = "the phases, in order; required unless [series] names experiments");
  ABS_HIL_OPTION(LimitsScript, limits, {},
                 .meaning = "limits of this experiment; they can only tighten those of the configuration");
  ABS_HIL_OPTION(std::vector<EventScript>, events, {}, .key = "event",
                 .meaning = "what happens to the simulated plant; the rig refuses it");
  ABS_HIL_OPTION(SeriesScript, series, {}, .meaning = "the experiment is run several times");
  ABS_HIL_OPTION(std::vector<Factor>, factors, {},
                 .meaning = "configuration values that the runs of a series differ in: every combination is run");
  std::string name{};                          ///< "paper", or the path of a file
  std::string path{};                          ///< its name in errors
  std::string text{};                          ///< of the file, byte by byte
  std::map<std::string, std::string> files{};  ///< the files that it names, by these names

  void check(const TableReader& reader);
  /// "FILE:LINE:COLUMN".
  [[nodiscard]] std::string at(Place place) const;
};

/// The profile that the script's events give one of the changing parts, in the form of its configuration value
/// ("braking time: 1; 0.5 at 0.6; 1 from 1 to 3"). Empty: no event changes the part. Throws ConfigError with line and
/// column for events that contradict each other.
[[nodiscard]] std::string profile(const Script& script, std::string_view what);

/// One run of a series: its varied values and its seed.
struct SeriesMember {
  std::vector<std::pair<std::string, Value>> varied{};  ///< the experiment, if several are named, then the factors
  std::int64_t seed{0};
};

/// The runs of a series, in order: all combinations of the varied values, the last key fastest, each with all seeds.
/// The k-th repetitions of all combinations have the same seed, so that the combinations meet the same noise.
/// @param seed of the first repetition if the script gives none
[[nodiscard]] std::vector<SeriesMember> members_of(const Script& script, std::int64_t seed);

/// Returns the text of a file that a script names, or nothing if there is no such file.
using FileReader = std::function<std::optional<std::string>(const std::string& name)>;

/// Reads a script. Throws ConfigError with one line, "FILE:LINE:COLUMN: ...". It names the error, what is valid and,
/// for an unknown key, the nearest known one.
/// @param path the script's name in errors
[[nodiscard]] Script parse(std::string text, std::string path, const FileReader& read_file);

/// The script of that file. Throws ConfigError.
[[nodiscard]] Script load(const std::string& path);

/// The experiment of that name, a file in config_dir()/experiments, or the file itself if it is a path or ends in
/// .toml. The process reads each file once. Throws ConfigError, naming the known ones. Thread-safe.
[[nodiscard]] std::shared_ptr<const Script> find(const std::string& name_or_file);
/// The experiments in config_dir()/experiments, by name.
[[nodiscard]] std::vector<std::shared_ptr<const Script>> known_experiments();

/// The JSON Schema (draft 2020-12) of scripts, for editors. It is made from the parser's own grammar.
[[nodiscard]] nlohmann::ordered_json schema();

}  // namespace abs_hil::config
