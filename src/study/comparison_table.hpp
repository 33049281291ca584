#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/statistics.hpp"
#include "study/comparison.hpp"

namespace abs_hil::study {

/// One figure that controllers are compared by.
struct ComparedMetric {
  std::string_view key;    ///< name in JSON and CSV, as in a run's summary
  std::string_view title;  ///< for people
  std::string_view unit;
  int decimals{0};
  double analysis::Metrics::*value;
  bool magnitude{false};  ///< the sign is dropped: an error either way counts alike
};

/// What `compare` reports on, in this order.
[[nodiscard]] std::span<const ComparedMetric> compared_metrics() noexcept;

struct ControllerColumn {
  std::string name;
  std::size_t runs{0};
  std::size_t faults{0};                          ///< runs that a fault or limit ended
  std::size_t locked{0};                          ///< runs in which the wheel locked at all (time_locked_s > 0)
  std::vector<analysis::Estimate> means{};        ///< one a metric, over the runs that a fault did not end
  std::vector<analysis::Estimate> differences{};  ///< paired, against the first controller; empty for that one
};

/// adaptive over sliding-mode, run by run: the paper's claim is of this kind.
struct PaperRatio {
  analysis::Estimate stop_time{};
  analysis::Estimate stop_distance{};
  analysis::Estimate torque_total_variation{};
};
/// The paper: "approximately 6.7 % less time and distance" than its sliding-mode baseline.
inline constexpr double paper_saving = 0.067;

/// The comparison in numbers, every sum in the order of the runs.
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
  std::optional<PaperRatio> paper_ratio{};  ///< only if both are compared
};

[[nodiscard]] ComparisonTable tabulate(const ComparisonPlan& plan, const Comparison& comparison);

/// For a terminal: the means, the differences and the ratio, with their 95 % confidence intervals.
[[nodiscard]] std::string to_text(const ComparisonTable& table);
[[nodiscard]] std::string to_markdown(const ComparisonTable& table);
/// One row for each controller and metric, numbers in full.
[[nodiscard]] std::string to_csv(const ComparisonTable& table);
/// Everything in full; null for what is not known. @param config_json the effective configuration
[[nodiscard]] std::string to_json(const ComparisonTable& table, const std::string& config_json);
/// The single runs: one row for each controller and run.
[[nodiscard]] std::string runs_csv(const ComparisonPlan& plan, const Comparison& comparison);

}  // namespace abs_hil::study
