#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abs_hil/rig/phase.hpp"
#include "abs_hil/rig/signals.hpp"
#include "config/script.hpp"
#include "config/settings.hpp"
#include "rig/record_sink.hpp"
#include "study/design.hpp"
#include "study/variation.hpp"

// A study's file, table by table (docs/studies.md). Each key is one row: see config/grammar.hpp.

namespace abs_hil::study {

/// What a study's own metric makes of the values.
enum class Reduction : std::uint8_t { max, min, mean, rms, last };

}  // namespace abs_hil::study

template <>
inline constexpr std::array<abs_hil::config::Word<abs_hil::study::Reduction>, 5>
    abs_hil::config::words_of<abs_hil::study::Reduction>{{{"max", study::Reduction::max},
                                                          {"min", study::Reduction::min},
                                                          {"mean", study::Reduction::mean},
                                                          {"rms", study::Reduction::rms},
                                                          {"last", study::Reduction::last}}};

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

/// A metric that a study defines, in a table of its file: one number made of a signal's values in a phase.
struct SignalMetric {
  ABS_HIL_OPTIONS(SignalMetric);
  static constexpr std::string_view title = "[[metric]]";
  static constexpr std::string_view meaning = "One number made of a signal's values in a phase";
  static constexpr std::array<std::string_view, 3> required{"name", "of", "take"};
  ABS_HIL_OPTION(std::string, name, {}, .meaning = "of its column in the results");
  ABS_HIL_OPTION(std::string, of, {}, .meaning = "a column of a run's CSV, or a controller's signal");
  ABS_HIL_OPTION(Reduction, take, Reduction::max, .meaning = "what is made of the values");
  ABS_HIL_OPTION(rig::Phase, phase, rig::Phase::brake, .meaning = "in which kind of phase; without: brake",
                 .allowed = {"accelerate", "coast", "brake", "hold", "stopped"});
  ABS_HIL_OPTION(double, after_s, 0.0, .key = "after", .unit = "s", .meaning = "from this time after its begin on",
                 .range = rig::from_zero(600));
  ABS_HIL_OPTION(double, above_m_s, 0.0, .key = "above", .unit = "m/s",
                 .meaning = "only while the car is faster than this", .range = rig::from_zero(200));
  config::Place place{};  ///< in the study's file

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

/// Computes such metrics from the records of a run.
class SignalMetrics final : public rig::RecordSink {
 public:
  /// @param signals  of the run's controller @param r2_m  the lower wheel's radius
  SignalMetrics(const std::vector<SignalMetric>& metrics, std::span<const rig::Signal> signals, double r2_m);

  void consume(const rig::CycleRecord& record, double distance_m) override;
  /// In the order of the metrics. NaN if no record counted or the controller has no such signal. Values that are NaN do
  /// not count.
  [[nodiscard]] std::vector<double> values() const;

 private:
  struct Running {
    SignalMetric metric{};
    std::size_t column{0};  ///< of the CSV, then of the controller's signals
    std::uint64_t count{0};
    double value{0.0};
    double begin_s{0.0};  ///< of the phase
    bool within{false};   ///< the last record was of the phase
  };

  double r2_m_;
  std::vector<Running> running_{};
};

}  // namespace abs_hil::study
