#pragma once

#include <cstdint>

namespace abs_hil::plant_sim {

/// Reading of a 32-bit incremental counter for an angle: the floor of angle / count, which wraps like the register. A
/// reversal counts back exactly. `counts_per_rev` > 0; the angle may be up to 2^52 counts. Real-time safe.
[[nodiscard]] std::int32_t encoder_counts(double angle_rad, std::int32_t counts_per_rev) noexcept;

}  // namespace abs_hil::plant_sim
