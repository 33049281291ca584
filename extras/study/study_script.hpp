#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/script.hpp"
#include "config/settings.hpp"
#include "study/design.hpp"
#include "study/signal_metrics.hpp"
#include "study/variation.hpp"

// A study's file, table by table (docs/studies.md). Each key is one row: see config/grammar.hpp.

template <>
inline constexpr std::array<abs_hil::config::Word<abs_hil::study::DesignKind>, 5>
    abs_hil::config::words_of<abs_hil::study::DesignKind>{{{"grid", study::DesignKind::grid},
                                                           {"random", study::DesignKind::random},
                                                           {"sobol", study::DesignKind::sobol},
                                                           {"latin-hypercube", study::DesignKind::latin_hypercube},
                                                           {"saltelli", study::DesignKind::saltelli}}};

namespace abs_hil::study {

using config::Factor;
using config::Levels;
using config::Normal;
using config::quantile;
using config::Uniform;

struct DesignScript {
  ABS_HIL_OPTIONS(DesignScript);
  static constexpr std::string_view title = "[design]";
  static constexpr std::string_view meaning = "How points are spread over the ranges of the factors";
  static constexpr std::array<std::string_view, 1> required{"kind"};
  ABS_HIL_OPTION(DesignKind, kind, DesignKind::grid,
                 .meaning = "random, sobol, latin-hypercube, saltelli (for Sobol indices), or grid");
  ABS_HIL_OPTION(std::uint64_t, points, 1, .meaning = "how many points", .range = rig::between(1, 1e10));
  ABS_HIL_OPTION(std::uint64_t, seed, 1, .meaning = "seed of the design; without: 1", .range = rig::from_zero(9e15));
  bool has_points{false};
  config::Place place{};

  void check(const config::TableReader& reader);
};

struct RepeatScript {
  ABS_HIL_OPTIONS(RepeatScript);
  static constexpr std::string_view title = "[repeat]";
  static constexpr std::string_view meaning =
      "Every point is run on several varied plants, the same for all points and controllers";
  static constexpr std::array<std::string_view, 1> required{"runs"};
  ABS_HIL_OPTION(std::uint64_t, runs, 1, .meaning = "how many varied plants", .range = rig::between(1, 1e9));
  ABS_HIL_OPTION(std::string, vary, {}, .meaning = "what varies, as after compare --vary");
  ABS_HIL_OPTION(std::uint64_t, seed, 1, .meaning = "seed of the varied plants; without: 1",
                 .range = rig::from_zero(9e15));
  Variation variation{};  ///< of `vary`; without [repeat] nothing varies

  void check(const config::TableReader& reader);
};

/// A study as read from its file. It is checked by itself, but not yet against plants and experiments.
struct StudyScript {
  ABS_HIL_OPTIONS(StudyScript);
  static constexpr std::string_view title = "the study";
  static constexpr std::string_view meaning = "A study of abs_hil (docs/studies.md)";
  ABS_HIL_OPTION(std::string, description, {}, .meaning = "what the study is for, in a line");
  ABS_HIL_OPTION(std::vector<std::string>, plants, {"paper-table1"},
                 .meaning = "simulated plants: names or TOML files");
  ABS_HIL_OPTION(std::vector<std::string>, experiments, {"paper"}, .meaning = "experiments: names or TOML files");
  ABS_HIL_OPTION(std::vector<std::string>, controllers, {"adaptive"},
                 .meaning = "controllers, each as after compare --controllers");
  ABS_HIL_OPTION(std::optional<std::string>, model, {}, .meaning = "every controller's model; without: the plant");
  ABS_HIL_OPTION(std::string, model_follows, "nominal",
                 .meaning = "what the controllers know of factors of the plant: nothing, or their values",
                 .allowed = {"nominal", "factors"});
  ABS_HIL_OPTION(std::uint64_t, chunk, 1000, .meaning = "runs in one file of results: what an interruption can lose",
                 .range = rig::between(1, 1'000'000));
  ABS_HIL_OPTION(std::vector<config::Setting>, settings, {}, .meaning = "configuration values of all runs");
  ABS_HIL_OPTION(DesignScript, design, {}, .meaning = "how points are spread over the ranges of the factors");
  ABS_HIL_OPTION(RepeatScript, repeat, {}, .meaning = "every point is run on several varied plants");
  ABS_HIL_OPTION(std::vector<SignalMetric>, metrics, {}, .key = "metric",
                 .meaning = "figures made of signals, beside those of every run");
  ABS_HIL_OPTION(std::vector<Factor>, factors, {}, .meaning = "configuration values in which the runs differ");
  std::string path{};  ///< its name in errors
  std::string text{};  ///< of the file, byte by byte

  /// Else the model is the plant's before factors and variation change that.
  [[nodiscard]] bool model_follows_factors() const noexcept { return model_follows == "factors"; }
  void check(const config::TableReader& reader);
};

/// Reads a study. Throws config::ConfigError with one line, "FILE:LINE:COLUMN: ...", which names the error and what is
/// valid. @param path  the study's name in errors
[[nodiscard]] StudyScript parse_study(std::string text, std::string path);

/// The study of that file. Throws config::ConfigError.
[[nodiscard]] StudyScript load_study(const std::string& path);

/// One column of a comparison: a controller with the settings of its own.
struct Contender {
  std::string name;             ///< heading of its column: the label, or the text that describes it
  config::Settings settings{};  ///< with `control.controller` set
  std::vector<std::pair<std::string, std::string>> changes{};  ///< keys and values of its own, as text
};

/// Splits "adaptive,soft=adaptive{gamma=20,ka1=0.5},gains.toml" at the commas outside of braces. "all" stands for every
/// controller. Throws std::invalid_argument for braces that do not match, and for an empty entry.
[[nodiscard]] std::vector<std::string> split_contenders(std::string_view list);

/// Reads [LABEL=]CONTROLLER, [LABEL=]CONTROLLER{KEY=VALUE,FILE.toml,...} or [LABEL=]FILE.toml over the common settings.
/// A key is one of control.* or model.*, since all contenders meet the same plants; "control." and the controller's own
/// part may be left out. A file sets the same keys, and without a controller before it names that in
/// control.controller. Throws config::ConfigError and std::invalid_argument, naming entry, key and fix.
[[nodiscard]] Contender read_contender(const std::string& text, const config::Settings& common);

}  // namespace abs_hil::study
