// What the readings of each window say to identification's filter (identification_filter.cpp).
//
// Within a window nothing but the counts' steps disturbs, so all of its readings together are one measurement of the
// state at its start and of the parameters: their sums of squares and products say everything. With a the row of a
// reading (derivatives by state and parameters), r its residual, rad, and w its weight,
//
//     gram = sum w a a',   cross = sum w a r,   square = sum w r^2,   log_weight = sum log w
//
// Where the instants of the readings jitter, both readings of a row share an error: their covariance, over that of the
// counts' steps, is diag(1 / w) + g g', g = jitter speed / sd (common_sd; jitter.py). So the first one has the weight
// 1 / v1, v1 = 1 / w1 + g1^2, and of the second one what the first tells is taken (Cholesky):
//
//     a2 - (g1 g2 / v1) a1,   with the weight 1 / (1 / w2 + g2^2 - (g1 g2)^2 / v1)

#include <Eigen/Core>
#include <cmath>

#include "identification_plant.hpp"

namespace abs_hil::python {

/// The sums of each window. Shapes as `linearise` gives them; `residual` (rows, 2, columns), `weight` (rows, 2), and g,
/// `common_sd` (rows, 2), if there is jitter.
py::dict condense(const py::dict& d) {
  const auto by_state = d["by_state"].cast<Array>();
  const auto by_parameter = d["by_parameter"].cast<Array>();
  const auto residual = d["residual"].cast<Array>();
  const auto weight = d["weight"].cast<Array>();
  const auto common_sd = d.contains("common_sd") ? d["common_sd"].cast<Array>() : Array();
  const auto first = d["first"].cast<Indices>();
  const std::ptrdiff_t windows = first.size() - 1;
  const std::ptrdiff_t p = by_parameter.shape(2);
  const std::ptrdiff_t c = residual.shape(2);
  const std::ptrdiff_t m = states + p;
  if (windows < 1 || by_state.shape(0) != by_parameter.shape(0) || residual.shape(0) != by_parameter.shape(0) ||
      weight.shape(0) != by_parameter.shape(0) || (common_sd.size() > 0 && common_sd.size() != weight.size()) ||
      first.data()[windows] - first.data()[0] != by_parameter.shape(0)) {
    throw std::invalid_argument("the arrays of a piece do not fit together");
  }
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  auto gram = new_array<Array>({windows, m, m});
  auto cross = new_array<Array>({windows, m, c});
  auto square = new_array<Array>({windows, c, c});
  auto log_weight = new_array<Array>({windows});
  auto readings = new_array<Array>({windows, 2});
  const double* const common = common_sd.size() > 0 ? common_sd.data() : nullptr;
  double* const gram_at = gram.mutable_data();
  double* const cross_at = cross.mutable_data();
  double* const square_at = square.mutable_data();
  double* const log_weight_at = log_weight.mutable_data();
  double* const readings_at = readings.mutable_data();
  {
    const py::gil_scoped_release release;
    Eigen::MatrixXd rows;
    Eigen::MatrixXd products(m + c, m + c);
    for (std::ptrdiff_t w = 0; w < windows; ++w) {
      const std::ptrdiff_t begin = angles * (first.data()[w] - first.data()[0]);
      const std::ptrdiff_t end = angles * (first.data()[w + 1] - first.data()[0]);
      rows.resize(m + c, end - begin);
      std::ptrdiff_t kept = 0;
      double logarithms = 0.0;
      double weights = 0.0;
      for (std::ptrdiff_t at = begin; at < end; ++at) {
        const double one = weight.data()[at];
        if (!(one > 0.0)) continue;
        auto row = rows.col(kept++);
        row(at % angles) = 1.0;
        row(1 - at % angles) = 0.0;
        for (std::ptrdiff_t i = 0; i < moving; ++i) row(angles + i) = by_state.data()[at * moving + i];
        for (std::ptrdiff_t i = 0; i < p; ++i) row(states + i) = by_parameter.data()[at * p + i];
        for (std::ptrdiff_t i = 0; i < c; ++i) row(m + i) = residual.data()[at * c + i];
        double precision = one;
        if (common != nullptr) {
          double variance = 1.0 / one + common[at] * common[at];
          if (at % angles == 1 && weight.data()[at - 1] > 0.0) {
            const double first_variance = 1.0 / weight.data()[at - 1] + common[at - 1] * common[at - 1];
            const double share = common[at - 1] * common[at] / std::sqrt(first_variance);
            row -= share * rows.col(kept - 2);
            variance -= share * share;
          }
          precision = 1.0 / variance;
        }
        row *= std::sqrt(precision);
        logarithms += std::log(precision);
        weights += one;
      }
      products.setZero();
      products.selfadjointView<Eigen::Lower>().rankUpdate(rows.leftCols(kept));
      products.triangularView<Eigen::StrictlyUpper>() = products.transpose();
      Eigen::Map<Rows>(gram_at + w * m * m, m, m) = products.topLeftCorner(m, m);
      Eigen::Map<Rows>(cross_at + w * m * c, m, c) = products.topRightCorner(m, c);
      Eigen::Map<Rows>(square_at + w * c * c, c, c) = products.bottomRightCorner(c, c);
      log_weight_at[w] = logarithms;
      readings_at[angles * w] = static_cast<double>(kept);
      readings_at[angles * w + 1] = weights;
    }
  }
  py::dict result;
  result["gram"] = gram;
  result["cross"] = cross;
  result["square"] = square;
  result["log_weight"] = log_weight;
  result["readings"] = readings;
  return result;
}

}  // namespace abs_hil::python
