#include "config/model_origin.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <toml++/toml.h>

#include <fstream>

#include "config/config_error.hpp"
#include "config/config_file.hpp"
#include "rig/parse_toml.hpp"

namespace abs_hil::config {

std::string model_origin(const Settings& settings, std::chrono::sys_days today) {
  const std::string& name = settings.model_name.empty() ? settings.plant_name : settings.model_name;
  const std::string file = plant_file(name, "--model").string();
  toml::table table;
  try {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw ConfigError(fmt::format("{}: cannot be read; give a file with read permission", file));
    table = rig::parse_toml(in, file);
  } catch (const toml::parse_error& problem) {
    throw ConfigError(
        fmt::format("{}:{}: not valid TOML: {}", file, problem.source().begin.line, problem.description()));
  }
  const auto date = table["identified"].value<toml::date>();
  if (!date) {
    return fmt::format("model {}: not identified from the rig's own logs; abs_hil identify does that", name);
  }
  const std::chrono::sys_days day = std::chrono::year{date->year} / date->month / date->day;
  return fmt::format("model {}: identified on {:04}-{:02}-{:02}, {} days ago", name, date->year, date->month, date->day,
                     (today - day).count());
}

}  // namespace abs_hil::config
