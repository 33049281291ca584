// An encoder's disc that is not centred: its error in the readings, and a fit of it while the wheel coasts.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "abs_hil/rig/parameters.hpp"
#include "rig/encoder_scale.hpp"

namespace abs_hil::control {

/// A wheel's encoder disc as the model knows it. It turns readings into the counts by which the wheel itself has
/// turned: those of the reading without what the disc's eccentricity adds to them. Real-time safe.
class EncoderDisc {
 public:
  /// @param counts_per_rev  encoder counts per revolution, > 0
  EncoderDisc(const rig::EccentricityParameters& eccentricity, std::int32_t counts_per_rev) noexcept
      : eccentricity_{eccentricity}, counts_per_rev_{counts_per_rev} {}

  /// Starts from a reading.
  void reset(std::int32_t counts) noexcept {
    counts_ = counts;
    turned_ = counts;
    know(eccentricity_);
  }
  /// Takes the next reading. Returns the counts by which the wheel has turned since the last one. The counter may wrap
  /// around.
  double take(std::int32_t counts) noexcept {
    const std::int32_t travel = rig::counts_between(counts_, counts);
    counts_ = counts;
    turned_ += travel;
    return eccentric() ? corrected(travel) : static_cast<double>(travel);
  }
  /// Replaces what is known of the eccentricity. It counts from the next reading on.
  void know(const rig::EccentricityParameters& eccentricity) noexcept;

 private:
  [[nodiscard]] bool eccentric() const noexcept { return eccentricity_.eccentricity_rad > 0.0; }
  [[nodiscard]] double corrected(std::int32_t travel) noexcept;
  [[nodiscard]] double error_counts() const noexcept;

  rig::EccentricityParameters eccentricity_;
  std::int32_t counts_per_rev_;
  std::int32_t counts_{0};    ///< the latest reading
  std::int64_t turned_{0};    ///< the same without wrapping around
  double error_counts_{0.0};  ///< of the latest reading
};

/// Fits a disc's eccentricity to the readings of a wheel that turns without brake: angle over time is a cubic, and the
/// reading differs from it by A cos + B sin of itself. Least squares over blocks of a fixed time, each with its own
/// result; the cubic follows bearing friction and a steady motor over a second to far below a count. A block that it
/// does not follow, as when the motor's torque jumps, has none. Less than a quarter of a count, which the fit cannot
/// tell from what counting leaves and which no law minds, is found as 0. Real-time safe: a fixed number of operations.
class EccentricityFit {
 public:
  /// @param block_s  length of a block, > 0
  EccentricityFit(double block_s, std::int32_t counts_per_rev) noexcept;

  /// Forgets the present block.
  void restart() noexcept { samples_ = 0; }
  /// Takes a reading. Returns the block's result where it completes one in which the wheel turned often enough.
  [[nodiscard]] std::optional<rig::EccentricityParameters> take(std::int64_t time_ns, std::int32_t counts) noexcept;

 private:
  static constexpr std::size_t unknowns = 6;

  void begin(std::int64_t time_ns, std::int32_t counts) noexcept;
  [[nodiscard]] std::optional<rig::EccentricityParameters> solved() noexcept;

  double block_s_;
  std::int32_t counts_per_rev_;
  std::int64_t start_ns_{0};
  std::int32_t start_counts_{0};
  std::int32_t latest_counts_{0};
  std::int64_t travel_{0};  ///< since the block's start
  std::int64_t samples_{0};
  double squares_rad2_{0.0};                                         ///< sum over the block of the angle's square
  std::array<std::array<double, unknowns + 1>, unknowns> normal_{};  ///< equations, with their right-hand side
};

}  // namespace abs_hil::control
