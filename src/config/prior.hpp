// --prior FILE: what the controller has learnt of the rig in the last braking, for the next one. The file is a
// configuration file with a head that says for which model it holds.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "config/config_file.hpp"

namespace abs_hil::config {

/// The values of a prior, without its head. A file that is not there is the first braking's, and has none.
/// @param model  name of the run's model
/// Throws ConfigError for a file that is none, of another format, or learnt with another model.
[[nodiscard]] std::vector<FileValue> read_prior(const std::filesystem::path& file, std::string_view model);

/// The text of a prior.
/// @param learnt  keys below control. and their values
[[nodiscard]] std::string prior_text(const nlohmann::ordered_json& learnt, std::string_view model);

}  // namespace abs_hil::config
