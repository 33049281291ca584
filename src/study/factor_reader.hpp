#pragma once

#include <vector>

#include "config/reader.hpp"
#include "study/factor.hpp"

namespace abs_hil::study {

/// Reads the table [factors], in the order of the file. Every value that a factor can take is checked against its key.
/// Throws config::ConfigError, naming line and column.
[[nodiscard]] std::vector<Factor> read_factors(const config::Source& source, const toml::table& table);

}  // namespace abs_hil::study
