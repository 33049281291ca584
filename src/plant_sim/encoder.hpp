// The simulated encoders: counts from a wheel's angle.
#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/options.hpp"

namespace abs_hil::plant_sim {

/// Reading of a 32-bit incremental counter for an angle: the floor of angle / count, which wraps like the register. A
/// reversal counts back exactly. `counts_per_rev` > 0; the angle may be up to 2^52 counts. Real-time safe.
[[nodiscard]] std::int32_t encoder_counts(double angle_rad, std::int32_t counts_per_rev) noexcept;

/// An encoder with the flaws of its disc. Its reading depends on the wheel's angle alone, so a reversal counts back
/// exactly, here too. Real-time safe.
class Encoder {
 public:
  Encoder(std::int32_t counts_per_rev, const rig::EccentricityParameters& eccentricity,
          const EncoderFlaws& flaws) noexcept;

  /// Counts since angle 0 by a counter that does not wrap. The angle may be up to 2^52 counts.
  /// @param offset_rad  of the edges from the wheel's angle 0
  [[nodiscard]] std::int64_t position(double angle_rad, double offset_rad = 0.0) const noexcept;
  /// The same, as the 32-bit register has it.
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
