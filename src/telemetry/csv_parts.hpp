#pragma once

#include <filesystem>
#include <vector>

namespace abs_hil::telemetry {

/// All RUN.*.csv beside RUN.csv, which hold what its columns cannot. In the order of their names.
[[nodiscard]] std::vector<std::filesystem::path> csv_parts(const std::filesystem::path& csv);

}  // namespace abs_hil::telemetry
