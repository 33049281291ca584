#pragma once

#include <deque>
#include <span>
#include <vector>

#include "watch/cell_grid.hpp"
#include "watch/run_view.hpp"

namespace abs_hil::watch {

/// A rectangle of cells.
struct Area {
  int column{0};
  int row{0};
  int columns{0};
  int rows{0};
};

/// Draws lines with the dots of braille characters, 2 x 4 per cell, or with one ASCII character per cell. Lines are cut
/// off at the left and right of the area; above and below they run along the edge.
class DotCanvas {
 public:
  DotCanvas(CellGrid& grid, Area area, bool unicode);

  [[nodiscard]] int width() const noexcept { return width_; }    ///< dots
  [[nodiscard]] int height() const noexcept { return height_; }  ///< dots
  /// Draws a line from dot to dot; 0/0 is top left. `mark` is the line's character if there is no braille.
  void line(int x0, int y0, int x1, int y1, Style style, char mark) noexcept;

 private:
  void dot(int x, int y, Style style, char mark) noexcept;

  CellGrid& grid_;
  Area area_;
  int dots_across_;
  int dots_down_;
  int width_;
  int height_;
};

/// Range of a value axis.
struct ValueRange {
  double low{0.0};
  double high{1.0};
};

/// One quantity in a plot.
struct PlotLine {
  double Sample::*value{nullptr};
  Style style{Style::first_line};
  char mark{'*'};
};

/// Range of the lines' finite values with rounded ends. It always includes `least` and never exceeds `most`.
[[nodiscard]] ValueRange range_of(const std::deque<Sample>& samples, std::span<const PlotLine> lines, ValueRange least,
                                  ValueRange most);

/// Draws the last `window_s` seconds of run time up to `end_s`, with the newest sample at the right. NaN makes a gap.
void draw_plot(CellGrid& grid, Area area, const std::deque<Sample>& samples, std::span<const PlotLine> lines,
               ValueRange range, double end_s, double window_s, bool unicode);

}  // namespace abs_hil::watch
