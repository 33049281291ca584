#pragma once

#include "report/figure.hpp"

namespace abs_hil::report {

/// Height that a mark of a y axis has.
inline constexpr double px_a_mark = 34.0;

/// An axis from `low` to `high` with a mark every `step`.
struct Axis {
  double low;
  double high;
  double step;
};

/// Marks at multiples of 1, 2 or 5 times a power of ten, about `wanted` of them, within the range as it is.
[[nodiscard]] Axis axis_within(Range range, int wanted);
/// The same, the range widened to whole steps, so that curves keep off the frame.
[[nodiscard]] Axis axis_around(Range range, int wanted);
/// Least and greatest y of the panel's curves within the range of x; [0, 1] where there are none.
[[nodiscard]] Range values_within(const Panel& panel, Range x);

}  // namespace abs_hil::report
