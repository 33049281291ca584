#include "watch/plot.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace abs_hil::watch {
namespace {

constexpr char32_t braille_blank = 0x2800;
constexpr int braille_columns = 2;
constexpr int braille_rows = 4;
/// Bit of the dot at column x, row y of a braille character.
constexpr std::array<std::array<unsigned, braille_rows>, braille_columns> braille_bits{
    {{0x01, 0x02, 0x04, 0x40}, {0x08, 0x10, 0x20, 0x80}}};

/// The smallest number of the series 1, 2, 5, 10, 20 ... (and its tenths) that is at least `least`, > 0.
double round_step(double least) {
  const double power = std::pow(10.0, std::floor(std::log10(least)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= least * (1.0 - 1e-12)) return factor * power;
  }
  return 10.0 * power;
}

}  // namespace

DotCanvas::DotCanvas(CellGrid& grid, Area area, bool unicode)
    : grid_(grid),
      area_(area),
      dots_across_(unicode ? braille_columns : 1),
      dots_down_(unicode ? braille_rows : 1),
      width_(std::max(area.columns, 0) * dots_across_),
      height_(std::max(area.rows, 0) * dots_down_) {}

void DotCanvas::dot(int x, int y, Style style, char mark) noexcept {
  if (x < 0 || x >= width_ || height_ == 0) return;
  y = std::clamp(y, 0, height_ - 1);
  const int column = area_.column + x / dots_across_;
  const int row = area_.row + y / dots_down_;
  if (dots_across_ == 1) {
    grid_.put(column, row, {static_cast<char32_t>(mark), 0, style});
    return;
  }
  Cell cell = grid_.at(column, row);
  if (cell.glyph < braille_blank || cell.glyph > braille_blank + 0xFF) cell.glyph = braille_blank;
  cell.glyph |= braille_bits[static_cast<std::size_t>(x % braille_columns)][static_cast<std::size_t>(y % braille_rows)];
  cell.style = style;
  grid_.put(column, row, cell);
}

void DotCanvas::line(int x0, int y0, int x1, int y1, Style style, char mark) noexcept {
  if (height_ == 0 || width_ == 0) return;
  // Clamp first, so that a line to a far point costs nothing.
  y0 = std::clamp(y0, 0, height_ - 1);
  y1 = std::clamp(y1, 0, height_ - 1);
  if (std::max(x0, x1) < 0 || std::min(x0, x1) >= width_) return;
  x0 = std::clamp(x0, -1, width_);
  x1 = std::clamp(x1, -1, width_);
  const int steps = std::max(std::abs(x1 - x0), std::abs(y1 - y0));
  for (int i = 0; i <= steps; ++i) {
    const double part = steps == 0 ? 0.0 : static_cast<double>(i) / steps;
    dot(x0 + static_cast<int>(std::lround(part * (x1 - x0))), y0 + static_cast<int>(std::lround(part * (y1 - y0))),
        style, mark);
  }
}

ValueRange range_of(const std::deque<Sample>& samples, std::span<const PlotLine> lines, ValueRange least,
                    ValueRange most) {
  ValueRange range = least;
  for (const PlotLine& line : lines) {
    for (const Sample& sample : samples) {
      const double value = sample.*line.value;
      if (!std::isfinite(value)) continue;
      range.low = std::min(range.low, value);
      range.high = std::max(range.high, value);
    }
  }
  range = {std::max(range.low, most.low), std::min(range.high, most.high)};
  const double step = round_step(std::max(range.high - range.low, 1e-9) / 4.0);
  return {std::max(std::floor(range.low / step + 1e-9) * step, most.low),
          std::min(std::ceil(range.high / step - 1e-9) * step, most.high)};
}

void draw_plot(CellGrid& grid, Area area, const std::deque<Sample>& samples, std::span<const PlotLine> lines,
               ValueRange range, double end_s, double window_s, bool unicode) {
  DotCanvas canvas(grid, area, unicode);
  if (canvas.width() == 0 || canvas.height() == 0) return;
  const auto x_of = [&](double time_s) {
    const double fraction = 1.0 - (end_s - time_s) / window_s;
    return static_cast<int>(std::lround(std::clamp(fraction, -1.0, 2.0) * (canvas.width() - 1)));
  };
  const auto y_of = [&](double value) {
    const double fraction = std::clamp((range.high - value) / (range.high - range.low), 0.0, 1.0);
    return static_cast<int>(std::lround(fraction * (canvas.height() - 1)));
  };
  for (const PlotLine& line : lines) {
    bool gap = true;
    int x0 = 0;
    int y0 = 0;
    for (const Sample& sample : samples) {
      const double value = sample.*line.value;
      gap = gap || sample.after_gap;
      if (std::isnan(value)) {
        gap = true;
        continue;
      }
      const int x = x_of(sample.time_s);
      const int y = y_of(value);
      if (gap || x != x0 || y != y0) canvas.line(gap ? x : x0, gap ? y : y0, x, y, line.style, line.mark);
      gap = false;
      x0 = x;
      y0 = y;
    }
  }
}

}  // namespace abs_hil::watch
