#pragma once

#include <limits>
#include <string_view>
#include <vector>

namespace abs_hil::plant_sim {

/// A factor over a parameter of the plant as a function of time or distance: constant pieces and ramps. Written as
///
///     AXIS: VALUE; VALUE at POSITION; VALUE from POSITION to POSITION; ...
///
/// with values in (0, 10]. The first value holds from the start; "at" jumps to a new value; "from ... to" is a linear
/// ramp to it. AXIS is "time" (s) or "distance" (m rolled by the lower wheel) since the start of the run, or "braking
/// time" or "braking distance" since the brake was first applied, before which the first value holds. Example: "braking
/// time: 1; 0.5 at 0.6; 1 from 1 to 1.2". An empty text is a constant factor of 1.
class FactorProfile {
 public:
  enum class Axis { time, distance };
  enum class Axes { time_or_distance, time_only };

  /// The factor along one piece: value + slope (position - begin), up to `end`.
  struct Piece {
    double begin{0.0};
    double end{std::numeric_limits<double>::infinity()};
    double value{1.0};
    double slope{0.0};

    /// The factor at `position` within the piece.
    [[nodiscard]] double at(double position) const noexcept { return value + slope * (position - begin); }
    [[nodiscard]] double highest() const noexcept { return slope > 0.0 ? at(end) : value; }
  };

  /// Throws std::invalid_argument with `key`, the invalid part and the valid form.
  /// @param axes  the permitted axes
  explicit FactorProfile(std::string_view text = {}, std::string_view key = "plant.friction_profile",
                         Axes axes = Axes::time_or_distance);

  [[nodiscard]] Axis axis() const noexcept { return axis_; }
  /// True if positions count from the first application of the brake, false if from the start.
  [[nodiscard]] bool from_braking() const noexcept { return from_braking_; }
  /// The pieces in order and without gaps, at least one; the last one has no end.
  [[nodiscard]] const std::vector<Piece>& pieces() const noexcept { return pieces_; }
  /// Highest value of all pieces.
  [[nodiscard]] double highest() const noexcept;

 private:
  Axis axis_{Axis::time};
  bool from_braking_{false};
  std::vector<Piece> pieces_{Piece{}};
};

}  // namespace abs_hil::plant_sim
