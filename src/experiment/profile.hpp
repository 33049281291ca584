#pragma once

#include <cstdint>
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
  explicit Profile(std::vector<Point> points, Between between = Between::line);

  [[nodiscard]] bool empty() const noexcept { return points_.empty(); }
  [[nodiscard]] const std::vector<Point>& points() const noexcept { return points_; }
  [[nodiscard]] Between between() const noexcept { return between_; }
  /// Value at that time; the profile must not be empty.
  [[nodiscard]] double at(double time_s) const noexcept;

 private:
  std::vector<Point> points_{};
  Between between_{Between::line};
};

}  // namespace abs_hil::experiment
