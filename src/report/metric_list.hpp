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
  std::string_view key;   ///< name in the summary
  std::string_view name;  ///< plain text with unit
  int decimals;
  double analysis::Metrics::*computed;  ///< the value computed from the rows
};

[[nodiscard]] std::span<const Metric> metrics();
/// The metric with that key. Throws std::out_of_range if there is none.
[[nodiscard]] const Metric& metric(std::string_view key);

/// The summary's value, else the value computed from the rows.
[[nodiscard]] double value_of(const Metric& metric, const RunFiles& run, const RunSurvey& survey);

/// Notes about metrics whose values differ between summary and rows: then the files belong to different runs.
[[nodiscard]] std::vector<std::string> contradictions(const RunFiles& run, const RunSurvey& survey);

}  // namespace abs_hil::report
