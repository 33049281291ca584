// Finds experiments by name or file, and reads each file once in a process.
#include "config/library.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>

#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "rig/nearest_name.hpp"

namespace abs_hil::config {

namespace fs = std::filesystem;

namespace {

/// A configuration folder of the user may lack experiments. Then those of the program serve.
fs::path experiments_dir() {
  const fs::path named = config::config_dir() / "experiments";
  std::error_code error;
  return fs::is_directory(named, error) ? named : config::own_config_dir() / "experiments";
}

std::vector<std::string> known_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(experiments_dir(), error)) {
    if (entry.path().extension() == ".toml") names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

fs::path file_of(const std::string& name_or_file) {
  fs::path given(name_or_file);
  if (given.has_parent_path() || given.extension() == ".toml") return given;
  fs::path named = experiments_dir() / (name_or_file + ".toml");
  if (std::error_code error; fs::is_regular_file(named, error)) return named;
  const std::vector<std::string> known = known_names();
  const std::vector<std::string_view> views(known.begin(), known.end());
  throw config::ConfigError(fmt::format("--experiment: unknown experiment \"{}\"{}; known: {}; or give a TOML file",
                                        name_or_file, rig::nearest_hint(name_or_file, views), fmt::join(known, ", ")));
}

std::shared_ptr<const Script> read_once(const std::string& name, const fs::path& file) {
  static std::mutex mutex;
  static std::map<std::string, std::shared_ptr<const Script>> read;
  const std::scoped_lock lock(mutex);
  std::shared_ptr<const Script>& script = read[file.string()];
  if (!script) {
    Script fresh = load(file.string());
    fresh.name = name;
    script = std::make_shared<const Script>(std::move(fresh));
  }
  return script;
}

}  // namespace

std::shared_ptr<const Script> find(const std::string& name_or_file) {
  return read_once(name_or_file, file_of(name_or_file));
}

std::vector<std::shared_ptr<const Script>> known_experiments() {
  std::vector<std::shared_ptr<const Script>> scripts;
  for (const std::string& name : known_names()) scripts.push_back(find(name));
  return scripts;
}

}  // namespace abs_hil::config
