#pragma once

#include <cstddef>
#include <vector>

namespace abs_hil::report {

/// A point of a curve; y is NaN where the curve is broken.
struct Point {
  double x;
  double y;
};

/// Thins a curve while it is read, with memory that does not grow with the curve. Rows are gathered in stretches of
/// equal length, and the first, smallest, largest and last value of each stretch remain (aggregation M4 of Jugel et
/// al., VLDB 2014, by rows instead of pixels). If a stretch is not wider than a pixel, the thinned line covers the same
/// pixels as the full one: peaks and chatter stay visible. Curves of at most `most_stretches` rows keep all rows.
class Decimation {
 public:
  /// @param most_stretches >= 2, even
  explicit Decimation(std::size_t most_stretches);

  /// Adds a row; x must not decrease. NaN as y breaks the curve.
  void add(double x, double y);
  /// The curve so far. A point with y = NaN marks a break; there are none at the ends.
  [[nodiscard]] std::vector<Point> points() const;

 private:
  /// Consecutive rows of the curve. `first.y` is NaN if none of them has a value.
  struct Stretch {
    Point first;
    Point least;
    Point greatest;
    Point last;
    void join(const Stretch& next);
  };

  std::size_t most_stretches_;
  std::size_t rows_a_stretch_{1};
  std::size_t rows_in_last_{0};
  std::vector<Stretch> stretches_;
};

}  // namespace abs_hil::report
