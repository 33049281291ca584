#pragma once

#include <string>
#include <vector>

#include "abs_hil/control/options.hpp"
#include "abs_hil/rig/parameters.hpp"

namespace abs_hil::control {

/// Settings of the chosen controller that cannot do what they seem to ask for, one sentence each, for the user.
[[nodiscard]] std::vector<std::string> silent_settings(const ControlOptions& options, const rig::RigParameters& rig);

}  // namespace abs_hil::control
