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

/// Where in a script something stands, both from 1.
struct Place {
  unsigned int line{0};
  unsigned int column{0};
};

/// A number of a script: written there, or the value of a configuration key, looked up when the run is planned.
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
struct CourseScript {
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
  std::optional<CourseScript> motor{};
  experiment::BrakeAction brake{experiment::BrakeAction::released};
  std::optional<CourseScript> brake_profile{};  ///< duty, torque or slip reference; none: control.slip_ref
  std::vector<ConditionScript> until{};         ///< any of them
  std::optional<Number> at_most{};
  Place place{};
};

struct LimitsScript {
  std::optional<Number> wheel_speed{};
  std::optional<Number> motor_duty{};
  std::optional<Number> brake_duty{};
  std::optional<Number> run_time{};
  std::optional<Number> distance{};
};

/// Something of the simulated plant that an event multiplies.
struct Change {
  std::string_view what;  ///< as in changing_parts(): "friction"
  double factor{1.0};
};

/// Something that happens to the simulated plant.
struct EventScript {
  double at_s{0.0};
  double end_s{0.0};  ///< the same as `at_s` for a jump
  bool from_braking{false};
  std::vector<Change> changes{};
  std::string inject{};  ///< not empty: a fault, and nothing else here counts
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
  bool given{false};  ///< there is a [series] or a [vary]: run folders are those of a series, even of one run
  std::int64_t repeat{1};
  std::optional<std::int64_t> seed{};
  std::vector<std::int64_t> seeds{};  ///< not empty: in place of repeat and seed
  double pause_s{0.0};
  std::vector<Varied> vary{};
};

/// An experiment as its file has it: checked for itself, not yet against a configuration.
struct Script {
  std::string name;                            ///< "paper", or the path of a file
  std::string path;                            ///< as errors name it
  std::string text;                            ///< of the file, byte by byte
  std::map<std::string, std::string> files{};  ///< files it refers to, by the name it has for them
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

/// Gives the text of a file that a script refers to, by the name it has for it; nothing if there is no such file.
using FileReader = std::function<std::optional<std::string>(const std::string& name)>;

/// Reads a script. Throws config::ConfigError in one line, "FILE:LINE:COLUMN: ...", naming what is wrong, what would
/// be right and, for a key, the nearest known one.
/// @param path as errors name it
[[nodiscard]] Script parse(std::string text, std::string path, const FileReader& read_file);

/// The script of that file. Throws config::ConfigError.
[[nodiscard]] Script load(const std::string& path);

}  // namespace abs_hil::config
