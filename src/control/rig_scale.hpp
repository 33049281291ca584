// How large a rig's forces are, against those of the paper's rig, for which gains that carry units were chosen.
#pragma once

#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// Wheels decelerate by much the same m/s^2 on every rig, so forces are in proportion to the mass J2/r2^2 that the
/// lower wheel stands for, and torques to that times r1. Both are exactly 1 for the paper's wheels.
struct RigScale {
  double force{1.0};
  double torque{1.0};
};
[[nodiscard]] constexpr RigScale rig_scale(const rig::WheelParameters& w) noexcept {
  const rig::WheelParameters paper{};
  const double force = (w.J2_kg_m2 / (w.r2_m * w.r2_m)) / (paper.J2_kg_m2 / (paper.r2_m * paper.r2_m));
  return {.force = force, .torque = force * (w.r1_m / paper.r1_m)};
}

}  // namespace abs_hil::control
