#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/plant.hpp"
#include "emulator/card_model.hpp"

namespace abs_hil::emulator {

// The simulated rig behind a board, the same for every board.

/// A slower wheel counts as stopped: it moves less than one encoder line in the card's velocity period.
inline constexpr double standstill_rad_s = 0.5;

/// State with both wheels at the same speed at power-on. Throws std::invalid_argument unless it is finite and >= 0.
void start_wheels(plant_sim::Plant& plant, double speed_rad_s);

/// Absolute speed of the faster wheel.
[[nodiscard]] double fastest_rad_s(const plant_sim::Plant& plant) noexcept;

/// Converts revolutions per minute to rad/s.
[[nodiscard]] double rad_s_of_rpm(double rpm) noexcept;

/// Turns a standing wheel by hand.
void turn_wheel(plant_sim::Plant& plant, bool upper_wheel, double revolutions) noexcept;

/// End of a step from `from_ns` towards `to_ns`. Steps end on multiples of `step_ns`, independent of the times of the
/// host's accesses.
[[nodiscard]] std::int64_t step_end_ns(std::int64_t from_ns, std::int64_t to_ns, std::int64_t step_ns) noexcept;

/// Advances the rig by one step under the given duties at the power stage.
void step(plant_sim::Plant& plant, std::int64_t duration_ns, const Outputs& out) noexcept;

}  // namespace abs_hil::emulator
