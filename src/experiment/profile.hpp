#pragma once

#include <cstdint>
#include <vector>

namespace abs_hil::experiment {

/// What happens between two points of a profile.
enum class Between : std::uint8_t { line, hold };

/// A value over the time since its phase began: through points in order, before the first and after the last constant.
/// Empty: no profile. `at` is real-time safe; all else is done before the run.
class Profile {
 public:
  struct Point {
    double time_s{0.0};
    double value{0.0};
  };

  Profile() = default;
  /// Throws std::invalid_argument for times that are not finite or do not rise, and for values that are not finite. Two
  /// points at the same time make a step: the second holds from then on.
  explicit Profile(std::vector<Point> points, Between between = Between::line);

  [[nodiscard]] bool empty() const noexcept { return points_.empty(); }
  [[nodiscard]] const std::vector<Point>& points() const noexcept { return points_; }
  [[nodiscard]] Between between() const noexcept { return between_; }
  /// The value at that time; the profile must not be empty.
  [[nodiscard]] double at(double time_s) const noexcept;

 private:
  std::vector<Point> points_{};
  Between between_{Between::line};
};

}  // namespace abs_hil::experiment
