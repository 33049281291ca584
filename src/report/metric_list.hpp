#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "report/run_files.hpp"
#include "report/run_survey.hpp"

namespace abs_hil::report {

/// A figure of merit of a braking run (docs/telemetry.md).
struct Metric {
  std::string_view key;   ///< in the summary
  std::string_view name;  ///< with its unit, plain
  int decimals;
  double analysis::Metrics::*computed;  ///< the same from the rows
};

[[nodiscard]] std::span<const Metric> metrics();
/// The metric of that key. Throws std::out_of_range for none such.
[[nodiscard]] const Metric& metric(std::string_view key);

/// The summary's value, else what the rows give.
[[nodiscard]] double value_of(const Metric& metric, const RunFiles& run, const RunSurvey& survey);

/// In words, metrics that the summary and the rows give differently: one of them is not of this run.
[[nodiscard]] std::vector<std::string> contradictions(const RunFiles& run, const RunSurvey& survey);

}  // namespace abs_hil::report
