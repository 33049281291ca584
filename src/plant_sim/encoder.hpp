// The simulated encoders: counts from a wheel's angle.
#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/options.hpp"

namespace abs_hil::plant_sim {

/// An encoder with the flaws of its disc. Its reading is the floor of angle / count, but for the flaws. It depends on
/// the wheel's angle alone, so a reversal counts back exactly. Real-time safe.
class Encoder {
 public:
  Encoder(std::int32_t counts_per_rev, const rig::EccentricityParameters& eccentricity,
          const EncoderFlaws& flaws) noexcept;

  /// Counts since angle 0 by a counter that does not wrap. The angle may be up to 2^52 counts.
  /// @param offset_rad  of the edges from the wheel's angle 0
  [[nodiscard]] std::int64_t position(double angle_rad, double offset_rad = 0.0) const noexcept;
  /// The same, as the 32-bit register has it, which wraps.
  [[nodiscard]] std::int32_t counts(double angle_rad, double offset_rad = 0.0) const noexcept;

 private:
  [[nodiscard]] std::int64_t without_lost(std::int64_t edge) const noexcept;

  double rad_per_count_;
  std::int64_t counts_per_rev_;
  rig::EccentricityParameters eccentricity_;
  EncoderFlaws flaws_;
  std::int64_t bad_place_;  ///< edge at which the disc loses counts
};

[[nodiscard]] Encoder upper_encoder(const PlantOptions& plant) noexcept;
[[nodiscard]] Encoder lower_encoder(const PlantOptions& plant) noexcept;

}  // namespace abs_hil::plant_sim
