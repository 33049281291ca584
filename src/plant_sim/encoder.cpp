// Counts of the encoders, with the flaws of their discs.
#include "plant_sim/encoder.hpp"

#include <bit>
#include <cmath>
#include <numbers>

#include "abs_hil/rig/scalar.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::plant_sim {
namespace {

/// Quotient rounded down, for a divisor > 0.
std::int64_t whole_turns(std::int64_t edges, std::int64_t counts_per_rev) noexcept {
  return edges / counts_per_rev - (edges % counts_per_rev < 0 ? 1 : 0);
}

/// The eccentricity that both encoders have, in the phase of this one, added to its own.
rig::EccentricityParameters beside(double both_rad, rig::EccentricityParameters own) noexcept {
  own.eccentricity_rad += both_rad;
  return own;
}

}  // namespace

Encoder::Encoder(std::int32_t counts_per_rev, const rig::EccentricityParameters& eccentricity,
                 const EncoderFlaws& flaws) noexcept
    : rad_per_count_(rig::radians_per_count(counts_per_rev)),
      counts_per_rev_(counts_per_rev),
      eccentricity_(eccentricity),
      flaws_(flaws),
      // Where the disc stands half a turn from its zero.
      bad_place_(std::llround((0.5 - eccentricity.phase_rad * (0.5 / std::numbers::pi)) * counts_per_rev)) {}

std::int64_t Encoder::position(double angle_rad, double offset_rad) const noexcept {
  double read_rad = angle_rad + offset_rad;
  if (eccentricity_.eccentricity_rad > 0.0)
    read_rad += eccentricity_.eccentricity_rad *
                rig::sine(std::remainder(angle_rad + eccentricity_.phase_rad, 2.0 * std::numbers::pi));
  const double counts = read_rad / rad_per_count_;
  // Rounded down without std::floor, which is a call or a long detour where a processor may lack the instruction.
  auto edge = static_cast<std::int64_t>(counts);
  if (static_cast<double>(edge) > counts) --edge;
  // The odd edges come late. A disc without this flaw does not ask: half of the edges are odd, which no processor
  // predicts.
  if (flaws_.slot_error_counts > 0.0 && (edge & 1) != 0 &&
      counts - static_cast<double>(edge) < flaws_.slot_error_counts)
    --edge;
  return flaws_.lost_counts > 0 ? without_lost(edge) : edge;
}

/// The bad place covers `lost_counts` edges in each turn.
std::int64_t Encoder::without_lost(std::int64_t edge) const noexcept {
  const std::int64_t lost = flaws_.lost_counts < counts_per_rev_ ? flaws_.lost_counts : counts_per_rev_ - 1;
  const auto behind = [&](std::int64_t of) {
    const std::int64_t turns = whole_turns(of - bad_place_, counts_per_rev_);
    const std::int64_t into = of - bad_place_ - turns * counts_per_rev_;
    return turns * lost + (into < lost ? into : lost);
  };
  return edge - (behind(edge) - behind(0));
}

std::int32_t Encoder::counts(double angle_rad, double offset_rad) const noexcept {
  // The register keeps the lowest 32 bits of the two's complement.
  return std::bit_cast<std::int32_t>(static_cast<std::uint32_t>(position(angle_rad, offset_rad)));
}

Encoder upper_encoder(const PlantOptions& plant) noexcept {
  return {plant.rig.encoder_counts_per_rev, beside(plant.encoder_eccentricity_rad, plant.rig.upper_encoder),
          plant.upper_encoder_flaws};
}
Encoder lower_encoder(const PlantOptions& plant) noexcept {
  return {plant.rig.encoder_counts_per_rev, beside(plant.encoder_eccentricity_rad, plant.rig.lower_encoder),
          plant.lower_encoder_flaws};
}

}  // namespace abs_hil::plant_sim
