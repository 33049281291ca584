// Settings that have no effect.
#pragma once

#include <string>
#include <vector>

#include "abs_hil/control/options.hpp"

namespace abs_hil::control {

/// Settings of the chosen controller that cannot do what they seem to ask for, one sentence each, for the user.
[[nodiscard]] std::vector<std::string> silent_settings(const ControlOptions& options);

}  // namespace abs_hil::control
