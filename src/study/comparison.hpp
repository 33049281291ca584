// Controllers side by side: a study of one case, its runs by controller, and their table as text, Markdown, CSV, JSON.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/statistics.hpp"
#include "study/batch.hpp"
#include "study/study.hpp"

namespace abs_hil::study {

/// The runs of a study of one case: [c][k] is controller c on varied plant k.
using RunsByController = std::vector<std::vector<RunResult>>;

/// Runs all controllers over the same varied plants. Plant k depends on the study's seed and k alone, so every
/// controller meets the same plants and encoders, and the number of threads does not change the result.
/// @param study  of one case, one point and no factors
/// @param done  called after each run, from several threads, with the number of finished runs
/// Throws std::invalid_argument for options that a run cannot use.
[[nodiscard]] RunsByController run_by_controller(const Study& study, std::size_t threads,
                                                 const std::function<void(std::size_t)>& done = {});

/// The figures of `compare`, in order.
[[nodiscard]] const std::vector<analysis::Figure>& compared_metrics();

/// Quantiles over the runs without a fault that have the metric; NaN without any.
struct Spread {
  double p10{0.0};
  double median{0.0};
  double p90{0.0};
};

struct ControllerColumn {
  std::size_t runs{0};
  std::size_t faults{0};                          ///< runs that ended by a fault or limit
  std::size_t locked{0};                          ///< runs in which the wheel locked (time_locked_s > 0)
  std::vector<analysis::Estimate> means{};        ///< one per metric, over the runs without a fault
  std::vector<Spread> spreads{};                  ///< likewise
  std::vector<analysis::Estimate> differences{};  ///< paired, relative to the first controller; empty for the first
};

/// A metric whose ratio of adaptive to sliding-mode, paired by run, stands beside the paper's claim.
struct PaperMetric {
  std::string_view key;  ///< in JSON
  double analysis::Metrics::*value;
};
inline constexpr std::array<PaperMetric, 4> paper_metrics{{
    {"stop_time", &analysis::Metrics::stop_time_s},
    {"stop_distance", &analysis::Metrics::stop_distance_m},
    {"slip_rms", &analysis::Metrics::slip_rms},
    {"torque_total_variation", &analysis::Metrics::torque_total_variation_Nm},
}};
/// The paper: "approximately 6.7 % less time and distance" than its sliding-mode baseline.
inline constexpr double paper_saving = 0.067;

/// The comparison in numbers. Every sum runs in the order of the runs.
struct ComparisonTable {
  const Study& study;
  std::vector<ControllerColumn> columns{};  ///< one for each controller of the study
  /// One for each of `paper_metrics`; only if both controllers are compared.
  std::optional<std::array<analysis::Estimate, paper_metrics.size()>> paper_ratios{};
};

/// @param study  must outlive the table
[[nodiscard]] ComparisonTable tabulate(const Study& study, const RunsByController& runs);

/// Text for a terminal: means, differences and ratio with their 95 % confidence intervals.
[[nodiscard]] std::string to_text(const ComparisonTable& table);
[[nodiscard]] std::string to_markdown(const ComparisonTable& table);
/// One row for each controller and metric, with full precision.
[[nodiscard]] std::string to_csv(const ComparisonTable& table);
/// All numbers with full precision; null for unknown ones. @param config_json  the effective configuration
[[nodiscard]] std::string to_json(const ComparisonTable& table, const std::string& config_json);
/// One row for each controller and run, with the values of its varied plant.
[[nodiscard]] std::string runs_csv(const Study& study, const RunsByController& runs);

}  // namespace abs_hil::study
