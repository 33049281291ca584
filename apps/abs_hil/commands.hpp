#pragma once

#include <string>
#include <vector>

#include "command_line.hpp"

namespace abs_hil::app {

/// Runs an experiment and returns the exit status. Throws what the parts throw: see main.cpp.
int run(const RunRequest& request);
/// `abs_hil compare`: controllers side by side in simulation. Throws settings::ConfigError and std::invalid_argument.
int compare(const CompareOptions& options);
/// `abs_hil list`: controllers, plants, experiments and backends, or all configuration keys.
int list(bool keys);
/// `abs_hil doctor`: checks this machine, all of it or the one named, and says how to mend what falls short.
int doctor(const std::string& only);
/// What `doctor` can check.
[[nodiscard]] std::vector<std::string> doctor_checks();

}  // namespace abs_hil::app
