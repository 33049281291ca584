// Means with confidence intervals by Student's t, and quantiles.
#include "analysis/statistics.hpp"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <vector>

namespace abs_hil::analysis {

namespace {

constexpr double upper_probability = 0.975;  // two-sided 95 %
constexpr double missing = std::numeric_limits<double>::quiet_NaN();

void require_pairs(std::span<const double> values, std::span<const double> base) {
  if (values.size() != base.size()) throw std::invalid_argument("paired samples must have the same length");
}

}  // namespace

Estimate estimate_mean(std::span<const double> values) {
  Estimate result{.mean = missing, .standard_deviation = missing, .low = missing, .high = missing};
  double sum = 0.0;
  for (const double value : values) {
    if (std::isnan(value)) continue;
    sum += value;
    ++result.n;
  }
  if (result.n == 0) return result;
  const double n = static_cast<double>(result.n);
  result.mean = sum / n;
  if (result.n < 2) return result;
  double squares = 0.0;
  for (const double value : values) {
    if (!std::isnan(value)) squares += (value - result.mean) * (value - result.mean);
  }
  result.standard_deviation = std::sqrt(squares / (n - 1.0));
  const double t = boost::math::quantile(boost::math::students_t(n - 1.0), upper_probability);
  const double half = t * result.standard_deviation / std::sqrt(n);
  result.low = result.mean - half;
  result.high = result.mean + half;
  return result;
}

double quantile(std::span<const double> values, double probability) {
  std::vector<double> sorted;
  std::ranges::copy_if(values, std::back_inserter(sorted), [](double value) { return !std::isnan(value); });
  if (sorted.empty()) return missing;
  std::ranges::sort(sorted);
  const double place = probability * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

Estimate estimate_difference(std::span<const double> values, std::span<const double> base) {
  require_pairs(values, base);
  std::vector<double> differences(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) differences[i] = values[i] - base[i];
  return estimate_mean(differences);
}

Estimate estimate_ratio(std::span<const double> values, std::span<const double> base) {
  require_pairs(values, base);
  std::vector<double> logarithms(values.size(), missing);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] > 0.0 && base[i] > 0.0) logarithms[i] = std::log(values[i] / base[i]);
  }
  Estimate result = estimate_mean(logarithms);
  for (double* value : {&result.mean, &result.low, &result.high}) *value = std::exp(*value);
  return result;
}

}  // namespace abs_hil::analysis
