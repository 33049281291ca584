#pragma once

#include <chrono>
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

/// The tables that a file may hold.
enum class Tables {
  all,
  of_plant,  ///< [plant] and [model] only: the file of a plant or a model
};

/// Reads a TOML file. Throws ConfigError, naming file and line.
[[nodiscard]] std::vector<FileValue> read_file(const std::filesystem::path& file, Tables tables = Tables::all);
/// Sets every value, in order. Throws ConfigError for one that its key does not take.
void set_all(const std::vector<FileValue>& values, KeyTable& table);
/// Reads a TOML file and sets every value in it.
void load_file(const std::filesystem::path& file, KeyTable& table, Tables tables = Tables::all);

/// Reads the file of a plant or a model as a model. Its table [plant] is a whole model: values that it does not name
/// have their defaults, and those that only a simulated plant has are left out. Its table [model] takes precedence;
/// alone it gives only the values that it names. Throws ConfigError, naming file and line, also for a profile, which no
/// rig can follow.
[[nodiscard]] std::vector<FileValue> read_model(const std::filesystem::path& file);

/// The folder of configuration files that belongs to this program: $ABS_HIL_CONFIG_DIR, else the installed one beside
/// the program, else the source tree's. Throws ConfigError if there is none.
[[nodiscard]] std::filesystem::path config_dir();

/// The folder that came with the program: as config_dir(), but without $ABS_HIL_CONFIG_DIR.
[[nodiscard]] std::filesystem::path own_config_dir();

/// Names the folder that own_config_dir() returns from now on, for a program without such a folder beside it: Python.
/// Not thread-safe: call it before any other function of this file.
void set_own_config_dir(std::filesystem::path folder);

/// The names of the TOML files in a folder, sorted.
[[nodiscard]] std::vector<std::string> names_in(const std::filesystem::path& folder);

/// A TOML file: itself if it is a path or ends in .toml, else that of the name in the folder. Throws ConfigError,
/// naming `option` and the known ones.
/// @param what  of a name that is not known: "unknown plant"
[[nodiscard]] std::filesystem::path named_file(std::filesystem::path (*folder)(), std::string_view what,
                                               std::string_view name_or_file, std::string_view option);

/// A plant by name or file: `name` alone is config_dir()/plants/name.toml. Throws ConfigError, naming `option` and the
/// known plants.
[[nodiscard]] std::filesystem::path plant_file(std::string_view name_or_file, std::string_view option = "--plant");

/// Where the model's values come from, in a sentence: "model rig.toml: identified on 2026-11-22, 3 days ago". The date
/// is the line `identified = DATE` that abs_identify writes into a model's file. Throws ConfigError for an unreadable
/// file.
[[nodiscard]] std::string model_origin(const Settings& settings, std::chrono::sys_days today);

struct PlantEntry {
  std::string name;
  std::string description;
};
/// The plants in config_dir()/plants, by name.
[[nodiscard]] std::vector<PlantEntry> known_plants();

}  // namespace abs_hil::config
