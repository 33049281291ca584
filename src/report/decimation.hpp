#pragma once

#include <cstddef>
#include <vector>

namespace abs_hil::report {

/// A point of a curve; y is NaN where the curve is broken.
struct Point {
  double x;
  double y;
};

/// Thins a curve while it is read, with memory that does not grow with it: rows are gathered in stretches of equal
/// length, of which the first, least, greatest and last values remain (the aggregation M4 of Jugel et al., VLDB 2014,
/// by rows instead of pixels). A line through them covers the same pixels as one through all rows as long as a stretch
/// is not wider than a pixel: peaks and chatter stay. As long as there are at most `most_stretches` rows, all remain.
class Decimation {
 public:
  /// @param most_stretches >= 2, even
  explicit Decimation(std::size_t most_stretches);

  /// Rows in the order of their x. NaN as y breaks the curve.
  void add(double x, double y);
  /// The curve so far; breaks are points whose y is NaN, none at its ends.
  [[nodiscard]] std::vector<Point> points() const;

 private:
  /// Some rows of the curve. `first.y` is NaN if none of them has a value.
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
