#pragma once

#include "abs_hil/plant_sim/plant.hpp"
#include "catch.hpp"

// Properties of any rig under the brake.
namespace abs_hil::plant_sim {

/// Under the full brake the upper wheel locks first and stays locked, then the lower one stops. Both stay at exactly 0
/// and are never negative.
inline void check_locks_then_stands(Plant& plant, int most_ms) {
  int locked_at = -1;
  int standing_at = -1;
  for (int tick = 0; tick < most_ms; ++tick) {
    plant.advance(1e-3, {.brake_duty = 1.0});
    const PlantState& s = plant.state();
    REQUIRE(s.omega1_rad_s >= 0.0);
    REQUIRE(s.omega2_rad_s >= 0.0);
    if (s.omega1_rad_s == 0.0 && locked_at < 0) locked_at = tick;
    if (locked_at >= 0) REQUIRE(s.omega1_rad_s == 0.0);
    if (s.omega2_rad_s == 0.0 && standing_at < 0) standing_at = tick;
    if (standing_at >= 0) REQUIRE(s.omega2_rad_s == 0.0);
  }
  CHECK(locked_at > 0);
  CHECK(standing_at > locked_at);
  const PlantState at_rest = plant.state();
  plant.advance(3600.0, {});
  CHECK(plant.state().angle1_rad == at_rest.angle1_rad);
  CHECK(plant.state().angle2_rad == at_rest.angle2_rad);
  CHECK(plant.slip() == 0.0);
}

/// Under any brake torque the wheels' kinetic energy never increases. `between(low, high)` draws a number.
template <typename Between>
void require_energy_never_rises(Plant& plant, double J1_kg_m2, double J2_kg_m2, Between between) {
  const auto energy_J = [&] {
    const PlantState& s = plant.state();
    return 0.5 * (J1_kg_m2 * s.omega1_rad_s * s.omega1_rad_s + J2_kg_m2 * s.omega2_rad_s * s.omega2_rad_s);
  };
  double before_J = energy_J();
  for (int tick = 0; tick < 100; ++tick) {
    plant.advance(between(0.1e-3, 2e-3), {.brake_duty = between(0.0, 1.0)});
    const double after_J = energy_J();
    INFO("tick " << tick << ": " << before_J << " J to " << after_J << " J");
    REQUIRE(after_J <= before_J * (1.0 + 1e-12));
    before_J = after_J;
  }
}

}  // namespace abs_hil::plant_sim
