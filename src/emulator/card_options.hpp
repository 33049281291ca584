#pragma once

#include <cstdint>

#include "abs_hil/plant_sim/options.hpp"

namespace abs_hil::emulator {

/// Properties of the emulated card and limits of its FPGA. Where the maker's sources give no value, this project chose
/// the default ("our choice"). Where they are silent or disagree, an option selects the variant, so that tests cover
/// both.
struct CardOptions {
  plant_sim::PlantOptions plant{};
  double start_speed_rad_s{0.0};                 ///< both wheels' speed at power-on, >= 0
  std::uint32_t bitstream_version{0xAB5};        ///< our choice: the real word is not public
  std::uint32_t channel_counts{0x3200};          ///< 3 counters (15:12), 2 timers (11:8); our choice
  double supply_V{24.0};                         ///< our choice; 0 = no supply
  double supply_min_V{15.0};                     ///< our choice
  double temperature_C{30.0};                    ///< our choice
  std::uint32_t temperature_max_C{90};           ///< our choice
  double overspeed_rpm{2200.0};                  ///< our choice; in the vendor's demo the lower wheel reaches 1700
  std::uint32_t velocity_period_ticks{400'000};  ///< ticks of 40 MHz; our choice: 10 ms
  std::uint32_t overspeed_bit{0};                ///< bit 0 or 2 of the trip flags; temperature has the other one
  bool trip_clears_width{false};                 ///< a trip zeroes the width registers as well as the outputs
};

}  // namespace abs_hil::emulator
