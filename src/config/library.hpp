#pragma once

#include <memory>
#include <string>
#include <vector>

#include "config/script.hpp"

namespace abs_hil::config {

/// The experiment of that name, a file in config_dir()/experiments, or the file itself if it is a path or ends in
/// .toml. The process reads each file once. Throws config::ConfigError, naming the known ones. Thread-safe.
[[nodiscard]] std::shared_ptr<const Script> find(const std::string& name_or_file);

/// The experiments in config_dir()/experiments, by name.
[[nodiscard]] std::vector<std::shared_ptr<const Script>> known_experiments();

}  // namespace abs_hil::config
