// The statistics of a comparison, and its table as text, Markdown, CSV and JSON.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/statistics.hpp"
#include "study/comparison.hpp"

namespace abs_hil::study {

/// The figures of `compare`, in order.
[[nodiscard]] const std::vector<analysis::Figure>& compared_metrics();

/// Quantiles over the runs without a fault that have the metric; NaN without any.
struct Spread {
  double p10{0.0};
  double median{0.0};
  double p90{0.0};
};

struct ControllerColumn {
  std::string name;
  std::string controller;
  std::vector<std::pair<std::string, std::string>> changes{};  ///< configuration values of its own
  std::size_t runs{0};
  std::size_t faults{0};                          ///< runs that ended by a fault or limit
  std::size_t locked{0};                          ///< runs in which the wheel locked (time_locked_s > 0)
  std::vector<analysis::Estimate> means{};        ///< one per metric, over the runs without a fault
  std::vector<Spread> spreads{};                  ///< likewise
  std::vector<analysis::Estimate> differences{};  ///< paired, relative to the first controller; empty for the first
};

/// Ratio of adaptive to sliding-mode, paired by run, as in the paper's claim.
struct PaperRatio {
  analysis::Estimate stop_time{};
  analysis::Estimate stop_distance{};
  analysis::Estimate slip_rms{};
  analysis::Estimate torque_total_variation{};
};
/// The paper: "approximately 6.7 % less time and distance" than its sliding-mode baseline.
inline constexpr double paper_saving = 0.067;

/// The comparison in numbers. Every sum runs in the order of the runs.
struct ComparisonTable {
  std::string plant;
  std::string experiment;
  double start_speed_rad_s{0.0};
  double end_speed_m_s{0.0};
  double slip_ref{0.0};
  std::size_t repeat{0};
  std::uint64_t seed{0};
  Variation variation{};
  std::vector<ControllerColumn> columns{};
  std::optional<PaperRatio> paper_ratio{};  ///< only if both controllers are compared
  std::string model_note{};                 ///< where the model differs from the nominal plant; empty: nowhere
};

[[nodiscard]] ComparisonTable tabulate(const ComparisonPlan& plan, const Comparison& comparison);

/// Text for a terminal: means, differences and ratio with their 95 % confidence intervals.
[[nodiscard]] std::string to_text(const ComparisonTable& table);
[[nodiscard]] std::string to_markdown(const ComparisonTable& table);
/// One row for each controller and metric, with full precision.
[[nodiscard]] std::string to_csv(const ComparisonTable& table);
/// All numbers with full precision; null for unknown ones. @param config_json  the effective configuration
[[nodiscard]] std::string to_json(const ComparisonTable& table, const std::string& config_json);
/// One row for each controller and run.
[[nodiscard]] std::string runs_csv(const ComparisonPlan& plan, const Comparison& comparison);

}  // namespace abs_hil::study
