#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "report/run_files.hpp"

/// Readers of the files beside a run's CSV. They read whole files, which are small, and throw InputError for a file
/// that cannot be read.
namespace abs_hil::report {

[[nodiscard]] std::string read_text(const std::filesystem::path& path);
[[nodiscard]] nlohmann::ordered_json read_json(const std::filesystem::path& path);
/// Values as text under dotted keys. @param json  an object
[[nodiscard]] std::map<std::string, std::string> flattened(const nlohmann::ordered_json& json);
[[nodiscard]] std::map<std::string, std::string> read_toml(const std::filesystem::path& path);
[[nodiscard]] std::vector<RunEvent> read_events(const std::filesystem::path& path);
[[nodiscard]] TimingHistogram read_histogram(const std::filesystem::path& path);

}  // namespace abs_hil::report
