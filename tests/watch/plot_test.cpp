#include "watch/plot.hpp"

#include <array>
#include <cmath>
#include <deque>

#include "catch.hpp"
#include "messages.hpp"
#include "watch/cell_grid.hpp"

using namespace abs_hil::watch;
using abs_hil::rig::unknown;

namespace {

const std::array slip_line{PlotLine{&Sample::slip, Style::first_line, '*'}};

std::deque<Sample> ramp(int count, double from, double to) {
  std::deque<Sample> samples;
  for (int i = 0; i < count; ++i) {
    const double part = static_cast<double>(i) / (count - 1);
    samples.push_back({.time_s = 10.0 * part, .slip = from + (to - from) * part});
  }
  return samples;
}

std::string drawn(const std::deque<Sample>& samples, int columns, int rows, bool unicode,
                  ValueRange range = {0.0, 1.0}) {
  CellGrid grid(columns, rows);
  draw_plot(grid, {0, 0, columns, rows}, samples, slip_line, range, 10.0, 10.0, unicode);
  return grid.to_text();
}

}  // namespace

TEST_CASE("each dot of a braille character is where its bit says") {
  // U+2800 + the bit, by the Unicode standard's table: dots 1 2 3 7 down the left, 4 5 6 8 down the right.
  const std::array<std::array<char32_t, 4>, 2> expected{{{U'⠁', U'⠂', U'⠄', U'⡀'}, {U'⠈', U'⠐', U'⠠', U'⢀'}}};
  for (int x = 0; x < 2; ++x) {
    for (int y = 0; y < 4; ++y) {
      CellGrid grid(1, 1);
      DotCanvas(grid, {0, 0, 1, 1}, true).line(x, y, x, y, Style::normal, '*');
      CHECK(grid.at(0, 0).glyph == expected[static_cast<std::size_t>(x)][static_cast<std::size_t>(y)]);
    }
  }
}

TEST_CASE("a ramp over the window runs from one corner to the other") {
  CHECK(drawn(ramp(1000, 0.0, 1.0), 4, 4, false) == "   *\n  *\n *\n*\n");
  CHECK(drawn(ramp(1000, 0.0, 1.0), 2, 1, true) == "⡠⠊\n");
  CHECK(drawn(ramp(2, 0.0, 1.0), 4, 4, false) == "   *\n  *\n *\n*\n");  // two messages are joined by a line
}

TEST_CASE("unknown and lost values are gaps") {
  std::deque<Sample> partly = ramp(11, 0.5, 0.5);
  for (std::size_t i = 4; i < 8; ++i) partly[i].slip = unknown;
  CHECK(drawn(partly, 11, 1, false) == "****    ***\n");
  std::deque<Sample> lost = ramp(11, 0.5, 0.5);
  lost.erase(lost.begin() + 4, lost.begin() + 8);
  CHECK(drawn(lost, 11, 1, false) == "***********\n");  // decimated messages are joined
  lost[4].after_gap = true;
  CHECK(drawn(lost, 11, 1, false) == "****    ***\n");
}

TEST_CASE("values beyond the range run along the edge, times beyond the window are left out") {
  CHECK(drawn(ramp(5, 1e300, 1e300), 3, 3, false) == "***\n\n\n");
  std::deque<Sample> endless = ramp(5, 0.5, 0.5);
  for (Sample& sample : endless) sample.slip = -INFINITY;
  CHECK(drawn(endless, 3, 3, false) == "\n\n***\n");
  std::deque<Sample> old = ramp(2, 0.5, 0.5);
  old[0].time_s = -1e12;
  old[1].time_s = -1e11;
  CHECK(drawn(old, 3, 1, false) == "\n");
  CHECK(drawn(ramp(5, 0.0, 1.0), 0, 3, true) == "\n\n\n");
}

TEST_CASE("the range holds the values on round numbers, no more than allowed") {
  const auto range = [](double from, double to) {
    return range_of(ramp(9, from, to), slip_line, {0.0, 0.3}, {-0.2, 1.0});
  };
  CHECK(range(0.1, 0.2).low == 0.0);
  CHECK_THAT(range(0.1, 0.2).high, Catch::Matchers::WithinAbs(0.3, 1e-12));
  CHECK_THAT(range(0.1, 0.61).high, Catch::Matchers::WithinAbs(0.8, 1e-12));
  CHECK_THAT(range(-0.05, 0.2).low, Catch::Matchers::WithinAbs(-0.1, 1e-12));
  CHECK(range(-1e300, 1e300).low == -0.2);
  CHECK(range(-1e300, 1e300).high == 1.0);
  const auto none = range_of({}, slip_line, {0.0, 0.3}, {-0.2, 1.0});
  CHECK(none.high > none.low);
}
