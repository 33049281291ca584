#include "plant_sim/encoder.hpp"

#include <bit>
#include <cmath>

#include "rig/encoder_scale.hpp"

namespace abs_hil::plant_sim {

std::int32_t encoder_counts(double angle_rad, std::int32_t counts_per_rev) noexcept {
  const double counts = std::floor(angle_rad / rig::radians_per_count(counts_per_rev));
  // Keep the lowest 32 bits of the two's complement, as the register does.
  return std::bit_cast<std::int32_t>(static_cast<std::uint32_t>(static_cast<std::int64_t>(counts)));
}

}  // namespace abs_hil::plant_sim
