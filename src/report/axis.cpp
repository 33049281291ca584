#include "report/axis.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace abs_hil::report {

namespace {

double step_for(double span, int wanted) {
  const double rough = span / wanted;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= 0.999 * rough) return factor * power;
  }
  return 10.0 * power;
}

Range made_proper(Range range) {
  if (!std::isfinite(range.first) || !std::isfinite(range.second)) return {0.0, 1.0};
  const double size = std::max(std::abs(range.first), std::abs(range.second));
  if (range.second - range.first > 1e-9 * size && range.second > range.first) return range;
  const double room = size > 0.0 ? 0.5 * size : 0.5;  // a constant curve gets space above and below
  return {range.first - room, range.second + room};
}

}  // namespace

Axis axis_within(Range range, int wanted) {
  range = made_proper(range);
  return {range.first, range.second, step_for(range.second - range.first, wanted)};
}

Axis axis_around(Range range, int wanted) {
  range = made_proper(range);
  const double step = step_for(range.second - range.first, wanted);
  const double margin = 0.02 * (range.second - range.first);
  const auto rounded = [step](double value, double direction) {
    const double steps = value / step;
    return step * (direction < 0.0 ? std::floor(steps) : std::ceil(steps));
  };
  const double high = rounded(range.second + margin, 1.0);
  // An axis that begins at zero keeps zero as its end; a tiny negative value must not add a whole step.
  if (range.first >= 0.0 && range.first < margin) return {0.0, high, step};
  if (range.first < 0.0 && range.first > -2.0 * margin) return {range.first - 0.5 * margin, high, step};
  return {rounded(range.first - margin, -1.0), high, step};
}

Range values_within(const Panel& panel, Range x) {
  Range values{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const auto take = [&values](double y) {
    if (!std::isfinite(y)) return;
    values.first = std::min(values.first, y);
    values.second = std::max(values.second, y);
  };
  for (const Curve& curve : panel.curves) {
    for (const Point& point : curve.points) {
      if (point.x >= x.first && point.x <= x.second) take(point.y);
    }
    for (const auto& [low, high] : curve.bounds) {
      take(low);
      take(high);
    }
  }
  return values.first <= values.second ? values : Range{0.0, 1.0};
}

}  // namespace abs_hil::report
