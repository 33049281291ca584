#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "report/decimation.hpp"
#include "report/figure.hpp"
#include "report/run_survey.hpp"

namespace abs_hil::report {

/// Part of the time axis that the figures show, and where its zero is.
struct Window {
  double from_s{0.0};  ///< of the run's own time
  double to_s{0.0};
  double zero_s{0.0};  ///< run time that is zero on the axis
};

/// A quantity of the rows: a column, or one less another.
struct Request {
  std::string name{};    ///< under which the curve is found
  std::string column{};  ///< of the CSV
  std::string minus{};   ///< column to be subtracted; empty for none
  bool braking_only{false};
  Window window{};
};

/// A request answered.
struct Profile {
  std::vector<Point> points{};
  /// Least and greatest value while the car brakes faster than 3 m/s, where figures of slip mean something; low > high
  /// where there is none.
  Range relevant{1.0, 0.0};
};

/// Reads the rows once and thins every wanted curve to at most about `most_stretches` stretches (Decimation). Throws
/// InputError.
[[nodiscard]] std::map<std::string, Profile> read_curves(const RunFiles& run, const RunSurvey& survey,
                                                         const std::vector<Request>& requests,
                                                         std::size_t most_stretches);

}  // namespace abs_hil::report
