// Designs of studies. Their generators are compared with other people's: Random123's and NumPy's Philox, SciPy's Sobol
// sequence and truncated normal.
#include "study/design.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "catch.hpp"
#include "config/script.hpp"

using namespace abs_hil::study;
using abs_hil::config::Factor;
using abs_hil::config::Normal;
using abs_hil::config::quantile;
using abs_hil::config::Uniform;
using Catch::Matchers::WithinAbs;

TEST_CASE("Philox gives the known answers of Random123") {
  constexpr std::uint64_t all = ~std::uint64_t{0};
  using Words = std::array<std::uint64_t, 4>;
  CHECK(philox({0, 0, 0, 0}, {0, 0}) ==
        Words{0x16554d9eca36314c, 0xdb20fe9d672d0fdc, 0xd7e772cee186176b, 0x7e68b68aec7ba23b});
  CHECK(philox({all, all, all, all}, {all, all}) ==
        Words{0x87b092c3013fe90b, 0x438c3c67be8d0224, 0x9cc7d7c69cd777b6, 0xa09caebf594f0ba0});
  CHECK(philox({0x243f6a8885a308d3, 0x13198a2e03707344, 0xa4093822299f31d0, 0x082efa98ec4e6c89},
               {0x452821e638d01377, 0xbe5466cf34e90c6c}) ==
        Words{0xa528f45403e61d95, 0x38c72dbd566e9788, 0xa5a1610e72fd18b5, 0x57bd43b5e52b7fe6});
}

TEST_CASE("no random number is an end of the interval") {
  CHECK(open_unit(0) > 0.0);
  CHECK(open_unit(~std::uint64_t{0}) < 1.0);
}

TEST_CASE("a permutation takes every place once, another key another order") {
  for (const std::uint64_t count : {1, 2, 3, 4, 5, 17, 64, 1000, 1025}) {
    std::set<std::uint64_t> places;
    std::uint64_t same = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      places.insert(permuted(i, count, {7, 1}));
      if (permuted(i, count, {7, 1}) == permuted(i, count, {8, 1})) ++same;
    }
    CHECK(places.size() == count);
    CHECK(*places.rbegin() == count - 1);
    if (count > 100) CHECK(same < 10);  // about one by chance
  }
}

TEST_CASE("the plain Sobol sequence is SciPy's") {
  const Design design(DesignKind::sobol, 16, 0, {"a", "b", "c", "d", "e"});
  const std::vector<std::vector<double>> scipy{{0.875, 0.875, 0.125, 0.375, 0.875},  // points 5 to 9
                                               {0.625, 0.125, 0.875, 0.625, 0.625},
                                               {0.125, 0.625, 0.375, 0.125, 0.125},
                                               {0.1875, 0.3125, 0.9375, 0.4375, 0.5625},
                                               {0.6875, 0.8125, 0.4375, 0.9375, 0.0625}};
  for (std::size_t n = 0; n < scipy.size(); ++n) {
    for (std::size_t d = 0; d < 5; ++d) CHECK_THAT(design.at(n + 5, d), WithinAbs(scipy[n][d], 1e-15));
  }
}

TEST_CASE("2^n points of a shifted Sobol sequence lie one in each of 2^n parts of each factor's range") {
  const Design design(DesignKind::sobol, 256, 5, {"a", "b", "c"});
  for (std::size_t d = 0; d < 3; ++d) {
    std::set<int> parts;
    for (std::uint64_t n = 0; n < 256; ++n) parts.insert(static_cast<int>(256.0 * design.at(n, d)));
    CHECK(parts.size() == 256);
  }
  CHECK(design.at(0, 0) != Design(DesignKind::sobol, 256, 6, {"a", "b", "c"}).at(0, 0));
}

TEST_CASE("a Latin hypercube has one point in each part of each factor's range") {
  const Design design(DesignKind::latin_hypercube, 777, 1, {"a", "b"});
  for (std::size_t d = 0; d < 2; ++d) {
    std::set<int> parts;
    for (std::uint64_t n = 0; n < 777; ++n) parts.insert(static_cast<int>(777.0 * design.at(n, d)));
    CHECK(parts.size() == 777);
  }
  double products = 0.0;  // independent factors: the correlation vanishes as 1 / sqrt(n)
  for (std::uint64_t n = 0; n < 777; ++n) products += (design.at(n, 0) - 0.5) * (design.at(n, 1) - 0.5);
  CHECK(std::abs(12.0 * products / 777.0) < 4.0 / std::sqrt(777.0));
}

TEST_CASE("random points are uniform, and a factor's values do not depend on the others") {
  const Design design(DesignKind::random, 10'000, 1, {"a", "b"});
  std::array<int, 10> counts{};
  for (std::uint64_t n = 0; n < 10'000; ++n) ++counts.at(static_cast<std::size_t>(10.0 * design.at(n, 0)));
  double chi_square = 0.0;
  for (const int count : counts) chi_square += (count - 1000.0) * (count - 1000.0) / 1000.0;
  CHECK(chi_square < 27.9);  // 0.1 % of nine degrees of freedom
  CHECK(Design(DesignKind::random, 10, 1, {"b"}).at(3, 0) == design.at(3, 1));
}

TEST_CASE("Saltelli's rows differ from their first in one factor, and in all in the last") {
  const Design design(DesignKind::saltelli, 8, 1, {"a", "b", "c"});
  REQUIRE(design.rows() == 8 * 5);
  for (std::uint64_t point = 0; point < 8; ++point) {
    for (std::uint64_t place = 1; place < 5; ++place) {
      for (std::size_t d = 0; d < 3; ++d) {
        const double first = design.at(5 * point, d);
        const double second = design.at(5 * point + 4, d);
        const double here = design.at(5 * point + place, d);
        CHECK(first != second);
        CHECK(here == (place == 4 || place == d + 1 ? second : first));
      }
    }
  }
}

TEST_CASE("quantiles of a normal range that is cut off are SciPy's") {
  const Factor factor{.key = "x", .values = Normal{.mean = 20, .sd = 4, .least = 10, .most = 26}};
  CHECK_THAT(quantile(factor, 0.1), WithinAbs(14.848804193503259, 1e-10));
  CHECK_THAT(quantile(factor, 0.5), WithinAbs(19.69591636752742, 1e-10));
  CHECK_THAT(quantile(factor, 0.9), WithinAbs(23.985969012673607, 1e-10));
  CHECK(quantile(factor, 0x1p-53) >= 10.0);
  CHECK(quantile(factor, 1.0 - 0x1p-53) <= 26.0);
}

TEST_CASE("quantiles of uniform ranges") {
  const Factor linear{.key = "x", .values = Uniform{.from = 3, .to = 1}};
  CHECK_THAT(quantile(linear, 0.25), WithinAbs(2.5, 1e-15));
  const Factor logarithmic{.key = "x", .values = Uniform{.from = 1, .to = 100, .logarithmic = true}};
  CHECK_THAT(quantile(logarithmic, 0.5), WithinAbs(10.0, 1e-13));
  CHECK(quantile(logarithmic, 1.0 - 0x1p-53) <= 100.0);
}
