#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/options.hpp"

namespace abs_hil::emulator {

/// What the emulated card is and how its FPGA's limits are set. Defaults that the sources do not give are ours, and
/// those on which they are silent or disagree can be turned round, so that a driver is tried on both.
struct CardOptions {
  plant_sim::PlantOptions plant{};
  double start_speed_rad_s{0.0};                 ///< both wheels' speed at power-on, >= 0
  std::uint32_t bitstream_version{0xAB5};        ///< ours: the real word is not public
  std::uint32_t channel_counts{0x3200};          ///< 3 counters (15:12), 2 timers (11:8); ours
  double supply_V{24.0};                         ///< ours; 0 = no supply
  double supply_min_V{15.0};                     ///< ours
  double temperature_C{30.0};                    ///< ours
  std::uint32_t temperature_max_C{90};           ///< ours
  double overspeed_rpm{2200.0};                  ///< ours; the vendor's demo lets the lower wheel reach 1700
  std::uint32_t velocity_period_ticks{400'000};  ///< of 40 MHz; ours: 10 ms
  std::uint32_t overspeed_bit{0};                ///< 0 or 2 of the trip flags; temperature has the other one
  bool trip_clears_width{false};                 ///< a trip zeroes the width registers too, not only the outputs
};

}  // namespace abs_hil::emulator
