#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/grammar.hpp"
#include "config/key_table.hpp"
#include "experiment/profile.hpp"
#include "experiment/sequence.hpp"

namespace abs_hil::config {

/// A place in a script. Line and column count from 1.
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

/// A value over the time of a phase; one point at time 0 is a constant.
struct ProfileScript {
  std::vector<std::pair<Number, Number>> points{};  ///< time, value
  experiment::Between between{experiment::Between::line};
  Place place{};
  [[nodiscard]] bool constant() const noexcept { return points.size() == 1; }
};

struct ConditionScript {
  experiment::EndKind kind{experiment::EndKind::duration};
  Number value{};
  std::optional<When> when{};
  std::vector<ConditionScript> parts{};  ///< of EndKind::all
  Place place{};
};

struct PhaseScript {
  std::string name;
  std::optional<rig::Phase> kind{};
  std::optional<When> when{};
  std::optional<ProfileScript> motor{};
  experiment::BrakeAction brake{experiment::BrakeAction::released};
  std::optional<ProfileScript> brake_profile{};  ///< duty, torque or slip reference; none: control.slip_ref
  std::vector<ConditionScript> until{};          ///< any of them
  std::optional<Number> at_most{};
  bool restart{false};  ///< of the slip controller
  bool wheels_apart{false};
  std::string ask{};  ///< empty: nothing
  Place place{};
};

struct LimitsScript {
  std::optional<Number> wheel_speed{};
  std::optional<Number> motor_duty{};
  std::optional<Number> brake_duty{};
  std::optional<Number> run_time{};
  std::optional<Number> distance{};
};

/// One factor that an event sets for a part of the simulated plant.
struct Change {
  std::string_view what;  ///< as in changing_parts(): "friction"
  double factor{1.0};
};

/// One event of the simulated plant.
struct EventScript {
  double at_s{0.0};
  double end_s{0.0};  ///< the same as `at_s` for a jump
  bool from_braking{false};
  std::vector<Change> changes{};
  std::string inject{};  ///< if not empty: a fault; then the other members do not count
  Place place{};
};

/// A configuration value that the script sets.
struct Setting {
  std::string key;
  config::Value value;
  Place place{};
};

/// A configuration value that the runs of a series differ in.
struct Varied {
  std::string key;
  std::vector<config::Value> values;
  Place place{};
};

struct SeriesScript {
  bool given{false};  ///< the script has a [series] or [vary]; then even a single run gets the folder of a series
  std::int64_t repeat{1};
  std::optional<std::int64_t> seed{};
  std::vector<std::int64_t> seeds{};  ///< if not empty, they replace repeat and seed
  double pause_s{0.0};
  std::vector<Varied> vary{};
  bool of_experiments{false};  ///< the first of `vary` is experiment.name, and the script has no phases
};

/// An experiment as read from its file. It is checked by itself, but not yet against a configuration.
struct Script {
  std::string name;                            ///< "paper", or the path of a file
  std::string path;                            ///< its name in errors
  std::string text;                            ///< of the file, byte by byte
  std::map<std::string, std::string> files{};  ///< the files that it names, by these names
  std::string description{};
  std::string author{};
  std::string notes{};
  std::string analysis{};  ///< empty: none
  std::vector<Setting> settings{};
  std::vector<PhaseScript> phases{};
  LimitsScript limits{};
  std::vector<EventScript> events{};
  SeriesScript series{};

  /// "FILE:LINE:COLUMN".
  [[nodiscard]] std::string at(Place place) const;
};

/// Returns the text of a file that a script names, or nothing if there is no such file.
using FileReader = std::function<std::optional<std::string>(const std::string& name)>;

/// Reads a script. Throws config::ConfigError with one line, "FILE:LINE:COLUMN: ...". It names the error, what is valid
/// and, for an unknown key, the nearest known one.
/// @param path the script's name in errors
[[nodiscard]] Script parse(std::string text, std::string path, const FileReader& read_file);

/// The script of that file. Throws config::ConfigError.
[[nodiscard]] Script load(const std::string& path);

}  // namespace abs_hil::config
