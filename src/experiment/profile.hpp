#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

namespace abs_hil::experiment {

/// How a profile continues between two points.
enum class Between : std::uint8_t { line, hold };

/// A value over the time since its phase began. It interpolates between points in order and stays constant before the
/// first and after the last. Empty: no profile. `at` is real-time safe; everything else happens before the run.
class Profile {
 public:
  struct Point {
    double time_s{0.0};
    double value{0.0};
  };

  Profile() = default;
  /// Throws std::invalid_argument for times that are not finite or decrease, and for values that are not finite. Two
  /// points at the same time make a step: the second value holds from then on.
  explicit Profile(std::vector<Point> points, Between between = Between::line)
      : points_(std::move(points)), between_(between) {
    for (std::size_t i = 0; i < points_.size(); ++i) {
      if (!std::isfinite(points_[i].time_s) || !std::isfinite(points_[i].value)) {
        throw std::invalid_argument("each point of a profile needs a finite time and value");
      }
      if (i > 0 && points_[i].time_s < points_[i - 1].time_s) {
        throw std::invalid_argument("the times of a profile must not decrease");
      }
    }
  }

  [[nodiscard]] bool empty() const noexcept { return points_.empty(); }
  [[nodiscard]] const std::vector<Point>& points() const noexcept { return points_; }
  [[nodiscard]] Between between() const noexcept { return between_; }
  /// Value at that time; the profile must not be empty.
  [[nodiscard]] double at(double time_s) const noexcept {
    const auto after = std::upper_bound(points_.begin(), points_.end(), time_s,
                                        [](double time, const Point& point) { return time < point.time_s; });
    if (after == points_.begin()) return after->value;
    const Point& before = *(after - 1);
    if (after == points_.end() || between_ == Between::hold) return before.value;
    const double part = (time_s - before.time_s) / (after->time_s - before.time_s);
    return before.value + part * (after->value - before.value);
  }

 private:
  std::vector<Point> points_{};
  Between between_{Between::line};
};

}  // namespace abs_hil::experiment
