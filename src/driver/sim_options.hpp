#pragma once

#include <string>

#include "abs_hil/rig/option.hpp"
#include "driver/board_rows.hpp"

namespace abs_hil::driver {

/// Everything below `driver.sim.` in the configuration: the board of the simulated rig.
struct SimOptions {
  ABS_HIL_OPTIONS(SimOptions);
  /// As the RT-DAC4/PCI in the vendor's demos.
  ABS_HIL_OPTION(std::string, pwm_mode, "12-bit", .meaning = pwm_width.meaning, .allowed = pwm_width.allowed,
                 .safety = rig::no_effect_on_safety);
};

}  // namespace abs_hil::driver
