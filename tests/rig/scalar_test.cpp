// Functions of the packs' scalar against the C library's long double.
#include "abs_hil/rig/scalar.hpp"

#include <cmath>
#include <limits>
#include <random>

#include "catch.hpp"

using namespace abs_hil;

namespace {

/// Distance from the long double of the C library, in units of the last place of the result.
double units_off(double got, long double truth) {
  const double near = static_cast<double>(truth);
  const double unit = std::nextafter(std::fabs(near), std::numeric_limits<double>::infinity()) - std::fabs(near);
  return static_cast<double>(std::fabs(static_cast<long double>(got) - truth) / static_cast<long double>(unit));
}

template <class Ours, class Truth>
double worst_units(double least, double most, Ours ours, Truth truth) {
  std::mt19937_64 generator(7);
  std::uniform_real_distribution<double> uniform(least, most);
  double worst = 0.0;
  for (int i = 0; i < 300'000; ++i) {
    // Uniform, and densely around 0.
    const double x = i % 2 == 0 ? uniform(generator) : uniform(generator) * std::exp2(-uniform(generator) * 10.0);
    if (x < least || x > most) continue;
    worst = std::max(worst, units_off(ours(x), truth(static_cast<long double>(x))));
  }
  return worst;
}

}  // namespace

TEST_CASE("the polynomials agree with the C library's long double") {
  constexpr double pi = 3.141592653589793;
  CHECK(worst_units(
            -pi, pi, [](double x) { return rig::sine(x); }, [](long double x) { return std::sin(x); }) < 3.0);
  CHECK(worst_units(
            -1e4, 1e4, [](double x) { return rig::arctangent(x); }, [](long double x) { return std::atan(x); }) < 2.0);
  CHECK(worst_units(
            -60.0, 60.0, [](double x) { return rig::exponential_less_one(x); },
            [](long double x) { return std::expm1(x); }) < 2.0);
  CHECK(worst_units(
            -650.0, 650.0, [](double x) { return rig::exponential(x); }, [](long double x) { return std::exp(x); }) <
        2.0);
  for (double x = -pi; x < pi; x += 1e-4) {
    CHECK(std::fabs(static_cast<long double>(rig::cosine(x)) - std::cos(static_cast<long double>(x))) < 2.5e-16L);
  }
}

TEST_CASE("logarithm and power agree with the C library's long double") {
  std::mt19937_64 generator(11);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (int i = 0; i < 300'000; ++i) {
    const double x = std::exp(690.0 * (2.0 * uniform(generator) - 1.0) * (i % 3 == 0 ? 1.0 : 1e-2));
    const long double truth = std::log(static_cast<long double>(x));
    REQUIRE(std::fabs(rig::logarithm(x) - truth) <= 2.3e-16L * std::max(1.0L, std::fabs(truth)));
    const double base = uniform(generator);
    const double p = 1.0 + 9.0 * uniform(generator);
    const long double wanted = std::pow(static_cast<long double>(base), static_cast<long double>(p));
    const long double spread = 1e-15L * (1.0L + std::fabs(p * std::log(static_cast<long double>(base))));
    REQUIRE(std::fabs(rig::power(base, p) - wanted) <= spread * wanted);
  }
  CHECK(rig::logarithm(1.0) == 0.0);
  CHECK(rig::power(1.0, 2.5) == 1.0);
  CHECK(rig::power(0.0, 2.5) == 0.0);
}

TEST_CASE("the polynomials are exact where the laws rely on it") {
  CHECK(rig::sine(0.0) == 0.0);
  CHECK(rig::arctangent(0.0) == 0.0);
  CHECK(rig::exponential_less_one(0.0) == 0.0);
  CHECK(rig::exponential(0.0) == 1.0);
  CHECK(rig::exponential_less_one(-1e9) == -1.0);
  CHECK(std::signbit(rig::sine(-0.0)));
  CHECK(std::signbit(rig::arctangent(-0.0)));
  CHECK(rig::arctangent(1e300) == 1.5707963267948966);
  for (double x = 0.01; x < 3.0; x *= 1.3) {
    CHECK(rig::sine(-x) == -rig::sine(x));
    CHECK(rig::arctangent(-x) == -rig::arctangent(x));
  }
}

TEST_CASE("the arctangent of a ratio is that of the quotient") {
  std::mt19937_64 generator(3);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int i = 0; i < 100'000; ++i) {
    const double p = 50.0 * uniform(generator);
    const double q = 1e-3 + std::fabs(uniform(generator));
    const long double angle = std::atan(static_cast<long double>(p) / q);
    CHECK(units_off(rig::arctangent_of_ratio(p, q), angle) < 2.0);
    const double factor = 1.0 + std::fabs(uniform(generator));
    CHECK(units_off(rig::arctangent_of_positive(std::fabs(p), q, factor), factor * std::fabs(angle)) < 4.0);
  }
}

TEST_CASE("larger, smaller and clamped take NaN and zeros as the standard library does") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK(std::isnan(rig::larger(nan, 1.0)));
  CHECK(rig::larger(1.0, nan) == 1.0);
  CHECK(rig::smaller(1.0, nan) == 1.0);
  CHECK(std::signbit(rig::larger(-0.0, 0.0)) == std::signbit(std::max(-0.0, 0.0)));
  CHECK(rig::clamped(3.0, -1.0, 2.0) == 2.0);
  CHECK(std::isnan(rig::clamped(nan, -1.0, 2.0)));
  CHECK_FALSE(rig::is_finite(nan));
  CHECK_FALSE(rig::is_finite(std::numeric_limits<double>::infinity()));
  CHECK(rig::is_finite(-1e300));
}
