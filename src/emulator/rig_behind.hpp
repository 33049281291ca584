#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/plant.hpp"
#include "emulator/card_model.hpp"

namespace abs_hil::emulator {

// What the rig behind a board does whatever the board.

/// Slower than this a wheel counts as stopped: less than an encoder line in the card's velocity period.
inline constexpr double standstill_rad_s = 0.5;

/// Both wheels at one speed at power-on. Throws std::invalid_argument unless it is finite and >= 0.
void start_wheels(plant_sim::Plant& plant, double speed_rad_s);

/// The faster wheel's speed, without its sign.
[[nodiscard]] double fastest_rad_s(const plant_sim::Plant& plant) noexcept;

/// Rotational speed in rad/s of so many revolutions a minute.
[[nodiscard]] double rad_s_of_rpm(double rpm) noexcept;

/// Somebody turns a standing wheel by hand.
void turn_wheel(plant_sim::Plant& plant, bool upper_wheel, double revolutions) noexcept;

/// Where a step from `from_ns` towards `to_ns` ends: steps end on multiples of `step_ns` wherever the host's accesses
/// fall.
[[nodiscard]] std::int64_t step_end_ns(std::int64_t from_ns, std::int64_t to_ns, std::int64_t step_ns) noexcept;

/// Lets the rig go on for a step under what reaches the power stage.
void step(plant_sim::Plant& plant, std::int64_t duration_ns, const Outputs& out) noexcept;

}  // namespace abs_hil::emulator
