// What a cycle knows of the rig: the measurement of a board, and the speeds made of it.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

namespace abs_hil::rig {

inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

/// Angular speeds of both wheels, rad/s. `S` is a `double`, or a pack of them (rig/scalar.hpp).
template <class S>
struct BasicWheelSpeeds {
  S omega1_rad_s{0.0};  ///< upper wheel
  S omega2_rad_s{0.0};  ///< lower wheel
};
using WheelSpeeds = BasicWheelSpeeds<double>;

/// Bits of `Measurement::trip_flags`, as in the RT-DAC4/PCI. The order of two of them (temperature, overspeed) is not
/// known, so they form a pair.
namespace trip {
inline constexpr std::uint32_t temperature_or_overspeed = 1U << 0U | 1U << 2U;
inline constexpr std::uint32_t supply = 1U << 1U;
}  // namespace trip

/// No board counts so long; it stands for "not known".
inline constexpr std::int32_t no_edge_age = -1;

/// Measurement of a board in one cycle: encoder counts, never speeds. Trivially copyable.
struct Measurement {
  std::int64_t time_ns{0};       ///< monotonic time at which the counters were read
  std::int32_t upper_counts{0};  ///< upper wheel's encoder counter; wraps around at 32 bit
  std::int32_t lower_counts{0};  ///< lower wheel's encoder counter; wraps around at 32 bit
  /// Time from the edge that changed the counter last until `time_ns`, where the board stamps its edges; `no_edge_age`
  /// where it does not, and while the direction of that edge is not known.
  std::int32_t upper_edge_age_ns{no_edge_age};
  std::int32_t lower_edge_age_ns{no_edge_age};
  double supply_V{unknown};       ///< power supply; NaN if the board does not measure it
  double temperature_C{unknown};  ///< power stage; NaN if the board does not measure it
  std::uint32_t trip_flags{0};    ///< the board's own interlocks, `trip` bits; 0 = none tripped
  /// Only the simulator with `plant.ideal_sensors` sets this; hardware never does. Estimators use it unchanged.
  std::optional<WheelSpeeds> ideal_speeds{};
};

}  // namespace abs_hil::rig
