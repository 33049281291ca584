// Configuration files, plants by name, and the folders in which they stand.
#include "config/config_file.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>

#include "config/config_error.hpp"
#include "config/reader.hpp"
#include "rig/formatted_text.hpp"
#include "rig/nearest_name.hpp"
#include "rig/parse_toml.hpp"

namespace abs_hil::config {

namespace fs = std::filesystem;

namespace {

toml::table parse(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) {
    throw ConfigError(fmt::format("{}: {}; give the path of a TOML file", file.string(),
                                  fs::exists(file, error) ? "not a regular file" : "no such file"));
  }
  try {
    std::ifstream in(file, std::ios::binary);
    if (!in)
      throw ConfigError(
          fmt::format("{}: cannot be read: {}", file.string(), rig::refusal(errno, file.string(), rig::reading)));
    return rig::parse_toml(in, file.string());
  } catch (const toml::parse_error& problem) {
    throw ConfigError(
        fmt::format("{}:{}: not valid TOML: {}", file.string(), problem.source().begin.line, problem.description()));
  }
}

bool is_table(const std::string& name) {
  Settings settings;
  const KeyTable keys(settings);
  return std::ranges::any_of(keys.keys(), [&](const Key& key) { return key.name.starts_with(name + '.'); });
}

std::vector<FileValue> values_of(const toml::table& table, const fs::path& file) {
  std::vector<FileValue> values;
  const auto is_empty = [](const toml::table& inner) { return inner.empty(); };
  for_each_value(table, {}, is_empty, [&](const std::string& name, Place, const toml::node& node) {
    const std::string origin = fmt::format("{}:{}", file.string(), node.source().begin.line);
    if (node.is_table()) {
      // An empty table sets nothing, so that no key's check would notice a misspelled name.
      if (!is_table(name)) values.push_back({name, std::string(), origin});
    } else if (const std::optional<Value> value = value_in(node)) {
      values.push_back({name, *value, origin});
    } else {
      throw ConfigError(fmt::format("{}: {} is neither a number, a flag nor a text; give one of them", origin, name));
    }
  });
  return values;
}

/// The first of the places that is a folder.
fs::path first_folder(const std::vector<fs::path>& places) {
  std::error_code error;
  for (const fs::path& place : places) {
    if (fs::is_directory(place, error)) return place;
  }
  throw ConfigError(fmt::format("no configuration folder at {}; set ABS_HIL_CONFIG_DIR to the project's config/",
                                places.back().string()));
}

fs::path plants_dir() { return config_dir() / "plants"; }

fs::path& given_own_config_dir() {
  static fs::path folder;
  return folder;
}

}  // namespace

std::vector<FileValue> read_file(const fs::path& file, Tables tables) {
  toml::table table = parse(file);
  table.erase("description");
  if (tables == Tables::of_plant) table.erase("identified");  // its date, see model_origin()
  if (tables == Tables::of_plant) {
    for (const auto& [key, node] : table) {
      if ((key.str() == "plant" || key.str() == "model") && node.is_table()) continue;
      throw ConfigError(fmt::format("{}:{}: {} does not belong in this file; give the tables [plant] and [model] only",
                                    file.string(), node.source().begin.line, std::string_view(key.str())));
    }
  }
  return values_of(table, file);
}

void set_all(const std::vector<FileValue>& values, KeyTable& keys) {
  for (const FileValue& value : values) keys.set(value.name, value.value, value.origin);
}

void load_file(const fs::path& file, KeyTable& keys, Tables tables) { set_all(read_file(file, tables), keys); }

std::vector<FileValue> read_model(const fs::path& file) {
  const auto is_of_plant = [](const FileValue& value) { return value.name.starts_with("plant."); };
  std::vector<FileValue> given = read_file(file, Tables::of_plant);
  if (std::ranges::none_of(given, is_of_plant)) return given;
  Settings settings;
  KeyTable table(settings);
  for (const FileValue& value : given) {
    const bool of_model = model_key(table.keys(), value.name) != nullptr;
    // The table refuses a misspelled name, too.
    if (of_model || !is_of_plant(value) || find_key(table.keys(), value.name) == nullptr) {
      table.set(value.name, value.value, value.origin);
    } else if (value.name.ends_with("_profile") && !text_of(value.value).empty()) {
      throw ConfigError(
          fmt::format("{}: {}: only a simulated plant can follow a profile; leave it out or use --backend sim",
                      value.origin, value.name));
    }
  }
  std::vector<FileValue> model;
  for (const Key& key : table.keys()) {
    if (key.name.starts_with("model.")) model.push_back({key.name, value_of(key), file.string()});
  }
  return model;
}

void set_own_config_dir(fs::path folder) { given_own_config_dir() = std::move(folder); }

fs::path own_config_dir() {
  std::error_code error;
  std::vector<fs::path> places;
  if (const fs::path& given = given_own_config_dir(); !given.empty()) places.push_back(given);
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  if (!error) places.push_back(program.parent_path().parent_path() / "share" / "abs_hil" / "config");
  places.emplace_back(ABS_HIL_SOURCE_CONFIG_DIR);
  places.emplace_back(ABS_HIL_INSTALLED_CONFIG_DIR);  // for a program elsewhere that links the installed library
  return first_folder(places);
}

fs::path config_dir() {
  const char* given = std::getenv("ABS_HIL_CONFIG_DIR");
  return given != nullptr ? first_folder({given}) : own_config_dir();
}

std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".toml") names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
  return names;
}

fs::path named_file(fs::path (*folder)(), std::string_view what, std::string_view name_or_file,
                    std::string_view option) {
  fs::path given(name_or_file);
  if (given.has_parent_path() || given.extension() == ".toml") return given;
  fs::path named = folder() / fmt::format("{}.toml", name_or_file);
  if (std::error_code error; fs::is_regular_file(named, error)) return named;
  const std::vector<std::string> known = names_in(folder());
  throw ConfigError(fmt::format("{}: {} \"{}\"{}; known: {}; or give a TOML file", option, what, name_or_file,
                                rig::nearest_hint(name_or_file, known), fmt::join(known, ", ")));
}

fs::path plant_file(std::string_view name_or_file, std::string_view option) {
  return named_file(&plants_dir, "unknown plant", name_or_file, option);
}

std::string model_origin(const Settings& settings, std::chrono::sys_days today) {
  const std::string& name = settings.model_name.empty() ? settings.plant_name : settings.model_name;
  const auto date = parse(plant_file(name, "--model"))["identified"].value<toml::date>();
  if (!date) {
    return fmt::format("model {}: not identified from the rig's own logs; abs_hil identify does that", name);
  }
  const std::chrono::sys_days day = std::chrono::year{date->year} / date->month / date->day;
  return fmt::format("model {}: identified on {:04}-{:02}-{:02}, {} days ago", name, date->year, date->month, date->day,
                     (today - day).count());
}

std::vector<PlantEntry> known_plants() {
  std::vector<PlantEntry> plants;
  for (const std::string& name : names_in(plants_dir())) {
    plants.push_back({name, parse(plant_file(name))["description"].value_or(std::string())});
  }
  return plants;
}

}  // namespace abs_hil::config
