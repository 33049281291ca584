#pragma once

#include "config/key_table.hpp"

namespace abs_hil::config {

// Of keys that every board has.
inline constexpr Range board_duty_cap{0.0, 1.0, true, false};
inline constexpr Range counting_direction{-1.0, 1.0};

}  // namespace abs_hil::config
