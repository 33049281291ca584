#include "experiment/profile.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace abs_hil::experiment {

Profile::Profile(std::vector<Point> points, Between between) : points_(std::move(points)), between_(between) {
  for (std::size_t i = 0; i < points_.size(); ++i) {
    if (!std::isfinite(points_[i].time_s) || !std::isfinite(points_[i].value)) {
      throw std::invalid_argument("each point of a profile needs a finite time and value");
    }
    if (i > 0 && points_[i].time_s < points_[i - 1].time_s) {
      throw std::invalid_argument("the times of a profile must not decrease");
    }
  }
}

double Profile::at(double time_s) const noexcept {
  const auto after = std::upper_bound(points_.begin(), points_.end(), time_s,
                                      [](double time, const Point& point) { return time < point.time_s; });
  if (after == points_.begin()) return after->value;
  const Point& before = *(after - 1);
  if (after == points_.end() || between_ == Between::hold) return before.value;
  const double part = (time_s - before.time_s) / (after->time_s - before.time_s);
  return before.value + part * (after->value - before.value);
}

}  // namespace abs_hil::experiment
