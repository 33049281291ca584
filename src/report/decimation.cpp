#include "report/decimation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace abs_hil::report {

Decimation::Decimation(std::size_t most_stretches) : most_stretches_(most_stretches) {}

void Decimation::Stretch::join(const Stretch& next) {
  if (std::isnan(next.first.y)) return;
  if (std::isnan(first.y)) {
    *this = next;
    return;
  }
  if (next.least.y < least.y) least = next.least;
  if (next.greatest.y > greatest.y) greatest = next.greatest;
  last = next.last;
}

void Decimation::add(double x, double y) {
  const Point point{x, std::isfinite(y) ? y : std::numeric_limits<double>::quiet_NaN()};
  const Stretch row{point, point, point, point};
  if (!stretches_.empty() && rows_in_last_ < rows_a_stretch_) {
    stretches_.back().join(row);
    ++rows_in_last_;
    return;
  }
  if (stretches_.size() == most_stretches_) {
    for (std::size_t i = 0; i + 1 < stretches_.size(); i += 2) {
      stretches_[i].join(stretches_[i + 1]);
      stretches_[i / 2] = stretches_[i];
    }
    stretches_.resize(stretches_.size() / 2);
    rows_a_stretch_ *= 2;
  }
  stretches_.push_back(row);
  rows_in_last_ = 1;
}

std::vector<Point> Decimation::points() const {
  std::vector<Point> points;
  for (const Stretch& stretch : stretches_) {
    if (std::isnan(stretch.first.y)) {
      if (!points.empty() && !std::isnan(points.back().y)) points.push_back(stretch.first);
      continue;
    }
    std::array<Point, 4> kept{stretch.first, stretch.least, stretch.greatest, stretch.last};
    if (kept[1].x > kept[2].x) std::swap(kept[1], kept[2]);
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const bool repeated = i > 0 && kept[i].x == kept[i - 1].x && kept[i].y == kept[i - 1].y;
      if (!repeated) points.push_back(kept[i]);
    }
  }
  if (!points.empty() && std::isnan(points.back().y)) points.pop_back();
  return points;
}

}  // namespace abs_hil::report
