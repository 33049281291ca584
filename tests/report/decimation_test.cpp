#include "report/decimation.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "catch.hpp"

using abs_hil::report::Decimation;
using abs_hil::report::Point;

namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

std::vector<Point> thinned(const std::vector<Point>& rows, std::size_t most) {
  Decimation decimation(most);
  for (const Point& row : rows) decimation.add(row.x, row.y);
  return decimation.points();
}

std::vector<Point> noise(std::size_t count) {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  std::vector<Point> rows;
  for (std::size_t i = 0; i < count; ++i) rows.push_back({static_cast<double>(i), normal(generator)});
  return rows;
}

}  // namespace

TEST_CASE("A short curve stays as it is") {
  const auto rows = noise(100);
  const auto points = thinned(rows, 100);
  REQUIRE(points.size() == rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) CHECK(points[i].y == rows[i].y);
}

TEST_CASE("A long curve keeps its ends and the smallest and largest value of every stretch") {
  const auto rows = noise(100'003);
  const auto points = thinned(rows, 512);
  CHECK(points.size() <= 4 * 512);
  CHECK(points.front().x == rows.front().x);
  CHECK(points.back().x == rows.back().x);
  CHECK(std::is_sorted(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.x < b.x; }));
  // Stretches are a power of two of rows, here 256: 100003 rows in at most 512.
  constexpr std::size_t stretch = 256;
  for (std::size_t begin = 0; begin < rows.size(); begin += stretch) {
    const std::size_t end = std::min(begin + stretch, rows.size());
    const auto by_y = [](const Point& a, const Point& b) { return a.y < b.y; };
    const auto from = rows.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto to = rows.begin() + static_cast<std::ptrdiff_t>(end);
    for (const Point& extreme : {*std::min_element(from, to, by_y), *std::max_element(from, to, by_y)}) {
      CHECK(std::any_of(points.begin(), points.end(),
                        [&](const Point& p) { return p.x == extreme.x && p.y == extreme.y; }));
    }
  }
}

TEST_CASE("Every point of a thinned curve is a row") {
  const auto rows = noise(5000);
  for (const Point& point : thinned(rows, 64)) CHECK(rows[static_cast<std::size_t>(point.x)].y == point.y);
}

TEST_CASE("NaN breaks the curve and is at none of its ends") {
  const auto points =
      thinned({{0, none}, {1, 1}, {2, none}, {3, none}, {4, 2}, {5, std::numeric_limits<double>::infinity()}}, 16);
  REQUIRE(points.size() == 3);
  CHECK(points[0].y == 1.0);
  CHECK(std::isnan(points[1].y));
  CHECK(points[2].y == 2.0);
  CHECK(thinned({{0, none}, {1, none}}, 16).empty());
}
