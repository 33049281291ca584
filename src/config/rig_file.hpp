#pragma once

#include <string>
#include <string_view>

#include "config/settings.hpp"

namespace abs_hil::config {

/// A plant's file to fill in for a rig of one's own: every key of `plant` with its value in `settings`, its meaning,
/// unit and range, and where to read it off the rig. It can be given to --plant and --model at once.
/// @param name  of the rig, for the first lines
[[nodiscard]] std::string rig_file(const Settings& settings, std::string_view name);

}  // namespace abs_hil::config
