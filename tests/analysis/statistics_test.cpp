// Quantiles, means and intervals against NumPy's figures and printed tables.
#include "analysis/statistics.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "catch.hpp"

using namespace abs_hil::analysis;
using Catch::Matchers::WithinAbs;

namespace {
constexpr double missing = std::numeric_limits<double>::quiet_NaN();
}

TEST_CASE("quantiles of a sample are NumPy's, and NaN counts as missing") {
  const std::vector<double> values{3, 1, std::numeric_limits<double>::quiet_NaN(), 4, 1, 5, 9, 2, 6};
  CHECK_THAT(quantile(values, 0.1), WithinAbs(1.0, 1e-12));
  CHECK_THAT(quantile(values, 0.5), WithinAbs(3.5, 1e-12));
  CHECK_THAT(quantile(values, 0.9), WithinAbs(6.9, 1e-12));
  CHECK(quantile(values, 0.0) == 1.0);
  CHECK(quantile(values, 1.0) == 9.0);
  CHECK(std::isnan(quantile({}, 0.5)));
}

TEST_CASE("mean, deviation and interval of a sample worked by hand") {
  // 2, 4, 4, 4, 10: mean 4.8, squares 7.84 + 3 * 0.64 + 27.04 = 36.8, s^2 = 9.2, t(4) = 2.776445.
  const Estimate e = estimate_mean(std::array{2.0, 4.0, 4.0, 4.0, 10.0});
  CHECK(e.n == 5);
  CHECK_THAT(e.mean, WithinAbs(4.8, 1e-12));
  CHECK_THAT(e.standard_deviation, WithinAbs(std::sqrt(9.2), 1e-12));
  CHECK_THAT(e.half_width(), WithinAbs(2.776445 * std::sqrt(9.2 / 5.0), 1e-5));
  CHECK_THAT(0.5 * (e.low + e.high), WithinAbs(4.8, 1e-12));
}

TEST_CASE("missing values are left out and counted as missing") {
  const Estimate e = estimate_mean(std::array{1.0, missing, 3.0});
  CHECK(e.n == 2);
  CHECK_THAT(e.mean, WithinAbs(2.0, 1e-12));
  CHECK_THAT(e.half_width(), WithinAbs(12.7062 * std::sqrt(2.0) / std::sqrt(2.0), 1e-3));
}

TEST_CASE("samples too small have no interval, empty ones no mean") {
  const Estimate one = estimate_mean(std::array{7.0});
  CHECK(one.mean == 7.0);
  CHECK(std::isnan(one.low));
  const Estimate none = estimate_mean(std::array{missing, missing});
  CHECK(none.n == 0);
  CHECK(std::isnan(none.mean));
}

TEST_CASE("a paired difference cancels common variation") {
  const std::array base{1.0, 5.0, 9.0, 13.0};
  const std::array values{1.1, 5.2, 9.1, 13.2};
  const Estimate paired = estimate_difference(values, base);
  CHECK_THAT(paired.mean, WithinAbs(0.15, 1e-9));
  // s of {.1, .2, .1, .2} is 0.057735; t(3) = 3.182446.
  CHECK_THAT(paired.half_width(), WithinAbs(3.182446 * 0.0577350 / 2.0, 1e-6));
  CHECK(paired.low > 0.0);
  CHECK(estimate_mean(values).half_width() > 50.0 * paired.half_width());
}

TEST_CASE("pairs with one value missing are left out") {
  const Estimate e = estimate_difference(std::array{2.0, missing, 5.0}, std::array{1.0, 1.0, missing});
  CHECK(e.n == 1);
  CHECK(e.mean == 1.0);
  CHECK_THROWS_AS(estimate_difference(std::array{1.0}, std::array{1.0, 2.0}), std::invalid_argument);
}

TEST_CASE("an inverse ratio has the inverse interval") {
  const std::array base{1.0, 2.0, 4.0};
  const std::array values{0.5, 1.1, 1.8};
  const Estimate ratio = estimate_ratio(values, base);
  const Estimate inverse = estimate_ratio(base, values);
  CHECK_THAT(ratio.mean, WithinAbs(std::cbrt(0.5 * 0.55 * 0.45), 1e-12));
  CHECK_THAT(ratio.low * inverse.high, WithinAbs(1.0, 1e-12));
  CHECK_THAT(ratio.high * inverse.low, WithinAbs(1.0, 1e-12));
  CHECK(estimate_ratio(std::array{0.0, 1.0}, std::array{1.0, 1.0}).n == 1);
}

TEST_CASE("about 95 of 100 intervals hold the true mean") {
  // Uniform numbers from a fixed linear congruential generator: 400 samples of 12.
  std::uint64_t state = 12345;
  const auto uniform = [&state] {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state >> 11U) * 0x1p-53;
  };
  int held = 0;
  for (int sample = 0; sample < 400; ++sample) {
    std::vector<double> values(12);
    for (double& value : values) value = uniform();
    const Estimate e = estimate_mean(values);
    if (e.low <= 0.5 && 0.5 <= e.high) ++held;
  }
  // Binomial(400, 0.95): 380 -+ 4.4, four standard deviations either way.
  CHECK(held >= 362);
  CHECK(held <= 398);
}
