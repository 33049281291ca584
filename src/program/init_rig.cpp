// `abs_hil init-rig NAME`: a plant's file to fill in for a rig of one's own.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <memory>

#include "config/config_error.hpp"
#include "config/explain.hpp"
#include "files/result_file.hpp"
#include "program/subcommands.hpp"

namespace abs_hil::program {

namespace {

int init_rig(const config::Settings& settings, const std::string& name) {
  const auto is_plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; };
  if (name.empty() || !std::all_of(name.begin(), name.end(), is_plain)) {
    throw config::ConfigError(fmt::format("init-rig: \"{}\": give a name of letters, digits, - and _", name));
  }
  const std::filesystem::path file = name + ".toml";
  std::error_code ignored;
  if (std::filesystem::exists(std::filesystem::symlink_status(file, ignored))) {
    throw config::ConfigError(
        fmt::format("init-rig: {} exists already; give another name or move it away", file.string()));
  }
  try {
    files::write_result(file, "model file", config::rig_file(settings, name));
  } catch (const files::FileError& error) {
    throw config::ConfigError(std::string("init-rig: ") + error.what());
  }
  fmt::print(
      "{0}: fill in the values of your rig. Then: abs_hil --plant {0}, abs_hil commission --set rig.identity={0}, "
      "abs_hil --backend rig --set rig.identity={0} --model {0}\n",
      file.string());
  return exit_completed;
}

}  // namespace

Action add_init_rig(cli::Parser& parser, const Words&) {
  const auto o = std::make_shared<config::Sources>();
  const auto name = std::make_shared<std::string>();
  parser.add("name", name.get(), "name of the rig", {.type = "NAME", .required = true});
  parser.add("--plant", &o->plant, "plant whose values it begins with, by name or TOML file", {.type = "NAME|FILE"});
  return [o, name] { return init_rig(config::merged_settings(*o), *name); };
}

}  // namespace abs_hil::program
