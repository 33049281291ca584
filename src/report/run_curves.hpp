#pragma once

#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "report/decimation.hpp"
#include "report/figure.hpp"
#include "report/run_survey.hpp"

namespace abs_hil::report {

/// The part of the time axis that the figures show, and the position of its zero.
struct Window {
  double from_s{0.0};  ///< in the run's own time
  double to_s{0.0};
  double zero_s{0.0};  ///< run time of the axis' zero
};

/// A requested quantity: a column, or the difference of two.
struct Request {
  std::string name{};    ///< name of the curve
  std::string column{};  ///< column of the CSV
  std::string minus{};   ///< column to subtract; empty: none
  bool braking_only{false};
  Window window{};
};

/// The curve of a request.
struct Profile {
  std::vector<Point> points{};
  /// Smallest and largest value while the car brakes above 3 m/s, where slip is meaningful; low > high if there is
  /// none.
  Range relevant{1.0, 0.0};
};

/// Reads the rows once and thins every requested curve to about `most_stretches` stretches (Decimation). Throws
/// InputError.
[[nodiscard]] std::map<std::string, Profile> read_curves(const RunFiles& run, const RunSurvey& survey,
                                                         const std::vector<Request>& requests,
                                                         std::size_t most_stretches);

}  // namespace abs_hil::report
