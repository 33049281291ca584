#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "config/key_table.hpp"

namespace abs_hil::config {

/// One value of a configuration file.
struct FileValue {
  std::string name;  ///< dotted
  Value value;
  std::string origin;  ///< "FILE:LINE"
};

/// Reads a TOML file. Throws ConfigError, naming file and line.
/// @param only_table if not empty, the one table that the file may hold ("plant")
[[nodiscard]] std::vector<FileValue> read_file(const std::filesystem::path& file, std::string_view only_table = {});
/// Sets every value, in order. Throws ConfigError for one that its key does not take.
void set_all(const std::vector<FileValue>& values, KeyTable& table);
/// Reads a TOML file and sets every value in it.
void load_file(const std::filesystem::path& file, KeyTable& table, std::string_view only_table = {});

/// The folder of configuration files that belongs to this program: $ABS_HIL_CONFIG_DIR, else the installed one beside
/// the program, else the source tree's. Throws ConfigError if there is none.
[[nodiscard]] std::filesystem::path config_dir();

/// The folder that came with the program: as config_dir(), but without $ABS_HIL_CONFIG_DIR.
[[nodiscard]] std::filesystem::path own_config_dir();

/// A plant by name or file: `name` alone is config_dir()/plants/name.toml. Throws ConfigError, naming the known ones.
[[nodiscard]] std::filesystem::path plant_file(std::string_view name_or_file);

struct PlantEntry {
  std::string name;
  std::string description;
};
/// The plants in config_dir()/plants, by name.
[[nodiscard]] std::vector<PlantEntry> known_plants();

}  // namespace abs_hil::config
