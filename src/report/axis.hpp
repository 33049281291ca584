#pragma once

#include "report/figure.hpp"

namespace abs_hil::report {

/// Height of the y axis per mark.
inline constexpr double px_a_mark = 34.0;

/// An axis from `low` to `high` with a mark every `step`.
struct Axis {
  double low;
  double high;
  double step;
};

/// Marks at multiples of 1, 2 or 5 times a power of ten, about `wanted` of them; keeps the range unchanged.
[[nodiscard]] Axis axis_within(Range range, int wanted);
/// The same, but widens the range to whole steps, so that curves do not touch the frame.
[[nodiscard]] Axis axis_around(Range range, int wanted);
/// Smallest and largest y of the panel's curves within the range of x; [0, 1] if there are none.
[[nodiscard]] Range values_within(const Panel& panel, Range x);

}  // namespace abs_hil::report
