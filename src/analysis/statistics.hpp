#pragma once

#include <cstddef>
#include <span>

namespace abs_hil::analysis {

/// Estimate of a mean. NaN if the sample is too small: the mean needs one value, everything else two.
struct Estimate {
  std::size_t n{0};  ///< number of values; NaN counts as missing
  double mean{0.0};
  double standard_deviation{0.0};  ///< of the sample, with n - 1
  double low{0.0};                 ///< 95 % confidence interval of the mean: mean -+ t(0.975, n - 1) s / sqrt(n)
  double high{0.0};
  [[nodiscard]] double half_width() const noexcept { return 0.5 * (high - low); }
};

/// Mean of the values that are not NaN.
[[nodiscard]] Estimate estimate_mean(std::span<const double> values);

/// Quantile of the values that are not NaN, linear between two of them (NumPy's default); NaN without any.
/// @param probability  in [0, 1]
[[nodiscard]] double quantile(std::span<const double> values, double probability);

/// Mean of `values[i] - base[i]` over the pairs without NaN. Common random numbers cancel, so that small differences
/// show. Throws std::invalid_argument for unequal lengths.
[[nodiscard]] Estimate estimate_difference(std::span<const double> values, std::span<const double> base);

/// Geometric mean of `values[i] / base[i]` over the pairs in which both are > 0. The interval comes from the t
/// distribution of the logarithms, so the inverse ratio has the inverse interval. `standard_deviation` is that of the
/// logarithms. Throws std::invalid_argument for unequal lengths.
[[nodiscard]] Estimate estimate_ratio(std::span<const double> values, std::span<const double> base);

}  // namespace abs_hil::analysis
